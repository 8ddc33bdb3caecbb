"""The gap of a model against recordings, and its floor."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hil_sim.effects.library import library
from hil_sim.plant.simulate import simulate
from sim2real.gap import closed, measure, prepare
from sim2real.recording import AxisSignals, Recording
from stagectl.config import load_machine, stage_settings
from stagectl.store.recording import read_recording

DATA = Path(__file__).parents[2] / "data"


@pytest.fixture(scope="module")
def stage():
    return stage_settings(load_machine())


@pytest.fixture(scope="module")
def recorded():
    return read_recording(DATA / "null-2.h5")


def test_null_recordings_are_within_the_bounds(stage, recorded):
    for signals in measure(recorded, stage).values():
        assert signals["position"].nominal < 0.15e-6
        assert signals["force"].nominal < 0.14
        assert 0.03e-6 < signals["position"].floor < 0.1e-6
        assert 0.05 < signals["force"].floor < 0.16
        assert signals["position"].unit == "m"


def test_a_wrong_mass_shows(stage, recorded):
    heavy = replace(stage, axes=(replace(stage.axes[0], mass=8.8), stage.axes[1]))
    right, wrong = measure(recorded, stage, draws=1), measure(recorded, heavy, draws=1)
    assert wrong["x"]["position"].nominal > 3 * right["x"]["position"].nominal
    assert wrong["y"]["position"].nominal == right["y"]["position"].nominal


def test_invalid_samples_do_not_count(stage, recorded):
    x = recorded.axes["x"]
    position, valid = x.position_actual.copy(), x.valid.copy()
    position[5000:5010] += 1e-3
    valid[5000:5010] = False
    masked = replace(
        recorded, axes={**recorded.axes, "x": replace(x, position_actual=position, valid=valid)}
    )
    clean, holed = measure(recorded, stage, draws=1), measure(masked, stage, draws=1)
    assert holed["x"]["position"].nominal == pytest.approx(clean["x"]["position"].nominal, rel=0.01)


def test_the_models_own_noise_free_run_has_no_gap(stage, recorded):
    demand = np.column_stack([a.position_demand for a in recorded.axes.values()])
    offset = np.column_stack([a.force_offset for a in recorded.axes.values()])
    response = simulate(stage, demand, offset, None)
    axes = {
        name: replace(
            signals, position_actual=response.position[:, i], force_actual=response.force[:, i]
        )
        for i, (name, signals) in enumerate(recorded.axes.items())
    }
    for signals in measure(replace(recorded, axes=axes), stage, draws=1).values():
        assert signals["position"].nominal == 0.0
        assert signals["force"].nominal == 0.0


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
    for signals in measure(recording, stage, draws=1).values():
        assert signals["force"].nominal < 0.1


def test_other_axes_are_an_error(stage, recorded):
    with pytest.raises(ValueError, match="axes x"):
        measure(recorded, replace(stage, axes=stage.axes[:1]))


def test_another_sync_period_is_an_error(stage, recorded):
    with pytest.raises(
        ValueError, match=r"samples are 0\.001 s apart, the model.s sync_period is 0"
    ):
        measure(recorded, replace(stage, sync_period=0.002))


@pytest.mark.parametrize("coupled", [False, True])
def test_one_axis_runs_as_it_does_beside_the_others(stage, recorded, coupled):
    if coupled:
        effect = library()["cross_coupling"].at(mass=0.3)
        stage = replace(stage, axes=(replace(stage.axes[0], effects=(effect,)), stage.axes[1]))
    replay = prepare(recorded, stage)
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
    for signals in measure(late, stage, draws=1).values():
        assert signals["position"].nominal == 0.0
        assert signals["force"].nominal == 0.0


def test_a_gap_beyond_all_numbers_is_told_without_a_share(stage, recorded):
    x = recorded.axes["x"]
    far = replace(x, force_actual=np.full_like(x.force_actual, 1e300))
    gap = measure(replace(recorded, axes={**recorded.axes, "x": far}), stage, draws=1)
    assert gap["x"]["force"].nominal == np.inf
    assert closed(gap, gap) is None
