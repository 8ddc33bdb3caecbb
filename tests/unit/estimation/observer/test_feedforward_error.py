"""What a move shows its planned force to lack."""

import numpy as np
import pytest

from estimation.observer import (
    COUPLING,
    LEAD,
    MASS,
    Course,
    FeedforwardErrors,
)
from estimation.observer.feedforward_error import SCALE
from estimation.trajectory import Limits, plan
from stagectl.config import load_machine
from stagectl.config.settings.observer import design_observers

PERIOD = 1e-3
REST = np.full(400, 0.01)


@pytest.fixture(scope="module")
def design():
    return design_observers(load_machine())["x"]


@pytest.fixture
def errors(design):
    return FeedforwardErrors(design, design.figures.carriage.mass)


def demand(target, count=400, period=PERIOD):
    """Setpoints of a macro-move, then rest."""
    motion = plan(0.0, target, Limits(0.5, 3.0, 200.0))
    return motion.sample(np.arange(1, count + 1) * period)[0]


def corrected(design, setpoints, across, mass, lead, coupling, measured=True):
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
    force = m * acceleration + 6.0 * np.sign(np.gradient(before)) + measured * lacking
    return Course(setpoints, position, correction, across, force)


@pytest.mark.parametrize("lacking", [(0.08, 0.0, 0.0), (0.0, 4e-4, 0.0), (0.0, 0.0, 0.03)])
def test_mass_lead_and_coupling_are_told_apart(design, errors, lacking):
    found = errors.find(corrected(design, demand(0.025), demand(-0.06), *lacking))
    # the observer's lag, which is not the one assumed here, turns 8 % of mass into 0.2 ms
    error = np.abs(found.value - lacking)
    assert np.all(error <= np.maximum(np.multiply(0.2, lacking), [0.01, 2.5e-4, 0.003]))
    assert np.argmax(np.abs(found.value) / SCALE) == np.argmax(lacking / SCALE)


def test_an_axis_at_rest_shows_coupling_alone(design, errors):
    found = errors.find(corrected(design, REST, demand(0.05), 0.08, 4e-4, 0.03))
    assert found.value[COUPLING] == pytest.approx(0.03, rel=0.1)
    assert found.information[MASS, MASS] == found.information[LEAD, LEAD] == 0.0


def test_axes_that_accelerate_alike_share_what_they_show(design, errors):
    rounded = np.round(demand(-0.05), 9)
    across = np.round(demand(-0.05 + 3e-8), 9)
    found = errors.find(corrected(design, rounded, across, 0.08, 0.0, 0.0))
    assert found.value[[MASS, COUPLING]] == pytest.approx([0.04, 0.04], abs=0.01)


def test_short_moves_and_rest_say_nothing(design, errors):
    rest = np.zeros(400)
    slow = plan(0.0, 5e-5, Limits(0.01, 0.2, 20.0)).sample(np.arange(1, 401) * PERIOD)[0]
    for setpoints in (rest, slow):
        course = corrected(design, setpoints, rest, 0.08, 0.0, 0.0)
        assert errors.find(replace_correction(course)) is None


def replace_correction(course):
    """The same with a correction that shows something."""
    return course._replace(correction=np.linspace(0.0, 1.0, len(course.demand)))


def test_much_more_mass_counts_if_the_measured_force_shows_it(design, errors):
    """SYNCs off the control ticks look like half of the mass, and take no force."""
    found = errors.find(corrected(design, demand(0.025), REST, 0.8, 0.0, 0.0))
    assert found.value[MASS] == pytest.approx(0.8, rel=0.1)
    assert (
        errors.find(corrected(design, demand(0.025), REST, 0.8, 0.0, 0.0, measured=False)) is None
    )


def test_positions_that_are_late_are_not_more_mass(design, errors):
    course = corrected(design, demand(0.025), REST, 0.08, 0.0, 0.0)
    assert errors.find(course) is not None
    drive, pace, seen = design.figures.drive, 0.0, np.zeros(400)
    age = 0.08 * design.figures.carriage.mass / drive.kd
    for k in range(3, 400):
        velocity = (course.demand[k - 3] - course.demand[max(k - 4, 0)]) / PERIOD
        pace += design.gain * (drive.kp * age * velocity - pace)
        seen[k] = pace
    assert errors.find(course._replace(correction=course.correction + seen)) is None


def test_a_spring_is_no_mass(design, errors):
    course = corrected(design, demand(0.025), REST, 0.0, 0.0, 0.0)
    pace, pull = 0.0, np.random.default_rng(3).normal(0.0, 0.02, 400)
    for k in range(3, 400):
        pace += design.gain * (150.0 * course.demand[k - 3] - pace)
        pull[k] += pace
    found = errors.find(course._replace(correction=pull))
    assert abs(found.value[MASS]) < 0.005
