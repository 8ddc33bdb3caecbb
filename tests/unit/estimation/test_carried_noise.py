"""What positions' errors leave in slipping elements: against differences, and dense matrices."""

import numpy as np
import pytest

from estimation.belief import LEVEL
from estimation.carried_noise import REACH, carry
from estimation.carried_weights import factor_carried, whiten_carried
from estimation.elements import ELEMENT_ROWS, SHARES
from estimation.gms import Friction, element_shares
from estimation.move_tables import (
    KNOTS,
    RESIDUAL,
    T_ACCELERATION,
    T_AT,
    T_POSITION,
    T_SHARE,
    T_SHARP,
    T_STUCK,
    T_UNTIL,
    T_VELOCITY,
    TABLES,
)
from estimation.rows import fill_rows
from estimation.trajectory import Limits, plan
from estimation.zones import differences, find_stretches, find_turns

TS, MASS, NOISE = 1e-3, 8.0, 1e-9
TRUE = Friction(4, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0)
SHAPE = np.array([2e-3, 1.0])
COUNT = 40
BEFORE = NOISE * (MASS / TS**2 - TRUE.viscous / (2 * TS))
AFTER = NOISE * (MASS / TS**2 + TRUE.viscous / (2 * TS))


def rows(position):
    """Residual of a move without force, the tables that it leaves, and the directions."""
    count = len(position) - 2
    tables, heading = np.zeros((TABLES, len(position))), np.zeros(count, dtype=np.int8)
    tables[T_POSITION] = position
    t = tables[:, :count]
    differences(
        position, np.ones(len(position), bool), TS, t[T_VELOCITY], t[T_ACCELERATION],
        np.zeros(count, bool),
    )  # fmt: skip
    find_turns(position, NOISE, heading, t[T_SHARE], t[T_AT], t[T_SHARP])
    find_stretches(heading, t[T_SHARE], t[T_UNTIL])
    elements, columns = np.zeros((ELEMENT_ROWS, 5)), np.empty((KNOTS, count))
    elements[SHARES, :4] = element_shares(4)
    p = np.zeros(KNOTS)
    p[:LEVEL] = [1.0, 1.0, 1.0, 1.0, 1.0, 0.4, 0.0]
    fill_rows(
        p, 0, np.array([6.0, 20.0, 6e5, 100.0, MASS, 1.0, 1.0]), SHAPE, NOISE, TS, np.zeros(4),
        6.0, 0.0, tables, heading, np.zeros(count, np.int8), True, True, columns, elements,
    )  # fmt: skip
    return columns[RESIDUAL], tables, heading


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_row_has_of_positions_before_what_the_row_before_keeps_of_them(sign):
    out = plan(0.0, 2e-3, Limits(0.5, 3.0, 200.0))
    position = np.concatenate(
        [np.zeros(4), out.sample((np.arange(0, int(out.duration / TS) + 6) + 0.3) * TS)[0]]
    )
    position = sign * position + np.random.default_rng(3).normal(0.0, NOISE, len(position))
    _, tables, heading = rows(position)
    count = len(position) - 2
    turn = int(np.flatnonzero(tables[T_SHARE, :count] >= 0.0)[0])
    pull, keep, left = np.empty((REACH, count)), np.empty(count), np.empty(count)
    carry(
        TRUE.coulomb, TRUE.stiffness, TRUE.relaxation_rate, TRUE.static_ratio, SHAPE, NOISE, TS,
        np.zeros(4), TRUE.coulomb, 0.0, tables, heading, np.zeros(count, np.int8),
        element_shares(4).copy(), pull, keep, left,
    )  # fmt: skip
    expected = np.zeros((turn, len(position)))
    slipping = np.zeros(len(position))  # what each position has left in slipping elements
    for k in range(turn):
        slipping *= keep[k]
        slipping[max(k - 1, 0) : k + 3] += pull[max(1 - k, 0) :, k]
        expected[k] = slipping
        expected[k, k : k + 3] += [BEFORE, -BEFORE - AFTER, AFTER]
        expected[k, k + 1] += NOISE * tables[T_STUCK, k]
    by_position = np.empty_like(expected)
    change = 0.01 * NOISE
    for j in range(len(position)):
        moved = np.array([position, position])
        moved[:, j] += [change, -change]
        up, down = (rows(x)[0][:turn] for x in moved)
        by_position[:, j] = (up - down) * NOISE / (2 * change)
    # The first one is what all travel is counted from: an unknown of its own. A fifth position
    # (the curve's last value before an element begins to slip) is left out.
    np.testing.assert_allclose(
        expected[:, 1:], by_position[:, 1:], rtol=1e-6, atol=0.1 * np.abs(pull).max()
    )
    assert left[turn] > 0.0 == left[0]


def test_weights_are_those_of_the_dense_covariance():
    rng = np.random.default_rng(1)
    stuck = np.where(np.arange(COUNT) < 8, 6e5, 0.0)
    keep = np.where(np.arange(COUNT) > 6, 0.9, 0.0)
    pull = np.where(np.arange(COUNT) > 5, 1.0, 0.0) * rng.normal(0.0, 1e-3, (REACH, COUNT))
    haze, share = np.zeros(COUNT), np.full(COUNT, -1.0)
    haze[30], share[30], white = 1e-4, 1.0, 1e-9
    keep[30:] = 0.0
    pull[:, 30:] = 0.0
    dense = np.zeros((COUNT, COUNT + 2))
    slipping = np.zeros(COUNT + 2)
    for k in range(COUNT):
        slipping *= keep[k]
        slipping[max(k - 1, 0) : k + 3] += pull[max(1 - k, 0) :, k]
        dense[k] = slipping
        dense[k, k : k + 3] += [BEFORE, -BEFORE - AFTER + NOISE * stuck[k], AFTER]
    dense[:, 0] = 0.0
    covariance = dense @ dense.T + white * np.eye(COUNT)
    covariance[30, 30] += haze[30]
    columns = rng.normal(size=(3, COUNT))
    expected = columns @ np.linalg.solve(covariance, columns.T)
    factor = np.empty((REACH, COUNT))
    factor_carried(
        MASS, TRUE.viscous, TS, NOISE, white, np.zeros(COUNT), stuck, share, haze,
        np.ones(COUNT, bool), pull, keep, np.zeros(COUNT), factor,
    )  # fmt: skip
    for row in columns:
        whiten_carried(row, keep, factor)
    np.testing.assert_allclose((columns * factor[0]) @ columns.T, expected, rtol=1e-6)


def test_nothing_is_kept_of_a_row_that_does_not_count():
    use = np.ones(COUNT, bool)
    use[20] = False
    keep, left = np.full(COUNT, 0.9), np.full(COUNT, 1e-6)
    none, factor = np.zeros(COUNT), np.empty((REACH, COUNT))
    factor_carried(
        MASS, TRUE.viscous, TS, NOISE, 1e-9, none, none, none - 1.0, none, use,
        np.zeros((REACH, COUNT)), keep, left, factor,
    )  # fmt: skip
    assert factor[0, 20] == keep[20] == keep[21] == 0.0
    assert (keep[22:] == 0.9).all()
    # What had been left there is as good as noise, not forgotten.
    assert 0.0 < factor[0, 21] < 1.0 / 1e-6
