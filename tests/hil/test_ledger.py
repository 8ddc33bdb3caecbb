"""Doubled, missed and late frames: counted in the cycle ledger, and when they stop the stage."""

from contextlib import contextmanager

import numpy as np
import pytest

from drivers.errors import BusError, ConfigurationError
from drivers.objects import SYNC_WINDOW
from hil_sim.bus import faults as f
from tests.lockstep import open_on, power_up, switch_on


@contextmanager
def enabled(machine, *faults, **bus_settings):
    """A stage on a bus with these faults, held until 1 s."""
    _, world = switch_on(machine, *faults, faulty=True)
    with open_on(world, machine, bus=bus_settings) as stage:
        power_up(stage)
        stage.idle(1.0 - world.now_ns * 1e-9)
        stage.enable()
        yield stage


def tpdos(*nth):
    return f.Frames(frozenset({0x182}), "drives", after=1.0, nth=frozenset(nth))


def test_a_late_tpdo_is_counted_as_missed(stage_machine):
    with enabled(stage_machine, f.Delay(tpdos(10), least=0.7e-3, most=0.7e-3)) as stage:
        samples = stage.hold(0.05)
    (row,) = np.flatnonzero(~samples.valid[:, 1])
    assert samples.extra[row + 1, 1] == 1
    assert samples.extra.sum() == 1
    assert samples.position[row, 1] == samples.position[row - 1, 1]


def away(stage, periods):
    """The host does something else for so many periods after every SYNC."""

    def until(_):
        clock = stage.clock
        clock.sleep_until_ns(clock.now_ns() + round(periods * stage.settings.period_ns))
        return False

    return until


def test_too_many_late_cycles_in_a_row_stop_the_stage(stage_machine):
    with enabled(stage_machine, max_late=3) as stage:
        rows = np.tile(stage.targets, (20, 1))
        with pytest.raises(BusError, match=r"SYNC was late 4 times in a row \(max_late is 3\)"):
            stage.stream(rows, np.zeros_like(rows), away(stage, 1.6))
        assert not stage.enabled


def test_sync_by_the_kernel_is_refused_where_it_cannot_be(stage_machine):
    with (
        pytest.raises(ConfigurationError, match=r"sync_source: kernel, but bus .*not SocketCAN"),
        enabled(stage_machine, sync_source="kernel"),
    ):
        pass


def there_and_back(stage):
    """Distance [m] from the demand one row before, on the way back after a pause."""
    phase = np.pi * np.arange(1, 101)[:, None] / 100
    ramp = np.array(stage.targets) + 1e-3 * (1 - np.cos(phase))
    out = stage.stream(ramp, np.zeros_like(ramp))
    stage.hold(0.2)
    stage.idle(0.3)
    stage.enable()
    back = stage.stream(ramp[::-1], np.zeros_like(ramp))
    assert out.valid.all()
    assert back.valid.all()
    return tuple(s.position[1:] - s.position_demand[:-1] for s in (out, back))


def test_with_a_sync_window_no_setpoint_is_dropped(stage_machine):
    """After a pause the last SYNC's window is over: the drives would drop the first set-points."""
    with enabled(stage_machine) as stage:
        expected = there_and_back(stage)
        assert stage.axes[0].node.read(SYNC_WINDOW) == 0
    with enabled(stage_machine, sync_window=0.8e-3) as stage:
        assert [axis.node.read(SYNC_WINDOW) for axis in stage.axes] == [800, 800]
        for one, other in zip(there_and_back(stage), expected, strict=True):
            np.testing.assert_allclose(one, other, atol=2e-7)  # a row is up to 30 um
