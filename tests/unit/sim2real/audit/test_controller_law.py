"""The commanded force recomputed from a log, against the log of a stage that computes this law."""

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.plant import simulate
from sim2real.audit.controller_law import Timing, reconstruct_law
from sim2real.gap import prepare_replay
from stagedata import AxisSignals, Recording
from tests.unit.sim2real.audit.conftest import spoilt

STEP = 0.04  # N: 0x6077 of axis x


@pytest.fixture(scope="module")
def law(stage, recorded):
    return reconstruct_law(prepare_replay(recorded, stage), stage, "x")


def remainder(law, timing=None, bandwidth=None):
    """Logged minus recomputed force at usable samples [N], its mean taken out."""
    terms = law.terms(timing or Timing(), bandwidth)
    left = (law.force - terms.sum(axis=0))[law.usable]
    return left - left.mean()


def test_what_is_left_of_the_force_is_its_rounding(law):
    assert law.usable.mean() > 0.9
    assert remainder(law).std() == pytest.approx(STEP / np.sqrt(12.0), rel=0.25)


@pytest.mark.parametrize(
    "timing", [Timing(lag=1e-4), Timing(position=1e-4), Timing(demand=1e-3), Timing(resampled=1e-3)]
)
def test_every_shift_of_a_channel_shows(law, timing):
    assert remainder(law, timing).std() > 2.0 * remainder(law).std()


def test_another_current_loop_shows(law):
    assert remainder(law, bandwidth=500.0).std() > 1.2 * remainder(law).std()


def test_terms_are_the_parts_of_the_law(law):
    kp, ki, kd, offset = law.terms()
    doubled = replace(law, control=replace(law.control, kp=2.0 * law.control.kp))
    np.testing.assert_allclose(doubled.terms()[0], 2.0 * kp)
    np.testing.assert_allclose(doubled.terms()[1:], [ki, kd, offset])


def test_the_span_of_most_travel_is_a_window_of_the_same_law(law):
    part = law.most_travelled(300)
    assert len(part.place) == len(part.force) == 300
    assert not part.usable[:20].any()  # its derivative filter begins in mid-motion
    assert remainder(part).std() == pytest.approx(STEP / np.sqrt(12.0), rel=0.4)
    travel = np.abs(np.diff(part.demand)).sum()
    starts = range(0, len(law.place) - 300, 50)
    assert travel >= max(np.abs(np.diff(law.demand[s : s + 300])).sum() for s in starts)
    assert law.most_travelled(10**6) is law


def test_samples_beside_a_gap_are_not_used(stage, recorded):
    def drop(valid):
        kept = valid.copy()
        kept[400:403] = False
        return kept

    gapped = spoilt(recorded, valid=drop)
    law = reconstruct_law(prepare_replay(gapped, stage), stage, "x")
    assert not law.usable[396:407].any()
    assert law.usable[390]
    assert remainder(law).std() < STEP


def test_too_few_samples_are_refused(stage, recorded):
    few = spoilt(recorded, valid=lambda valid: np.arange(len(valid)) < 10)
    with pytest.raises(ValueError, match="axis x: only 10 valid samples"):
        reconstruct_law(prepare_replay(few, stage), stage, "x")


def test_a_clamped_output_halts_the_integrator(stage, recorded):
    """Against a stage whose drive runs into its peak force."""
    weak = replace(
        stage,
        axes=tuple(replace(a, control=replace(a.control, peak_force=12.0)) for a in stage.axes),
    )
    k = np.arange(600)
    demand = np.zeros((600, 2))
    demand[:, 0] = np.where((k > 50) & (k < 300), 2e-4, 0.0)
    response = simulate(weak, demand, np.zeros_like(demand), None)
    valid = np.ones(600, dtype=bool)
    axes = {
        axis.name: AxisSignals(
            demand[:, a], np.zeros(600), response.position[:, a], response.force[:, a], None, valid
        )
        for a, axis in enumerate(weak.axes)
    }
    made = Recording(recorded.machine, "", "", k * 1e-3, axes, (), "peak")
    law = reconstruct_law(prepare_replay(made, weak), weak, "x")
    assert law.halted is not None
    assert law.halted.any()
    without = replace(law, halted=None)
    assert np.abs(remainder(law)).max() < 0.5 * np.abs(remainder(without)).max()
