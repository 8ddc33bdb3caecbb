"""Friction around reversals."""

from dataclasses import replace

import numpy as np
import pytest

from sim2real.residuals import average_reversals
from sim2real.residuals.reversal import REACH

MASS, COULOMB, REACHED = 8.0, 6.0, 20e-6


def presliding(course):
    """Force of friction that turns over within `REACHED` of each reversal, and of the mass."""
    x = course.position
    turns = np.concatenate(([0], np.flatnonzero(np.diff(np.sign(np.diff(x)))) + 1))
    since = np.searchsorted(turns, np.arange(len(x)), side="right") - 1
    gone = np.abs(x - x[turns[since]])
    way = np.where(since % 2 == 0, 1.0, -1.0)
    friction = COULOMB * way * np.minimum(2.0 * gone / REACHED - 1.0, 1.0)
    return friction + MASS * np.gradient(np.gradient(x, course.period), course.period)


@pytest.fixture
def turning(course):
    force = presliding(course)
    late = {**course.measured, "force": force - 1.0}
    return replace(course, measured={**course.measured, "force": force}, simulated={"before": late})


def test_the_loop_is_that_of_the_friction_whatever_the_mass(turning):
    forward, backward = average_reversals(turning, MASS)
    assert (forward.direction, backward.direction) == (1, -1)
    assert (forward.turns, backward.turns) == (4, 4)
    for loop in (forward, backward):
        approach, departure = loop.approach["measured"], loop.departure["measured"]
        assert np.all(loop.direction * approach.place <= 0.0)
        assert np.abs(approach.place).max() > 0.8 * REACH
        slid = np.abs(departure.place) > 1.5 * REACHED
        assert approach.force == pytest.approx(loop.direction * COULOMB, abs=0.1)
        assert departure.force[slid] == pytest.approx(-loop.direction * COULOMB, abs=0.1)
        turning_back = loop.direction * departure.force[~slid]
        assert np.all(np.diff(turning_back) < 0.0)


def test_the_model_is_averaged_likewise(turning):
    for loop in average_reversals(turning, MASS):
        for side in (loop.approach, loop.departure):
            assert side["before"].force == pytest.approx(side["measured"].force - 1.0, abs=1e-9)


def test_an_axis_that_lags_turns_where_it_turns(turning):
    lag = 30
    late = {name: np.roll(values, lag) for name, values in turning.measured.items()}
    (forward, _) = average_reversals(replace(turning, measured=late), MASS)
    assert forward.approach["measured"].force == pytest.approx(COULOMB, abs=0.1)


def test_without_reversals_there_are_no_loops(course):
    assert average_reversals(replace(course, strokes=course.strokes[:1]), MASS) == ()


def test_no_turn_is_made_of_two_recordings(turning):
    middle = turning.strokes[4].start
    apart = replace(turning, starts=(0, middle))
    assert sum(loop.turns for loop in average_reversals(apart, MASS)) == 7
