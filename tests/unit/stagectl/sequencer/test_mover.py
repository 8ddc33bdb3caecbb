"""Moves and holds: what reaches the estimator from an unpunctual bus, and what is learned."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from estimation.trajectory import Limits
from stagectl.sequencer import MovingAxis
from stagectl.sequencer.mover import Mover
from tests.unit.stagectl.sequencer.echo import TS, Echo


class Notes:
    """Stands in for the compensation, and keeps what it is given."""

    known, observed = None, False

    def __init__(self, revise_at=math.inf):
        self.moves, self.moments, self.asked = [], [], []
        self.revise_at = revise_at

    def force_offsets(self, motion, rest):
        self.moments.append((rest.time, rest.force))
        return np.zeros(motion.samples)

    def learn(self, move):
        self.moves.append(move)

    def revision_time(self, trajectory):
        return self.revise_at

    def revise_offsets(self, motion, offsets, sent, move):
        self.asked.append((sent, move))
        revised = offsets.copy()
        revised[sent:] = 7.0
        return revised


def make_move(revise_at=math.inf, **trouble):
    notes = Notes(revise_at)
    axis = MovingAxis("x", Limits(1.0, 10.0, 2000.0), 1e-9, notes)
    stage = Echo(**trouble)
    mover = Mover(stage, [axis], TS, lambda: False)
    mover.hold(0.02)
    mover.move_to((0.01,), Limits(0.5, 3.0, 200.0), "macro", 1, lambda _: None)
    mover.hold(0.03)
    mover.learn()
    notes.offsets_sent = np.concatenate(stage.offsets)[:, 0]
    return notes


def test_a_punctual_move_reaches_the_estimator_unchanged():
    notes = make_move()
    (move,) = notes.moves
    assert move.valid.all()
    assert move.time == pytest.approx(0.018)  # two samples at rest come first
    assert notes.moments == [(0.02, 1.5)]
    assert move.rest_force == 1.5
    assert move.position[0] == 0.0
    assert move.position[-1] == 0.01


def test_samples_of_late_syncs_are_invalid():
    plain, late = make_move().moves[0], make_move(late=(60, 61)).moves[0]
    assert (~late.valid).sum() == 2
    np.testing.assert_array_equal(late.position, plain.position)


def test_samples_with_an_unusual_delay_are_invalid():
    plain, ragged = make_move().moves[0], make_move(straggling=(60, 70)).moves[0]
    assert np.diff(np.flatnonzero(~ragged.valid)).tolist() == [10]
    np.testing.assert_array_equal(ragged.position, plain.position)


def test_skipped_periods_become_invalid_samples():
    plain, holed = make_move().moves[0], make_move(skip=(60,)).moves[0]
    assert len(holed.position) == len(plain.position) + 2
    assert (~holed.valid).sum() == 2
    hole = np.flatnonzero(~holed.valid)
    assert np.diff(hole).tolist() == [1]
    kept = np.delete(holed.position, hole)
    np.testing.assert_array_equal(kept, plain.position)


def test_a_move_revises_its_remaining_offsets():
    plain, revised = make_move(), make_move(revise_at=0.05)
    ((sent, seen),) = revised.asked
    assert sent == 50
    assert len(seen.position) == 2 + 50  # two samples at rest come first
    np.testing.assert_array_equal(seen.position, plain.moves[0].position[:52])
    assert (revised.offsets_sent[: 20 + 50] == 0.0).all()
    assert (revised.offsets_sent[20 + 50 :] == 7.0).all()  # and the rest holds the last one
    np.testing.assert_array_equal(revised.moves[0].position, plain.moves[0].position)


class Everywhere:
    """Friction over the table; keeps the moves that it learns from.

    `unknown`: kinds of moves along which it does not know friction.
    """

    def __init__(self, unknown=()):
        self.learned, self.unknown, self.place = [], unknown, (0.0, 0.01)

    def expected_at(self, target, time):
        if math.dist(target, self.place) < 2e-3:
            return None
        self.place = target
        return [None, None]

    def coulomb_variation(self, axis, path):
        return np.zeros(len(path))

    def knows_path(self, kind):
        return kind not in self.unknown

    def learn(self, axis, kind, estimate, time):
        self.learned.append((axis, kind))


class Learning(Notes):
    def level_with_target(self, move, variation):
        return move

    def carry_state(self, move, variation):
        self.carried = True

    def learn(self, move):
        super().learn(move)
        return SimpleNamespace(estimate=None)


class EchoOfTwo(Echo):
    targets = (0.0, 0.01)


def learned_from(places, *moves):
    """The axes after these moves of two, the second of which begins at 10 mm."""
    axes = [MovingAxis(n, Limits(1.0, 10.0, 2000.0), 1e-9, Learning()) for n in "xy"]
    mover = Mover(EchoOfTwo(), axes, TS, lambda: False, places)
    mover.hold(0.02)
    for kind, target in moves:
        mover.move_to(target, Limits(0.5, 3.0, 200.0), kind, 1, lambda _: None)
        mover.hold(0.03)
        mover.learn()
    return axes


def test_an_axis_that_rests_early_says_nothing_about_the_target():
    """The Coulomb force changes while the other axis moves on; within a place, it does count."""
    places = Everywhere()
    axes = learned_from(places, ("macro", (0.03, 0.01005)), ("micro", (0.03, 0.0101)))
    assert places.learned == [(0, "macro"), (1, "micro")]
    assert axes[1].compensation.carried  # its friction state is followed all the same


def test_along_an_unknown_path_only_the_friction_state_is_carried():
    places = Everywhere(unknown=("macro",))
    axes = learned_from(places, ("macro", (0.03, 0.04)), ("other", (0.0315, 0.0415)))
    assert places.learned == [(0, "other"), (1, "other")]
    assert all(axis.compensation.carried for axis in axes)
