"""What differs along a move: asked of the places, handed to the axes, and reported back."""

from types import SimpleNamespace

import numpy as np
import pytest

from estimation.move import MoveData
from estimation.trajectory import Limits, plan
from stagectl.config import load_machine
from stagectl.sequencer import Mode, make_compensation
from stagectl.sequencer.compensation.axis_compensation import AtRest, AxisMotion
from stagectl.sequencer.compensation.path_friction import PathFriction
from stagectl.sequencer.compensation.places import Expectation
from tests.unit.stagectl.machines import with_effects

TS = 1e-3
LIMITS = Limits(0.5, 3.0, 200.0)
MOTION = (plan(0.0, 0.02, LIMITS), plan(0.0, 0.0, LIMITS))
COUNT = 260
DEMAND = np.column_stack([m.sample(np.arange(1, COUNT + 1) * TS)[0] for m in MOTION])
MAGNETS = "effect: cogging, amplitude: 2, pitch: 0.032, phase: 0"


class Tilted:
    """A table whose Fc rises by 1 % a millimetre along x; it remembers what it is told."""

    def __init__(self, here=False, answer=None):
        self.here, self.answer, self.learned = here, answer, []
        self.target = 0.0

    def expected_at(self, target, time):
        self.target = target[0]
        return None if self.here else [Expectation(7.0, 0.2), None]

    def coulomb_variation(self, axis, path):
        return 10.0 * (path[:, 0] - self.target)

    def knows_path(self, kind):
        return kind == "micro"

    def learn(self, axis, kind, estimate, time):
        self.learned.append((axis, kind, estimate, time))
        return self.answer


@pytest.fixture
def axes():
    return make_compensation(load_machine(), Mode.ESTIMATED)


@pytest.fixture
def known_axes():
    return make_compensation(with_effects(MAGNETS), Mode.ESTIMATED)


def records(path, force=6.0):
    ok = np.ones(len(path), dtype=bool)
    return [MoveData(path[:, a], np.full(len(path), force), ok, 0.1, 0.0) for a in range(2)]


def predict(axis, motion=None):
    """The axis' force offsets: from here on its friction has a state."""
    axis.force_offsets(motion or AxisMotion(MOTION[0], None, COUNT), AtRest(0.1, 0.0, 3.0, 3.0))


def test_the_axis_gets_what_is_expected_at_its_target_and_the_variation_up_to_it(axes):
    friction = PathFriction(axes, Tilted(), TS)
    x, y = friction.begin((0.02, 0.0), MOTION, DEMAND, 0.1)
    assert friction.varies
    assert axes[0].estimator.friction.coulomb == pytest.approx(7.0)
    assert axes[1].estimator.friction.coulomb == pytest.approx(9.0)  # of which nothing is known
    np.testing.assert_allclose(x.variation, 10.0 * (DEMAND[:, 0] - 0.02))
    assert x.variation[-1] == pytest.approx(0.0, abs=1e-9)
    assert (x.trajectory, x.across, x.samples) == (*MOTION, COUNT)
    assert (y.trajectory, y.across) == MOTION[::-1]


@pytest.mark.parametrize("places", [None, Tilted(here=True)])
def test_without_a_map_or_at_the_same_place_nothing_changes(axes, places):
    before = [axis.estimator.friction for axis in axes]
    friction = PathFriction(axes, places, TS)
    x, _ = friction.begin((0.02, 0.0), MOTION, DEMAND, 0.1)
    assert not friction.varies
    assert [axis.estimator.friction for axis in axes] == before
    assert x.variation is None
    taken = records(DEMAND)
    assert friction.measure(taken, DEMAND) == taken
    assert friction.leveled(0, taken[0]) is taken[0]
    np.testing.assert_array_equal(friction.hold_offsets(np.array([1.0, 2.0]), 3), [[1, 2]] * 3)


def test_a_record_over_a_tilted_table_reads_as_on_a_level_one(axes):
    friction = PathFriction(axes, Tilted(), TS)
    x, _ = friction.begin((0.02, 0.0), MOTION, DEMAND, 0.1)
    predict(axes[0], x)
    tilted = records(DEMAND)
    fast = slice(60, 120)
    own = 7.0 * (1.0 + 10.0 * (DEMAND[:, 0] - 0.02)) + 20.0 * np.gradient(DEMAND[:, 0], TS)
    tilted[0] = MoveData(DEMAND[:, 0], own, tilted[0].valid, 0.1, 0.0)
    bare = friction.measure(tilted, DEMAND)
    level = friction.leveled(0, bare[0]).force - 20.0 * np.gradient(DEMAND[:, 0], TS)
    np.testing.assert_allclose(level[fast], 7.0, rtol=0.03)
    assert np.abs(own[fast] - 20.0 * np.gradient(DEMAND[:, 0], TS)[fast] - 7.0).max() > 0.5


def test_what_the_place_knows_after_the_move_is_adopted_without_touching_the_elements(axes):
    places = Tilted(answer=Expectation(6.6, 0.1, (0.01, 0.02)))
    friction = PathFriction(axes, places, TS)
    estimate = SimpleNamespace(name="estimate")
    predict(axes[0])
    before = axes[0].estimator.state.forces.copy()
    assert before.any()
    friction.report(0, "micro", SimpleNamespace(estimate=estimate), 3.0)
    assert places.learned == [(0, "micro", estimate, 3.0)]
    assert axes[0].estimator.friction.coulomb == pytest.approx(6.6)
    np.testing.assert_allclose(axes[0].estimator.state.forces, before)


def test_moves_are_learned_from_where_the_path_is_known(axes):
    friction = PathFriction(axes, Tilted(), TS)
    assert friction.is_known("micro")
    assert not friction.is_known("macro")
    assert PathFriction(axes, None, TS).is_known("macro")


def test_a_known_force_is_taken_from_the_record_before_anything_is_learned(known_axes):
    friction = PathFriction(known_axes, None, TS)
    friction.begin((0.02, 0.0), MOTION, DEMAND, 0.1)
    cogging = 2.0 * np.sin(2.0 * np.pi / 0.032 * DEMAND[:, 0])
    met = records(DEMAND)
    met[0] = MoveData(DEMAND[:, 0], 6.0 + cogging, met[0].valid, 0.1, 0.0)
    bare = friction.measure(met, DEMAND)
    np.testing.assert_allclose(bare[0].force, 6.0, atol=1e-6)
    np.testing.assert_array_equal(bare[1].force, met[1].force)
