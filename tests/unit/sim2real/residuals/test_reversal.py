"""Friction around reversals."""

from dataclasses import replace

import numpy as np
import pytest

from sim2real.residuals.reversal import REACH, average_reversals
from tests.unit.sim2real.residuals.conftest import course_of

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


def test_few_long_strokes_do_not_prolong_the_mean_of_short_ones():
    """Strokes of 30 µm with one of 80 µm among them, none long enough for friction to be known."""
    ways = [30e-6, -30e-6, 30e-6, -30e-6, 80e-6, -80e-6, 30e-6, -30e-6]
    ramp = (1.0 - np.cos(np.pi * np.arange(1, 101) / 100)) / 2
    start = np.concatenate(([0.0], np.cumsum(ways)[:-1]))
    position = np.concatenate([s + way * ramp for s, way in zip(start, ways, strict=True)])
    for loop in average_reversals(course_of(position), MASS):
        for branch in (loop.approach["measured"], loop.departure["measured"]):
            assert 20e-6 < np.abs(branch.place).max() <= 31e-6


def test_without_reversals_there_are_no_loops(course):
    assert average_reversals(replace(course, strokes=course.strokes[:1]), MASS) == ()


def test_no_turn_is_made_of_two_recordings(turning):
    middle = turning.strokes[4].start
    apart = replace(turning, starts=(0, middle))
    assert sum(loop.turns for loop in average_reversals(apart, MASS)) == 7
