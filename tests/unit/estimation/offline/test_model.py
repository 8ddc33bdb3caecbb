"""The general friction model: every derivative, and the estimator's own as a special case."""

import numpy as np
import pytest

from estimation.friction import FrictionState, element_shares, follow
from estimation.offline.model import KNOTS, lead
from stagedata import FrictionFigures

TS, COUNT, SPACING = 1e-3, 4, 0.05
THETA = np.array([6.0, 6e5, 100.0, 0.4, 2e-3, 1.2, 0.06])
SPRINGS, SHARES = np.array([0.4, 0.3, 0.2, 0.1]), np.array([0.1, 0.2, 0.3, 0.4])
LEVEL = np.array([0.01, -0.02, 0.015, 0.0, 0.01, -0.01])


def motion(count=240):
    t = np.arange(count) * TS
    return 150e-6 * np.sin(2 * np.pi * 6.3 * t) + 20e-6 * np.sin(2 * np.pi * 31 * t)


def run(theta=THETA, springs=SPRINGS, shares=SHARES, level=LEVEL, start=0.0, x=None):
    """Force and jacobian; the last column is by `start`, which stretches all elements alike."""
    x = motion() if x is None else x
    count = len(springs)
    forces = start * np.arange(1.0, count + 1)
    derivative = np.zeros((count, KNOTS + len(level) + 1))
    derivative[:, -1] = np.arange(1.0, count + 1)
    force = np.empty(len(x))
    jacobian = np.empty((len(x), 7 + 2 * count + len(level) + 1))
    lead(
        np.asarray(theta), np.asarray(springs), np.asarray(shares), forces,
        np.zeros(count, dtype=bool), derivative, np.array([0.0, x[0]]), np.asarray(level), SPACING,
        x, np.gradient(x, TS), TS, 4e-9, force, jacobian,
    )  # fmt: skip
    return force, jacobian


def unknowns():
    """Every number that the force depends on, as (argument, place)."""
    sizes = {"theta": 7, "springs": COUNT, "shares": COUNT, "level": len(LEVEL)}
    return [(name, i) for name, size in sizes.items() for i in range(size)] + [("start", 0)]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_every_derivative_is_that_of_the_force(sign):
    arguments = {"theta": THETA, "springs": SPRINGS, "shares": SHARES, "level": LEVEL}
    x = sign * motion()
    _, jacobian = run(x=x)
    for column, (name, i) in enumerate(unknowns()):
        value = 0.0 if name == "start" else float(arguments[name][i])
        step = 1e-6 * max(abs(value), 0.1)
        found = []
        for way in (step, -step):
            if name == "start":
                found.append(run(start=way, x=x)[0])
            else:
                changed = arguments[name].copy()
                changed[i] += way
                found.append(run(**(arguments | {name: changed}), x=x)[0])
        numeric = (found[0] - found[1]) / (2 * step)
        # Where an element breaks away the force has a kink: a few samples may differ there.
        largest = max(np.abs(numeric).max(), 1e-9)
        wrong = np.abs(jacobian[:, column] - numeric) > 2e-3 * largest
        assert wrong.mean() < 0.03, (name, i)


def test_it_is_the_estimators_model_where_that_is_enough():
    shares = element_shares(10)
    x = motion()
    friction = FrictionFigures(10, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0)
    known, _ = follow(friction, FrictionState.relaxed(10), x, np.gradient(x, TS), TS)
    theta = np.array([6.0, 6e5, 100.0, 0.4, 2e-3, 1.0, 0.0])
    force, _ = run(theta, np.full(10, 0.1), shares, np.zeros(6), x=x)
    # Within a step in which an element lands they may differ.
    np.testing.assert_allclose(force, known, atol=0.02)


def test_asymmetry_is_a_larger_force_one_way():
    slide = np.linspace(0.0, 20e-3, 300)
    theta = THETA.copy()
    forth, back = (run(theta, level=np.zeros(6), x=way * slide)[0][-1] for way in (1.0, -1.0))
    assert forth == pytest.approx(6.0 * 1.06, rel=1e-3)
    assert back == pytest.approx(-6.0 * 0.94, rel=1e-3)


def test_a_stuck_element_keeps_the_level_it_was_left_at():
    # Slid at +2 %, at rest while the level falls to -2 %: the force at rest stays.
    x = np.concatenate([np.linspace(0.0, 5e-3, 100), np.full(150, 5e-3)])
    level = np.array([0.02, 0.02, 0.02, -0.02, -0.02, -0.02])
    force, _ = run(level=level, x=x)
    assert force[-1] == force[100]
