"""The gap of a model against recordings, and its floor."""

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.plant import simulate
from sim2real.findings import GapFigures
from sim2real.gap import (
    GapMeter,
    combined_gap,
    compare_with_model,
    gap_closed,
    measure_gap,
    pool_gaps,
)
from stagectl.store import write_recording
from stagectl.store.recording_blocks import RecordingBlocks
from tests.unit.sim2real.conftest import DATA


def test_null_recordings_are_within_the_bounds(stage, recorded):
    for signals in measure_gap(recorded, stage).values():
        assert signals["position"].nominal < 0.15e-6
        assert signals["force"].nominal < 0.14
        assert 0.03e-6 < signals["position"].floor < 0.1e-6
        assert 0.05 < signals["force"].floor < 0.16
        assert signals["position"].unit == "m"


@pytest.mark.parametrize("skipped", [0, 7])
def test_blocks_give_the_figures_of_the_whole(stage, recorded, tmp_path, skipped):
    """Also where the host paused between two blocks: the model goes on from where it was."""
    blocks = RecordingBlocks(DATA / "null-2.h5", 3000)
    joint = len(next(iter(blocks)))
    late = recorded.time + 1e-3 * skipped * (np.arange(len(recorded)) >= joint)
    whole = replace(recorded, time=late)
    write_recording(whole, tmp_path / "r.h5")
    blocks = RecordingBlocks(tmp_path / "r.h5", 3000)
    done = []
    meter = GapMeter(stage, 2, lambda *count: done.append(count), len(blocks))
    for block in blocks:
        meter.add(block)
    expected = compare_with_model(whole, stage, 2)
    assert len(blocks) == 4
    assert done[-1] == (12, 12)
    for axis, signals in expected.gap.items():
        for signal, figures in signals.items():
            found = meter.gap()[axis][signal]
            assert found.nominal == pytest.approx(figures.nominal, rel=1e-9)
            assert found.floor == pytest.approx(figures.floor, rel=1e-9)


def test_a_wrong_mass_shows(stage, recorded):
    heavy = replace(stage, axes=(replace(stage.axes[0], mass=8.8), stage.axes[1]))
    right, wrong = measure_gap(recorded, stage, draws=1), measure_gap(recorded, heavy, draws=1)
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
    clean, holed = measure_gap(recorded, stage, draws=1), measure_gap(masked, stage, draws=1)
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
    for signals in measure_gap(replace(recorded, axes=axes), stage, draws=1).values():
        assert signals["position"].nominal == 0.0
        assert signals["force"].nominal == 0.0


def test_a_gap_that_is_not_finite_has_no_share(stage, recorded):
    x = recorded.axes["x"]
    far = replace(x, force_actual=np.full_like(x.force_actual, 1e300))
    gap = measure_gap(replace(recorded, axes={**recorded.axes, "x": far}), stage, draws=1)
    assert gap["x"]["force"].nominal == np.inf
    assert gap_closed(gap, gap) is None


def gap(position, force):
    return {
        "x": {"position": GapFigures(position, 1e-7, "m"), "force": GapFigures(force, 0.1, "N")}
    }


def test_gap_closed_counts_above_the_floor_only():
    assert combined_gap(gap(1e-7, 0.1)) == pytest.approx(1.0)
    assert gap_closed(gap(1e-6, 1.0), gap(1e-7, 0.1)) == pytest.approx(1.0)
    assert gap_closed(gap(1e-6, 1.0), gap(1e-6, 1.0)) == pytest.approx(0.0)
    assert gap_closed(gap(1e-6, 1.0), gap(2e-6, 2.0)) < 0
    assert gap_closed(gap(1.1e-7, 0.11), gap(1e-7, 0.1)) is None


def test_figures_of_several_recordings_pool_as_mean_squares():
    both = pool_gaps([(gap(1e-6, 3.0), 100), (gap(1e-6, 0.0), 300)])
    assert both["x"]["position"].nominal == pytest.approx(1e-6)
    assert both["x"]["force"].nominal == pytest.approx(1.5)
