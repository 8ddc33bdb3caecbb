"""Faults and stops on a scripted bus: what the host sends when drives misbehave."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
import pytest

from drivers.drive import State
from drivers.errors import (
    AxisFault,
    BusError,
    HomingError,
)
from drivers.stage import Stage
from tests.unit.drivers.conftest import rest

X, Y = 0, 1


def off(scripted: Any) -> bool:
    """Whether the last power command that the drives saw took their power away."""
    return all(d.latched[0] & 0xF in (0, 2) and d.latched[2] == 0 for d in scripted.drives)


def test_too_many_missed_tpdos_stop_all_axes(stage: Stage, scripted: Any) -> None:
    stage.enable()
    scripted.drives[Y].mute_tpdo = 1_000_000
    with pytest.raises(
        AxisFault, match=r"^axis y: 0x6041:00 statusword: no process data \(TPDO 0x182\) for 6"
    ):
        stage.stream(*rest(stage, 50))
    assert scripted.drives[X].state is not State.OPERATION_ENABLED
    assert off(scripted)


def _fault(drive: Any) -> None:
    drive.state = State.FAULT
    drive.objects[0x603F, 0] = 0x8611
    drive.emergency(0x8611)


def _fault_without_emergency(drive: Any) -> None:
    drive.state = State.FAULT
    drive.objects[0x603F, 0] = 0x7305


def _reboot(drive: Any) -> None:
    drive.emit(0x701, b"\0")


def _preoperational(drive: Any) -> None:
    drive.emit(0x701, b"\x7f")


@pytest.mark.parametrize(
    ("event", "text", "code"),
    [
        (_fault, r"^axis x: emergency: following error.*\(0x8611\), error register: gen", 0x8611),
        (
            _fault_without_emergency,
            r"^axis x: 0x6041:00 statusword: 0x0208: left OPERATION ENABLED, is in FAULT; "
            r"0x603F:00 error code: incremental sensor 1 fault \(0x7305\); "
            r".*statusword 0x0208 \(FAULT\); last commands: .*enable operation, mode 8, ",
            0x7305,
        ),
        (_reboot, r"^axis x: the drive rebooted", None),
        (_preoperational, r"^axis x: NMT state is PRE-OPERATIONAL, not OPERATIONAL", None),
    ],
)
def test_an_event_of_one_axis_stops_both_and_is_named(
    stage: Stage, scripted: Any, event: Any, text: str, code: int | None
) -> None:
    stage.enable()
    start = scripted.drives[X].syncs
    seen: list[Any] = []
    stage.sink = seen.append
    scripted.drives[X].on_sync = lambda d, n: event(d) if n == start + 10 else None
    with pytest.raises(AxisFault, match=text) as caught:
        stage.stream(*rest(stage, 1000))
    assert caught.value.code == code
    assert len(seen) == 10  # nothing is lost up to and with the cycle of the event
    assert off(scripted)
    assert scripted.drives[Y].state is not State.OPERATION_ENABLED


def test_a_lost_heartbeat_stops_all_axes(stage: Stage, scripted: Any) -> None:
    stage.enable()
    scripted.drives[X].objects[0x1017, 0] = 0
    with pytest.raises(AxisFault, match=r"^axis x: heartbeat lost: node 1 silent for 0\.3"):
        stage.stream(*rest(stage, 1000))
    assert off(scripted)


def test_a_bus_error_is_named_and_close_survives_it(stage: Stage, scripted: Any) -> None:
    stage.enable()

    def snap(drive: Any, count: int) -> None:
        scripted.broken = "transmit buffer full"

    scripted.drives[X].on_sync = snap
    with pytest.raises(BusError, match=r"^bus scripted:0: .*transmit buffer full"):
        stage.stream(*rest(stage, 10))
    stage.close()


def test_enabling_a_faulted_axis_says_why_and_reset_clears_it(stage: Stage, scripted: Any) -> None:
    drive = scripted.drives[Y]
    drive.state = State.FAULT
    drive.objects[0x603F, 0] = 0x3210
    with pytest.raises(AxisFault, match=r"axis y: .*reset first.*DC link over-voltage \(0x3210\)"):
        stage.enable()
    stage.reset_faults()
    stage.enable()
    assert stage.enabled


def test_disable_takes_the_force_offset_back_before_power_off(stage: Stage, scripted: Any) -> None:
    stage.enable()
    position, offset = rest(stage, 3)
    offset[:] = 4.0
    stage.stream(position, offset)
    first = len(scripted.sent)
    stage.disable()
    sent = [struct.unpack("<Hih", d) for _, i, d in scripted.sent[first:] if i == 0x201]
    offsets = [f for word, _, f in sent if word & 0xF == 0xF]
    assert offsets[-1] == 0
    assert offsets == sorted(offsets, reverse=True)
    assert max(-np.diff(offsets)) <= 3
    assert not stage.enabled


def _homing(outcome: list[int]) -> Any:
    """A drive's statusword bits 13, 12, 10 from the SYNC of the start bit on."""
    steps: list[int] = []

    def on_sync(drive: Any, count: int) -> None:
        if drive.state is State.OPERATION_ENABLED and drive.objects.get((0x6060, 0)) == 6:
            started = drive.controlword & 0x10
            steps.extend(outcome if started and not steps else [])
            drive.bits = (steps.pop(0) if len(steps) > 1 else steps[0]) if steps else 0x400

    return on_sync


def test_homing_waits_for_attained_and_reached_and_is_not_repeated(
    stage: Stage, scripted: Any
) -> None:
    for drive in scripted.drives:
        drive.on_sync = _homing([0x400, 0, 0, 0x1000, 0x1000, 0x1400])
    stage.home()
    assert stage.homed
    before = len(scripted.sent)
    stage.home()
    assert len(scripted.sent) == before


@pytest.mark.parametrize(
    ("outcome", "text"),
    [
        ([0, 0, 0x400], r"interrupted"),
        ([0, 0x2400], r"homing error"),
        ([0x400], r"did not begin within 0.5 s"),
    ],
)
def test_homing_failures_are_told_apart(
    stage: Stage, scripted: Any, outcome: list[int], text: str
) -> None:
    scripted.drives[X].on_sync = _homing([0x400, 0, 0x1400])
    scripted.drives[Y].on_sync = _homing(outcome)
    with pytest.raises(
        HomingError, match=r"^axis y: 0x6098:00 homing method: method 34: .*" + text
    ):
        stage.home()
    assert not stage.homed
    assert off(scripted)


def test_enable_does_not_trust_what_it_heard_long_ago(stage: Stage, scripted: Any) -> None:
    stage.enable()
    scripted.drives[X].state = State.SWITCH_ON_DISABLED
    stage.enable()
    assert stage.enabled
    assert scripted.drives[X].state is State.OPERATION_ENABLED


def test_a_drive_that_shows_0x0000_until_spoken_to_is_enabled(stage: Stage, scripted: Any) -> None:
    drive = scripted.drives[X]
    drive.state = State.NOT_READY_TO_SWITCH_ON

    drive.waits_for_word = True
    stage.enable()
    assert stage.enabled


@pytest.mark.parametrize("problem", [KeyboardInterrupt, RuntimeError])
def test_whatever_goes_wrong_in_the_application_stops_the_axes(
    stage: Stage, scripted: Any, problem: type[BaseException]
) -> None:
    stage.enable()

    def until(position: tuple[float, ...]) -> bool:
        raise problem

    with pytest.raises(problem):
        stage.stream(*rest(stage, 10), until=until)
    assert off(scripted)
    assert not stage.enabled
