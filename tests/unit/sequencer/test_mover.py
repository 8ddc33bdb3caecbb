"""How samples reach the estimator when the bus was not punctual."""

from dataclasses import dataclass

import numpy as np
import pytest

from estimation.trajectory import Limits
from stagectl.sequencer.mover import Mover, MovingAxis

TS = 1e-3


@dataclass
class Samples:
    position: np.ndarray
    force: np.ndarray
    valid: np.ndarray
    time: np.ndarray
    late: np.ndarray


class Echo:
    """A stage that is where it is told to be; at `skip` periods are passed over, `late` is late."""

    targets = (0.0,)

    def __init__(self, skip=(), late=()):
        self.k, self.periods, self.skip, self.late = 0, 0, skip, late

    def stream(self, position, offset, until=None):
        time, late, rows = [], [], []
        for row in position:
            if self.k in self.skip:
                self.periods += 2
            time.append(self.periods * TS)
            late.append(self.k in self.late)
            rows.append(row)
            self.k += 1
            self.periods += 1
            if until is not None and until(tuple(row)):
                break
        count = len(rows)
        return Samples(
            np.array(rows), np.full((count, 1), 1.5), np.ones((count, 1), dtype=bool),
            np.array(time), np.array(late),
        )  # fmt: skip


class Notes:
    """Stands in for the compensation: keeps what it is given."""

    def __init__(self):
        self.moves, self.moments = [], []

    def offsets(self, trajectory, samples, moment, position, rest_force, rest_offset):
        self.moments.append((moment, rest_force))
        return np.zeros(samples)

    def learn(self, move):
        self.moves.append(move)


def go(**trouble):
    notes = Notes()
    axis = MovingAxis("x", Limits(1.0, 10.0, 2000.0), 1e-9, notes)
    mover = Mover(Echo(**trouble), [axis], TS, lambda: False)
    mover.hold(0.02)
    mover.go("macro", 1, (0.01,), Limits(0.5, 3.0, 200.0), lambda _: None)
    mover.hold(0.03)
    mover.learn()
    return notes


def test_a_punctual_move_is_handed_over_as_it_is():
    notes = go()
    (move,) = notes.moves
    assert move.valid.all()
    assert move.time == pytest.approx(0.018)  # two samples at rest come first
    assert notes.moments == [(0.02, 1.5)]
    assert move.rest_force == 1.5
    assert move.position[0] == 0.0
    assert move.position[-1] == 0.01


def test_late_samples_do_not_count():
    plain, late = go().moves[0], go(late=(60, 61)).moves[0]
    assert (~late.valid).sum() == 2
    np.testing.assert_array_equal(late.position, plain.position)


def test_periods_passed_over_are_holes_in_time():
    plain, holed = go().moves[0], go(skip=(60,)).moves[0]
    assert len(holed.position) == len(plain.position) + 2
    assert (~holed.valid).sum() == 2
    hole = np.flatnonzero(~holed.valid)
    assert np.diff(hole).tolist() == [1]
    kept = np.delete(holed.position, hole)
    np.testing.assert_array_equal(kept, plain.position)
