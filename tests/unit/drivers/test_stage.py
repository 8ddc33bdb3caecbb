"""The stage on a scripted bus: what is sent, and what happens when drives misbehave."""

from __future__ import annotations

import dataclasses
import struct
from typing import Any

import numpy as np
import pytest

from drivers.cia402 import State
from drivers.errors import (
    AxisFault,
    BusError,
    ConfigurationError,
    HomingError,
    LimitError,
    NodeError,
)
from drivers.settings import AxisSettings, BusSettings
from drivers.stage import Stage

X, Y = 0, 1


def rest(stage: Stage, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Setpoints that hold where the stage stands."""
    return np.tile(stage.targets, (count, 1)), np.zeros((count, len(stage.axes)))


def test_boot_maps_one_64_bit_pdo_each_way_and_disables_the_others(
    stage: Stage, scripted: Any
) -> None:
    held = scripted.drives[X].objects
    assert [held[0x1600, i] for i in range(4)] == [3, 0x60400010, 0x607A0020, 0x60B20010]
    assert [held[0x1A00, i] for i in range(4)] == [3, 0x60410010, 0x60640020, 0x60770010]
    assert (held[0x1400, 1], held[0x1800, 1]) == (0x201, 0x181)
    assert (held[0x1400, 2], held[0x1800, 2]) == (1, 1)
    assert held[0x1016, 1] == 127 << 16 | 500
    assert held[0x1017, 0] == 100
    assert (held[0x60C2, 1], struct.pack("b", -3)[0]) == (1, held[0x60C2, 2])
    assert (held[0x607D, 1], held[0x607D, 2]) == (2**32 - 150_000_000, 150_000_000)
    assert held[0x6065, 0] == 1_000_000
    assert scripted.drives[Y].objects[0x6072, 0] == 3333


def test_mapping_is_written_while_invalid_and_count_zero(stage: Stage, scripted: Any) -> None:
    writes = [w for w in scripted.drives[X].writes if w[0] in (0x1600, 0x1400)]
    kinds = [(i, s) for i, s, _ in writes]
    first, last = kinds.index((0x1600, 1)), kinds.index((0x1600, 3))
    assert writes[0][:2] == (0x1400, 1)
    assert writes[0][2] >> 31 == 1
    assert writes[first - 1] == (0x1600, 0, 0)
    assert writes[last + 1] == (0x1600, 0, 3)
    assert writes[-1] == (0x1400, 1, 0x201)


def test_missing_node_is_named(
    scripted: Any, bus_settings: BusSettings, axis_settings: tuple[AxisSettings, ...]
) -> None:
    scripted.drives[Y].silent = True
    with (
        Stage.open(bus_settings, axis_settings, bus_object=scripted) as stage,
        pytest.raises(NodeError, match=r"^axis y: no boot-up message from node 2 within 2 s"),
    ):
        stage.boot()


@pytest.mark.parametrize(
    ("key", "value", "error", "text"),
    [
        ((0x1018, 1), 0x22, NodeError, r"^axis x: 0x1018:01 vendor id: is 0x00000022, the EDS"),
        ((0x1018, 2), 0x99, NodeError, r"^axis x: 0x1018:02 product code: is 0x00000099"),
        ((0x1018, 3), 0x30000, NodeError, r"0x1018:03 .*major revision is 3, the EDS describes 1"),
        ((0x1000, 0), 0x191, NodeError, r"^axis x: 0x1000:00 device type: is profile 401"),
        ((0x6076, 0), 39000, ConfigurationError, r"0x6076:00 .*says 39 N, the settings 40 N"),
        ((0x6092, 1), 1000, ConfigurationError, r"0x6092:01 feed: factor group: .* 0.001 encoder"),
        ((0x6502, 0), 0x21, ConfigurationError, r"0x6502:00 .*cyclic synchronous position"),
    ],
)
def test_a_drive_that_is_not_the_expected_one_is_refused(
    scripted: Any, bus_settings: BusSettings, axis_settings: tuple[AxisSettings, ...],
    key: tuple[int, int], value: int, error: type[Exception], text: str,
) -> None:  # fmt: skip
    scripted.drives[X].objects[key] = value
    with (
        Stage.open(bus_settings, axis_settings, bus_object=scripted) as stage,
        pytest.raises(error, match=text),
    ):
        stage.boot()


def test_a_value_that_does_not_stay_written_is_found(
    scripted: Any, bus_settings: BusSettings, axis_settings: tuple[AxisSettings, ...]
) -> None:
    scripted.drives[Y].stuck.add((0x6065, 0))
    with (
        Stage.open(bus_settings, axis_settings, bus_object=scripted) as stage,
        pytest.raises(
            ConfigurationError,
            match=r"^axis y: 0x6065:00 following error window: wrote 1000000, the drive holds 0",
        ),
    ):
        stage.boot()


def test_a_mapping_that_does_not_stay_written_is_found(
    scripted: Any, bus_settings: BusSettings, axis_settings: tuple[AxisSettings, ...]
) -> None:
    scripted.drives[X].stuck.add((0x1600, 3))
    with (
        Stage.open(bus_settings, axis_settings, bus_object=scripted) as stage,
        pytest.raises(ConfigurationError, match=r"axis x: 0x1600:03 .*0x60B2:00 torque offset"),
    ):
        stage.boot()


def test_an_sdo_abort_names_object_value_and_reason(
    scripted: Any, bus_settings: BusSettings, axis_settings: tuple[AxisSettings, ...]
) -> None:
    scripted.drives[X].refuse[0x6072, 0] = 0x06090031
    with Stage.open(bus_settings, axis_settings, bus_object=scripted) as stage:
        with pytest.raises(NodeError) as caught:
            stage.boot()
        assert caught.value.abort_code == 0x06090031
        assert str(caught.value) == (
            "axis x: 0x6072:00 max torque: write of 3000 refused: Value of parameter written "
            "too high (abort 0x06090031)"
        )


def test_an_object_that_the_drive_does_without_is_passed_over(
    scripted: Any, bus_settings: BusSettings, axis_settings: tuple[AxisSettings, ...]
) -> None:
    scripted.drives[X].refuse[0x6007, 0] = 0x06020000
    with Stage.open(bus_settings, axis_settings, bus_object=scripted) as stage:
        stage.boot()
        stage.enable()
        assert stage.enabled


def test_enable_targets_the_actual_position_and_stream_returns_what_was_sent(
    stage: Stage, scripted: Any
) -> None:
    scripted.drives[X].position, scripted.drives[Y].position = 5_000, -7_000
    stage.enable()
    assert stage.targets == pytest.approx((5e-6, -7e-6))
    position, offset = rest(stage, 4)
    position[:, X] += np.arange(4) * 1.4e-9
    offset[:, Y] = 0.1234
    scripted.drives[X].force, scripted.drives[Y].force = 25, -50
    seen: list[tuple[int, ...]] = []
    stage.sink = seen.append
    samples = stage.stream(position, offset)
    np.testing.assert_allclose(
        samples.position_demand[:, X], [5e-6, 5.001e-6, 5.003e-6, 5.004e-6], atol=1e-15
    )
    np.testing.assert_allclose(samples.force_offset[:, Y], 0.12)  # 2 x 60 N / 1000
    np.testing.assert_allclose(samples.time, [0, 1e-3, 2e-3, 3e-3])
    assert scripted.drives[Y].latched == (0x0F, -7000, 2)
    np.testing.assert_allclose(samples.force, np.tile((1.0, -3.0), (4, 1)))
    # the drive samples before it takes the setpoint over
    np.testing.assert_allclose(samples.position[1:, X], samples.position_demand[:-1, X])
    assert samples.valid.all()
    assert not samples.late.any()
    assert seen[2] == (
        2_000_000,
        0,
        0,
        -1,
        5003,
        0,
        5001,
        25,
        0x227,
        1,
        0,
        0,
        -7000,
        2,
        -7000,
        -50,
        0x227,
        1,
        0,
        0,
    )


def test_streams_continue_the_sync_grid_and_until_ends_one(stage: Stage, scripted: Any) -> None:
    stage.enable()
    first = stage.stream(*rest(stage, 3))
    counted: list[tuple[float, ...]] = []

    def until(position: tuple[float, ...]) -> bool:
        counted.append(position)
        return len(counted) == 2

    second = stage.stream(*rest(stage, 50), until=until)
    assert len(second) == 2
    np.testing.assert_allclose(np.r_[first.time, second.time], np.arange(5) * 1e-3)
    syncs = [t for t, can_id, _ in scripted.sent if can_id == 0x80]
    assert set(np.diff(syncs[-5:])) == {1_000_000}


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda p: p.__setitem__((3, X), np.nan), r"axis x: 0x607A:00 .*row 3: nan m"),
        (lambda p: p.__setitem__((slice(2, None), Y), 0.2), r"axis y: 0x607D:02 .*row 2.*above"),
        (lambda p: p.__setitem__((0, X), 0.01), r"axis x: 0x607A:00 .*row 0.*velocity limit 1 m/s"),
    ],
)
def test_setpoints_outside_the_limits_send_nothing(
    stage: Stage, scripted: Any, change: Any, text: str
) -> None:
    stage.enable()
    before = len(scripted.sent)
    position, offset = rest(stage, 5)
    change(position)
    with pytest.raises(LimitError, match=text):
        stage.stream(position, offset)
    assert len(scripted.sent) == before


def test_a_few_missed_tpdos_are_marked_and_the_last_values_stand(
    stage: Stage, scripted: Any
) -> None:
    stage.enable()

    def drop(drive: Any, count: int) -> None:
        drive.position += 7
        drive.mute_tpdo = 1 if count == start + 3 else 0

    start = scripted.drives[X].syncs
    scripted.drives[X].on_sync = drop
    samples = stage.stream(*rest(stage, 6))
    assert samples.valid[:, X].tolist() == [True, True, False, True, True, True]
    assert samples.valid[:, Y].all()
    assert samples.position[2, X] == samples.position[1, X]
    assert np.isnan(samples.arrival[2, X])
    assert stage.missed == 1
    np.testing.assert_allclose(np.diff(samples.time), 1e-3)


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


def test_the_host_beats_every_100_ms_while_streaming(stage: Stage, scripted: Any) -> None:
    stage.enable()
    start = scripted.clock.now
    stage.stream(*rest(stage, 1000))
    beats = [t for t, can_id, _ in scripted.sent if can_id == 0x77F and t > start]
    assert len(beats) in (9, 10, 11)
    assert max(np.diff(beats)) <= 130_000_000


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


def test_streaming_before_enable_is_refused(stage: Stage) -> None:
    with pytest.raises(AxisFault, match="axis x: the stage is not enabled"):
        stage.stream(np.zeros((1, 2)), np.zeros((1, 2)))


def test_two_axes_on_one_node_are_refused(
    scripted: Any, bus_settings: BusSettings, axis_settings: tuple[AxisSettings, ...]
) -> None:
    with pytest.raises(ConfigurationError, match=r"axis x: node 1 is axis x's already"):
        Stage.open(bus_settings, (axis_settings[0], axis_settings[0]), bus_object=scripted)


def test_no_sdo_while_streaming(stage: Stage, scripted: Any) -> None:
    stage.enable()
    before = len(scripted.sent)
    stage.stream(*rest(stage, 300))
    ids = {can_id for _, can_id, _ in scripted.sent[before:]}
    assert ids == {0x080, 0x201, 0x202, 0x77F}


def test_a_reboot_sets_everything_up_anew(stage: Stage, scripted: Any) -> None:
    stage.enable()
    stage.boot()
    assert not stage.enabled
    stage.enable()
    assert len(stage.stream(*rest(stage, 3))) == 3


def test_enable_does_not_trust_what_it_heard_long_ago(stage: Stage, scripted: Any) -> None:
    stage.enable()
    scripted.drives[X].state = State.SWITCH_ON_DISABLED
    stage.enable()
    assert stage.enabled
    assert scripted.drives[X].state is State.OPERATION_ENABLED


def test_late_cycles_are_counted_and_never_sent_in_a_burst(stage: Stage, scripted: Any) -> None:
    stage.enable()

    def slow(position: tuple[float, ...]) -> bool:
        calls.append(position)
        if len(calls) == 3:
            scripted.clock.now += 3_700_000
        return False

    calls: list[tuple[float, ...]] = []
    samples = stage.stream(*rest(stage, 6), until=slow)
    assert samples.late.tolist() == [False, False, False, True, False, False]
    np.testing.assert_allclose(samples.time, np.array([0, 1, 2, 5, 6, 7]) * 1e-3)
    syncs = [t for t, can_id, _ in scripted.sent if can_id == 0x80][-6:]
    assert min(np.diff(syncs)) >= 300_000
    assert stage.late == 1


def test_a_duplicate_of_an_old_tpdo_is_not_taken_for_the_new_one(
    stage: Stage, scripted: Any
) -> None:
    """Of the axis that answers last: its old frame would end the cycle before its new one."""
    stage.enable()
    stage.sink = lambda sample: scripted.deliver(
        0x182, struct.pack("<Hih", 0x227, sample[11] - 5, 0)
    )
    position, offset = rest(stage, 6)
    position[:, Y] += np.arange(6) * 1e-7
    samples = stage.stream(position, offset)
    np.testing.assert_allclose(samples.position[1:, Y], samples.position_demand[:-1, Y])
    assert samples.valid.all()


def test_a_drive_that_shows_0x0000_until_spoken_to_is_enabled(stage: Stage, scripted: Any) -> None:
    drive = scripted.drives[X]
    drive.state = State.NOT_READY_TO_SWITCH_ON

    drive.waits_for_word = True
    stage.enable()
    assert stage.enabled


def test_an_eds_without_force_offset_leaves_it_out_of_the_rpdo(
    scripted: Any, bus_settings: BusSettings, axis_settings: tuple[AxisSettings, ...], tmp_path: Any
) -> None:
    text = axis_settings[0].eds.read_text()
    head, rest_ = text.split("[60B2]")
    other = tmp_path / "without.eds"
    other.write_text(head + rest_[rest_.index("\n[") :])
    axes = (dataclasses.replace(axis_settings[0], eds=other), axis_settings[1])
    with Stage.open(bus_settings, axes, bus_object=scripted) as stage:
        stage.boot()
        assert [scripted.drives[n].objects[0x1600, 0] for n in (X, Y)] == [2, 3]
        assert stage.limitations == (
            "axis x: 0x60B2:00 torque offset is not offered: force offsets are not sent",
        )


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
