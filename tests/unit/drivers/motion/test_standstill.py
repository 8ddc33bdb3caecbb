"""Halts on a scripted bus: those that succeed and those that do not."""

import pytest

from drivers.drive import State
from drivers.errors import AxisFault
from tests.unit.drivers.conftest import rest

X, Y = 0, 1
HALT = 0x0100


def test_a_halt_removes_the_force_offsets_and_clears_its_bit(enabled, scripted):
    position, offset = rest(enabled, 3)
    enabled.stream(position, offset + 4.0)
    halted = []
    for drive in scripted.drives:
        drive.on_sync = lambda d, n: d.latched[0] & HALT and halted.append(d.latched[2])
    enabled.halt()
    assert len(halted) >= 2 * 20  # rest is looked at for so many SYNCs, on both axes
    assert set(halted) == {0}
    assert [d.latched[0] & HALT for d in scripted.drives] == [0, 0]
    assert enabled.enabled


@pytest.mark.parametrize("axis", [X, Y])
def test_a_halt_that_does_not_come_to_rest_names_the_axis_that_moves(enabled, scripted, axis):
    def creeps(drive, count):
        drive.position = 5 * count  # 5 um/s: 100 nm over the SYNCs that are looked at

    scripted.drives[axis].on_sync = creeps
    begin = scripted.clock.now
    with pytest.raises(AxisFault, match=rf"^axis {'xy'[axis]}: .*still moves 2 s after halt"):
        enabled.halt()
    assert scripted.clock.now - begin > 2e9
    assert not enabled.enabled


def test_an_axis_that_trembles_within_the_rest_band_is_at_rest(enabled, scripted):
    def trembles(drive, count):
        drive.position = 45 * (count % 2)  # nm

    scripted.drives[Y].on_sync = trembles
    enabled.halt()
    assert enabled.enabled


@pytest.mark.parametrize("state", [State.FAULT, State.QUICK_STOP_ACTIVE, State.SWITCHED_ON])
def test_an_axis_that_leaves_operation_enabled_during_a_halt_is_named(enabled, scripted, state):
    def leaves(drive, count):
        if drive.latched[0] & HALT:
            drive.state = state

    scripted.drives[Y].on_sync = leaves
    text = rf"^axis y: .*left OPERATION ENABLED during a halt; .*\({state}\)"
    with pytest.raises(AxisFault, match=text):
        enabled.halt()
    assert scripted.drives[X].state is State.SWITCH_ON_DISABLED


def test_a_halt_waits_for_an_axis_that_brakes(enabled, scripted):
    def brakes(drive, count):
        drive.position = min(1000 * (count - begin), 100_000)

    begin, scripted.drives[Y].on_sync = scripted.drives[Y].syncs, brakes
    enabled.halt()
    assert scripted.drives[Y].syncs - begin >= 100 + 20
    assert enabled.targets[Y] == pytest.approx(1e-4)
