"""What a move shows its planned force to lack, and what of it is fed forward."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from estimation.observer import (
    COUPLING,
    LEAD,
    MASS,
    Course,
    FeedforwardErrors,
    LearnedFeedforward,
)
from estimation.observer.feedforward_error import MOST, FeedforwardError
from estimation.trajectory import Limits, plan
from stagectl.config import load_machine
from stagectl.config.settings.observer import design_observers

PERIOD = 1e-3


@pytest.fixture(scope="module")
def design():
    return design_observers(load_machine())["x"]


def demand(target, count=400, period=PERIOD):
    """Setpoints of a macro-move, then rest."""
    motion = plan(0.0, target, Limits(0.5, 3.0, 200.0))
    return motion.sample(np.arange(1, count + 1) * period)[0]


def corrected(design, setpoints, across, mass, lead, coupling):
    """A course on which the axis follows, as the observer corrects what is lacking.

    The lacking force is built from the demand by differences, the correction by the observer's
    pace alone: no code is shared with what is tested.
    """
    own = design.figures
    m = own.carriage.mass
    before = np.concatenate((setpoints[:1], setpoints[:-1]))
    other = np.concatenate((across[:1], across[:-1]))
    acceleration = np.gradient(np.gradient(before, PERIOD), PERIOD)
    lacking = m * mass * acceleration + m * lead * np.gradient(acceleration, PERIOD)
    lacking += m * coupling * np.gradient(np.gradient(other, PERIOD), PERIOD)
    correction, pace = np.zeros(len(setpoints)), 0.0
    for k in range(3, len(setpoints)):
        pace += design.gain * (lacking[k - 3] - pace)
        correction[k] = pace
    first_tick = own.drive.control_period / PERIOD
    position = before + first_tick * (setpoints - before)
    return Course(setpoints, position, correction, across)


@pytest.mark.parametrize("lacking", [(0.08, 0.0, 0.0), (0.0, 4e-4, 0.0), (0.0, 0.0, 0.03)])
def test_mass_lead_and_coupling_are_told_apart(design, lacking):
    errors = FeedforwardErrors(design, design.figures.carriage.mass)
    found = errors.find(corrected(design, demand(0.025), demand(-0.06), *lacking))
    # the observer's lag, which is not the one assumed here, turns 8 % of mass into 0.2 ms
    error = np.abs(found.value - lacking)
    assert np.all(error <= np.maximum(np.multiply(0.2, lacking), [0.01, 2.5e-4, 0.003]))
    assert np.argmax(np.abs(found.value) / MOST) == np.argmax(lacking / MOST)


def test_an_axis_at_rest_shows_coupling_alone(design):
    errors = FeedforwardErrors(design, design.figures.carriage.mass)
    rest = np.full(400, 0.01)
    found = errors.find(corrected(design, rest, demand(0.05), 0.08, 4e-4, 0.03))
    assert found.value[COUPLING] == pytest.approx(0.03, rel=0.1)
    assert found.information[MASS, MASS] == found.information[LEAD, LEAD] == 0.0


def test_axes_that_accelerate_alike_share_what_they_show(design):
    errors = FeedforwardErrors(design, design.figures.carriage.mass)
    rounded = np.round(demand(-0.05), 9)
    across = np.round(demand(-0.05 + 3e-8), 9)
    found = errors.find(corrected(design, rounded, across, 0.08, 0.0, 0.0))
    assert found.value[[MASS, COUPLING]] == pytest.approx([0.04, 0.04], abs=0.01)


def test_short_moves_and_rest_say_nothing(design):
    errors = FeedforwardErrors(design, design.figures.carriage.mass)
    rest = np.zeros(400)
    slow = plan(0.0, 5e-5, Limits(0.01, 0.2, 20.0)).sample(np.arange(1, 401) * PERIOD)[0]
    for setpoints in (rest, slow):
        course = corrected(design, setpoints, rest, 0.08, 0.0, 0.0)
        assert errors.find(replace_correction(course)) is None


def replace_correction(course):
    """The same with a correction that shows something."""
    return course._replace(correction=np.linspace(0.0, 1.0, len(course.demand)))


def move(value, sigma=(0.005, 3e-5, 0.005)):
    return FeedforwardError(np.array(value), np.diag(np.power(sigma, -2.0)))


def test_what_moves_show_again_and_again_is_fed_forward():
    learned = LearnedFeedforward()
    truth = np.array([0.09, 0.0, 0.03])
    for k in range(6):
        wander = 1e-3 * (-1) ** k
        learned.take(move(truth + np.array([wander, 0.0, wander]) - learned.fed))
        if k == 0:
            assert not learned.fed.any(), "one move explains only itself"
    assert learned.fed == pytest.approx(truth, abs=2e-3)
    for _ in range(20):
        learned.take(move(-learned.fed))  # the payload is gone
    assert learned.fed == pytest.approx(np.zeros(3), abs=2e-3)


def test_what_a_perfect_move_shows_is_not_fed_forward():
    learned = LearnedFeedforward()
    for _ in range(20):
        learned.take(move(np.array([-2e-3, -5e-5, 0.0]) - learned.fed))
    assert not learned.fed.any()


def test_what_differs_from_move_to_move_is_not():
    learned, random = LearnedFeedforward(), np.random.default_rng(5)
    for _ in range(60):
        seen = random.normal(0.0, 1.0, 3) * [0.03, 2e-4, 0.03]
        learned.take(move(seen - learned.fed))
        assert np.abs(learned.fed / MOST).max() < 0.03


def test_an_agreement_of_uncertain_moves_is_not():
    learned = LearnedFeedforward()
    for _ in range(3):  # coupling, where the other axis hardly moves
        learned.take(move((0.0, 0.0, 0.05), (0.005, 3e-5, 0.12)))
    assert learned.value[2] == pytest.approx(0.05, rel=0.2)
    np.testing.assert_array_equal(learned.fed, 0.0)


def test_what_is_more_than_plausible_is_not_fed_forward():
    learned = LearnedFeedforward()
    for _ in range(5):
        learned.take(move(np.array([-0.48, 5e-4, 0.0]) - learned.fed))
    assert learned.value[0] == pytest.approx(-0.48, rel=0.1)
    assert learned.fed == pytest.approx([0.0, 5e-4, 0.0], rel=0.1)


def test_thousands_of_moves_of_one_axis_alone():
    learned = LearnedFeedforward()
    alone = replace(move([0.05, 0.0, 0.0]), information=np.diag([4e4, 1e9, 0.0]))
    for _ in range(5000):
        learned.take(replace(alone, value=np.array([0.05, 0.0, 0.0]) - learned.fed))
    assert learned.fed == pytest.approx([0.05, 0.0, 0.0], abs=1e-6)
