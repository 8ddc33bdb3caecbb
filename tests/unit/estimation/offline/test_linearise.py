"""Normal equations with each block's own unknowns eliminated, against the whole problem at once."""

import numpy as np
import pytest

from estimation.offline.linearise import NormalEquations

SHARED, KNOTS, ROWS = 3, (2, 4, 3), 40


@pytest.fixture
def blocks():
    """Jacobian by shared unknowns and knots, residual, information and value of the knots."""
    rng = np.random.default_rng(5)
    made = []
    for knots in KNOTS:
        root = rng.normal(size=(knots, knots))
        made.append(
            (
                rng.normal(size=(ROWS, SHARED + knots)), rng.normal(size=ROWS),
                root @ root.T + np.eye(knots), 0.1 * rng.normal(size=knots),
            )
        )  # fmt: skip
    return made


def equations_of(blocks):
    made = NormalEquations(SHARED, len(blocks))
    for jacobian, residual, prior, level in blocks:
        sums = jacobian.T @ jacobian, jacobian.T @ residual, float(residual @ residual), ROWS
        made.add(sums, prior, level)
    return made


def whole_step(blocks):
    """Gauss-Newton step of all unknowns together, and the knots' steps."""
    total = SHARED + sum(KNOTS)
    normal, slope, at = np.zeros((total, total)), np.zeros(total), SHARED
    for jacobian, residual, prior, level in blocks:
        knots = len(level)
        index = np.r_[0:SHARED, at : at + knots]
        normal[np.ix_(index, index)] += jacobian.T @ jacobian
        slope[index] += jacobian.T @ residual
        own = slice(at, at + knots)
        normal[own, own] += prior
        slope[own] += prior @ level
        at += knots
    step = -np.linalg.solve(normal, slope)
    return step[:SHARED], np.split(step[SHARED:], np.cumsum(KNOTS)[:-1])


def test_the_step_is_that_of_the_whole_problem(blocks):
    equations = equations_of(blocks)
    step = -np.linalg.solve(equations.curvature, equations.slope)
    shared, knots = whole_step(blocks)
    np.testing.assert_allclose(step, shared, rtol=1e-10)
    for mine, theirs in zip(equations.knot_steps(step), knots, strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-9)


def test_sums_are_those_of_the_blocks(blocks):
    equations = equations_of(blocks)
    chi = sum(residual @ residual for _, residual, _, _ in blocks)
    prior = sum(level @ information @ level for _, _, information, level in blocks)
    assert equations.chi == pytest.approx(chi)
    assert equations.cost == pytest.approx(chi + prior) == pytest.approx(equations.costs.sum())
    assert equations.samples == ROWS * len(blocks)
    np.testing.assert_allclose(equations.scores.sum(axis=0), equations.slope)


def test_a_block_that_does_not_count_leaves_the_others_alone(blocks):
    alone = equations_of(blocks[:1])
    with_it = NormalEquations(SHARED, 2)
    with_it.skip(KNOTS[1])
    jacobian, residual, prior, level = blocks[0]
    sums = jacobian.T @ jacobian, jacobian.T @ residual, float(residual @ residual), ROWS
    with_it.add(sums, prior, level)
    np.testing.assert_allclose(with_it.curvature, alone.curvature)
    assert with_it.cost == pytest.approx(alone.cost)
    skipped, counted = with_it.knot_steps(np.ones(SHARED))
    assert not skipped.any()
    np.testing.assert_allclose(counted, alone.knot_steps(np.ones(SHARED))[0])
