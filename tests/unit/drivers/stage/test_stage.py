"""The stage as a whole on a scripted bus: a fault of one axis stops all, and is named."""

import struct

import can
import numpy as np
import pytest

from drivers.drive import State
from drivers.errors import AxisFault, BusError, ConfigurationError
from drivers.stage import Stage
from tests.unit.drivers.conftest import power_is_off, rest

X, Y = 0, 1


def _fault(drive):
    drive.state = State.FAULT
    drive.objects[0x603F, 0] = 0x8611
    drive.emergency(0x8611)


def _fault_without_emergency(drive):
    drive.state = State.FAULT
    drive.objects[0x603F, 0] = 0x7305


def _reboot(drive):
    drive.emit(0x701, b"\0")


def _preoperational(drive):
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
def test_a_fault_of_one_axis_stops_both_and_is_named(enabled, scripted, event, text, code):
    start = scripted.drives[X].syncs
    seen = []
    enabled.sink = seen.append
    scripted.drives[X].on_sync = lambda d, n: event(d) if n == start + 10 else None
    with pytest.raises(AxisFault, match=text) as caught:
        enabled.stream(*rest(enabled, 1000))
    assert caught.value.code == code
    assert len(seen) == 10  # nothing is lost up to and with the cycle of the event
    assert power_is_off(scripted)
    assert scripted.drives[Y].state is not State.OPERATION_ENABLED


@pytest.mark.parametrize(
    "problem",
    [
        can.CanOperationError("transmit buffer full"),
        OSError(19, "No such device"),
        ValueError("file descriptor cannot be a negative integer (-1)"),
    ],
)
@pytest.mark.parametrize("removed", [False, True])
def test_a_bus_error_is_named_and_close_survives_it(enabled, scripted, problem, removed):
    def snap(drive, count):
        scripted.broken, scripted.removed = problem, removed

    scripted.drives[X].on_sync = snap
    with pytest.raises(BusError, match=r"^bus scripted:0: cyclic exchange failed: \S") as caught:
        enabled.stream(*rest(enabled, 10))
    assert str(problem) in str(caught.value)
    enabled.close()


def test_enabling_a_faulted_axis_says_why_and_reset_clears_it(stage, scripted):
    drive = scripted.drives[Y]
    drive.state = State.FAULT
    drive.objects[0x603F, 0] = 0x3210
    with pytest.raises(AxisFault, match=r"axis y: .*reset first.*DC link over-voltage \(0x3210\)"):
        stage.enable()
    stage.reset_faults()
    stage.enable()
    assert stage.enabled


def test_disable_ramps_the_force_offset_to_zero_before_power_off(enabled, scripted):
    position, offset = rest(enabled, 3)
    offset[:] = 4.0
    enabled.stream(position, offset)
    first = len(scripted.sent)
    enabled.disable()
    sent = [struct.unpack("<Hih", d) for _, i, d in scripted.sent[first:] if i == 0x201]
    offsets = [f for word, _, f in sent if word & 0xF == 0xF]
    assert offsets[-1] == 0
    assert offsets == sorted(offsets, reverse=True)
    assert max(-np.diff(offsets)) <= 3
    assert not enabled.enabled


def test_enable_does_not_rely_on_an_old_statusword(enabled, scripted):
    scripted.drives[X].state = State.SWITCH_ON_DISABLED
    enabled.enable()
    assert enabled.enabled
    assert scripted.drives[X].state is State.OPERATION_ENABLED


def test_a_drive_that_shows_0x0000_until_the_first_controlword_is_enabled(stage, scripted):
    drive = scripted.drives[X]
    drive.state = State.NOT_READY_TO_SWITCH_ON

    drive.waits_for_word = True
    stage.enable()
    assert stage.enabled


@pytest.mark.parametrize("problem", [KeyboardInterrupt, RuntimeError])
def test_an_exception_in_the_application_stops_the_axes(enabled, scripted, problem):
    def until(position):
        raise problem

    with pytest.raises(problem):
        enabled.stream(*rest(enabled, 10), until=until)
    assert power_is_off(scripted)
    assert not enabled.enabled


def test_two_axes_on_one_node_are_refused(scripted, bus_settings, axis_settings):
    with pytest.raises(ConfigurationError, match=r"axis x: node 1 already is axis x"):
        Stage.open(bus_settings, (axis_settings[0], axis_settings[0]), bus_object=scripted)
