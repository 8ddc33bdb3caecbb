"""The commanded force recomputed from a log, against the log of a stage that computes this law."""

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.plant import simulate
from hil_sim.settings import CascadeSettings
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


def law_of(stage, recorded, demand, **control):
    """The law of axis x from a log of a stage whose control differs from the recorded one's."""
    other = replace(
        stage, axes=tuple(replace(a, control=replace(a.control, **control)) for a in stage.axes)
    )
    demand = np.column_stack((demand, np.zeros_like(demand)))
    response = simulate(other, demand, np.zeros_like(demand), None)
    valid = np.ones(len(demand), dtype=bool)
    axes = {
        axis.name: AxisSignals(
            demand[:, a],
            np.zeros(len(demand)),
            response.position[:, a],
            response.force[:, a],
            None,
            valid,
        )
        for a, axis in enumerate(other.axes)
    }
    time = np.arange(len(demand)) * 1e-3
    made = Recording(recorded.machine, "", "", time, axes, (), "other")
    return reconstruct_law(prepare_replay(made, other), other, "x")


def test_the_law_of_a_cascade_leaves_the_rounding_of_the_force(stage, recorded):
    """Position P over velocity PI, with feedforward of velocity."""
    loops = CascadeSettings(position_gain=40.0, velocity_gain=2000.0, velocity_integral=2e4)
    demand = 5e-3 * np.sin(2.0 * np.pi * 2.0 * np.arange(1500) * 1e-3) ** 2
    gains = {"kp": 40.0 * 2000.0, "ki": 40.0 * 2e4, "kd": 2000.0}
    law = law_of(stage, recorded, demand, cascade=loops, **gains)
    assert remainder(law).std() == pytest.approx(STEP / np.sqrt(12.0), rel=0.25)


def test_a_clamped_output_halts_the_integrator(stage, recorded):
    """Against a stage whose drive runs into its peak force."""
    k = np.arange(600)
    law = law_of(stage, recorded, np.where((k > 50) & (k < 300), 2e-4, 0.0), peak_force=12.0)
    assert law.halted is not None
    assert law.halted.any()
    without = replace(law, halted=None)
    assert np.abs(remainder(law)).max() < 0.5 * np.abs(remainder(without)).max()
