"""The stage from boot to disabling, however a run ends."""

from contextlib import suppress

import numpy as np
import pytest

from hil_sim.cia402 import State
from stagectl.config.machine import Effect
from stagectl.errors import Aborted, RunFault
from stagectl.run import HostSettings, Listener, execute
from stagectl.sequencer import Limitation, Mode, MoveStarted
from stagectl.store import read_notes, read_recording
from tests.unit.stagectl.machines import with_axes
from tests.unit.stagectl.run.whole import OVER_CURRENT, failing_at, request_for, stopping_at


@pytest.mark.parametrize("during", ["booting the drives", "homing", "enabling the drives"])
def test_a_stop_that_a_finalizer_swallows_is_not_lost(machine, tmp_path, during):
    """As `__del__` does, whose exceptions Python reports and forgets."""
    stops, phases = [], []

    def phase(name):
        phases.append(name)
        if name == during:
            with suppress(KeyboardInterrupt):
                stops[0]("stopped by the operator (Ctrl-C)")

    request = request_for(machine, tmp_path / "run", host=HostSettings(mode=Mode.NONE))
    result = execute(request, Listener(phase=phase, stoppable=stops.append))
    assert isinstance(result.error, Aborted)
    assert "Ctrl-C" in str(result.error)
    assert phases[phases.index(during) + 1].startswith("writing")


class InterruptedDesign:
    """A measurement; Ctrl-C arrives when an observer is designed by it."""

    def as_text(self):
        return "{}"

    def __getattr__(self, name):
        raise KeyboardInterrupt


def test_a_stop_while_observers_are_designed_leaves_no_journal(machine, tmp_path):
    host = HostSettings(measurement=InterruptedDesign())
    request = request_for(machine, tmp_path / "run", host=host)
    with pytest.raises(KeyboardInterrupt):
        execute(request, Listener())
    assert list((tmp_path / "run").iterdir()) == []


def test_the_phases_come_in_order_and_the_stage_ends_disabled(go, sites):
    phases, stages = [], []
    listener = Listener(phase=phases.append, switched_on=lambda *both: stages.extend(both))
    result = go(sites, "run", listener=listener)
    assert result.error is None
    named = [phase for phase in phases if phase.endswith(("drives", "homing", "disabling"))]
    assert named == ["booting the drives", "homing", "enabling the drives", "disabling"]
    assert phases[-1] == "writing recording and report"
    assert all(d.motion.state is State.SWITCH_ON_DISABLED for d in stages[0].drives)


def test_a_fault_ends_the_run_with_its_axis_and_all_axes_without_power(go, sites, tmp_path):
    listener, stages = failing_at(2, OVER_CURRENT)
    result = go(sites, "run", listener=listener)
    assert isinstance(result.error, RunFault)
    assert str(result.error).startswith("axis y")
    assert all(d.motion.state is not State.ENABLED for d in stages[0].drives)
    assert read_notes(tmp_path / "run" / "recording.h5").fault == str(result.error)


def test_an_error_of_ours_keeps_the_samples_and_is_shown(go, sites, tmp_path):
    def event(happened):
        if isinstance(happened, MoveStarted) and happened.site == 2:
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        go(sites, "run", listener=Listener(event=event))
    path = tmp_path / "run" / "recording.h5"
    assert {m.site for m in read_recording(path).moves} == {1}
    notes = read_notes(path)
    assert (notes.outcome, notes.fault) == ("fault", "internal error")


def test_a_stop_while_it_runs_comes_to_rest_within_the_limits(go, sites, machine):
    result = go(sites, "run", listener=stopping_at(MoveStarted, 2))
    assert isinstance(result.error, Aborted)
    limits = machine.axes["x"].limits
    demand = result.recording.axes["x"].position_demand
    velocity = np.diff(demand) / machine.bus.sync_period
    assert velocity[-1] == 0.0
    acceleration = np.diff(velocity) / machine.bus.sync_period
    assert np.abs(acceleration).max() <= 1.01 * limits.acceleration


@pytest.mark.parametrize("mode", [Mode.ESTIMATED, Mode.NONE])
def test_effects_that_are_not_compensated_are_named_where_anything_is(machine, tmp_path, mode):
    figures = {"amplitude": 0.01, "frequency": 20.0, "phase": 0.0}
    host = with_axes(machine, x={"effects": (Effect("floor_vibration", figures),)})
    events = []
    request = request_for(host, tmp_path / "run", host=HostSettings(mode=mode))
    result = execute(request, Listener(event=events.append))
    left = [e.text for e in events if isinstance(e, Limitation)]
    assert len(left) == (mode is Mode.ESTIMATED)
    assert all("floor_vibration" in text and text in result.notices for text in left)
