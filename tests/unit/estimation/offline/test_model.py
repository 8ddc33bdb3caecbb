"""The general friction model: every derivative, and the estimator's own as a special case."""

import numpy as np
import pytest

from estimation.friction import FrictionState, element_shares, follow
from estimation.offline.model import Figures, Level, Path, lead, make_prediction, make_state
from stagedata import FrictionFigures

TS, COUNT, SPACING = 1e-3, 4, 0.05
SPRINGS, SHARES = np.array([0.4, 0.3, 0.2, 0.1]), np.array([0.1, 0.2, 0.3, 0.4])
FIGURES = Figures(6.0, 6e5, 100.0, 0.4, 2e-3, 1.2, 0.06, SPRINGS, SHARES)
LEVEL = np.array([0.01, -0.02, 0.015, 0.0, 0.01, -0.01])


def motion(count=240):
    t = np.arange(count) * TS
    return 150e-6 * np.sin(2 * np.pi * 6.3 * t) + 20e-6 * np.sin(2 * np.pi * 31 * t)


def run(figures=FIGURES, level=LEVEL, start=0.0, x=None):
    """Force and Jacobian; the last column is by `start`, a factor on forces of 1, 2, 3 ... N."""
    x = motion() if x is None else x
    count = len(figures.springs)
    state = make_state(x[0], count, len(level), 1)
    state.by_start[:, 0] = np.arange(1.0, count + 1)
    state.forces[:] = start * state.by_start[:, 0]
    found = make_prediction(len(x), count, len(level), 1)
    lead(figures, Level(level, SPACING), Path(x, np.gradient(x, TS), TS, 4e-9), state, found)
    return found.force, np.hstack(found[1:])


def shifted(number, by):
    """Arguments of `run` with one number changed by `by` of itself, and the change.

    They are counted as the columns: scalar figures, k_i, nu_i, knots, start.
    """
    numbers = np.concatenate([FIGURES[:7], SPRINGS, SHARES, LEVEL, [0.0]])
    step = by * max(abs(numbers[number]), 0.1)
    numbers[number] += step
    scalars, springs, shares, level, start = np.split(
        numbers, np.cumsum([7, COUNT, COUNT, len(LEVEL)])
    )
    return Figures(*scalars, springs, shares), level, start[0], step


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_every_derivative_is_that_of_the_force(sign):
    x = sign * motion()
    _, jacobian = run(x=x)
    assert jacobian.shape == (len(x), 7 + 2 * COUNT + len(LEVEL) + 1)
    for number, column in enumerate(jacobian.T):
        found = []
        for way in (1e-6, -1e-6):
            *arguments, step = shifted(number, way)
            found.append(run(*arguments, x=x)[0])
        numeric = (found[1] - found[0]) / (2 * step)  # step: of the second, negative
        # Where an element breaks away the force has a kink: a few samples may differ there.
        largest = max(np.abs(numeric).max(), 1e-9)
        wrong = np.abs(column - numeric) > 2e-3 * largest
        assert wrong.mean() < 0.03, number


def test_it_is_the_estimators_model_where_that_is_enough():
    shares = element_shares(10)
    x = motion()
    friction = FrictionFigures(10, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0)
    known, _ = follow(friction, FrictionState.relaxed(10), x, np.gradient(x, TS), TS)
    figures = Figures(6.0, 6e5, 100.0, 0.4, 2e-3, 1.0, 0.0, np.full(10, 0.1), shares)
    force, _ = run(figures, np.zeros(6), x=x)
    # Within a step in which an element lands they may differ.
    np.testing.assert_allclose(force, known, atol=0.02)


def test_asymmetry_is_a_larger_force_one_way():
    slide = np.linspace(0.0, 20e-3, 300)
    forth, back = (run(level=np.zeros(6), x=way * slide)[0][-1] for way in (1.0, -1.0))
    assert forth == pytest.approx(6.0 * 1.06, rel=1e-3)
    assert back == pytest.approx(-6.0 * 0.94, rel=1e-3)


def test_a_stuck_element_keeps_the_level_it_was_left_at():
    # Slid at +2 %, at rest while the level falls to -2 %: the force at rest stays.
    x = np.concatenate([np.linspace(0.0, 5e-3, 100), np.full(150, 5e-3)])
    level = np.array([0.02, 0.02, 0.02, -0.02, -0.02, -0.02])
    force, _ = run(level=level, x=x)
    assert force[-1] == force[100]
