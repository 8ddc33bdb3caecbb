"""Recorded demands run through a model."""

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.effects.library import library
from hil_sim.plant import simulate
from sim2real.gap import measure_gap, prepare_replay
from stagedata import AxisSignals, Recording


def test_a_recording_that_starts_with_force_starts_the_model_so(stage):
    rest = [4.0, -6.0]
    demand = np.zeros((400, 2))
    response = simulate(stage, demand, demand, 5, rest_force=rest)
    axes = {
        name: AxisSignals(
            demand[:, i], demand[:, i], response.position[:, i], response.force[:, i], None,
            np.ones(400, dtype=bool),
        )
        for i, name in enumerate(("x", "y"))
    }  # fmt: skip
    recording = Recording("", "", "", np.arange(400) * 1e-3, axes, (), "made here")
    for signals in measure_gap(recording, stage, draws=1).values():
        assert signals["force"].nominal < 0.1


def test_other_axes_are_an_error(stage, recorded):
    with pytest.raises(ValueError, match="axes x"):
        measure_gap(recorded, replace(stage, axes=stage.axes[:1]))


def test_another_sync_period_is_an_error(stage, recorded):
    with pytest.raises(
        ValueError, match=r"samples are 0\.001 s apart, the model.s sync_period is 0"
    ):
        measure_gap(recorded, replace(stage, sync_period=0.002))


@pytest.mark.parametrize("coupled", [False, True])
def test_one_axis_runs_as_it_does_beside_the_others(stage, recorded, coupled):
    if coupled:
        effect = library()["cross_coupling"].at(mass=0.3)
        stage = replace(stage, axes=(replace(stage.axes[0], effects=(effect,)), stage.axes[1]))
    replay = prepare_replay(recorded, stage)
    whole = replay.run(stage)
    for name, signals in whole.items():
        for signal, values in replay.run_axis(stage, name).items():
            np.testing.assert_array_equal(values, signals[signal])


def test_periods_passed_over_are_part_of_the_model_too(stage, recorded):
    """A host that came late: SYNCs that never went out, the setpoint standing meanwhile."""
    count = len(recorded)
    kept = np.flatnonzero((np.arange(count) % 97 < 95) | (np.arange(count) < 3))
    sent = kept[np.searchsorted(kept, np.arange(count), side="right") - 1]
    names = list(recorded.axes)
    demand = np.column_stack([recorded.axes[n].position_demand for n in names])[sent]
    offset = np.column_stack([recorded.axes[n].force_offset for n in names])[sent]
    response = simulate(stage, demand, offset, None)
    axes = {
        name: AxisSignals(
            demand[kept, i], offset[kept, i],
            response.position[kept, i], response.force[kept, i],
            None, np.ones(len(kept), dtype=bool),
        )
        for i, name in enumerate(names)
    }  # fmt: skip
    late = Recording("", "", "", recorded.time[kept], axes, (), "made here")
    for signals in measure_gap(late, stage, draws=1).values():
        assert signals["position"].nominal == 0.0
        assert signals["force"].nominal == 0.0
