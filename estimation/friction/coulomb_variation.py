"""Friction along a path on which the Coulomb force differs from place to place.

`variation` is the Coulomb force on the way relative to that at the move's target, minus 1.

Source: the slip equation of docs/reference/reference-stage.md, with Fc a function of the position.
"""

from __future__ import annotations

from dataclasses import replace

from estimation.friction.follow import follow
from estimation.friction.model import FrictionState
from estimation.kinematics import slope
from estimation.move import MoveData
from stagedata import F64, FrictionFigures


def level_with_target(
    friction: FrictionFigures,
    state: FrictionState,
    scaled: FrictionState,
    variation: F64,
    move: MoveData,
    period: float,
) -> MoveData:
    """A move's data as if the Coulomb force were everywhere what it is at the target.

    What the model says that the difference makes is taken from the force.

    Args:
        friction: the model at the target.
        state: friction state at rest before the move, its forces as they were; not changed.
        scaled: the same carried over to the target's Coulomb force; not changed.
        variation: at each sample, shape (K,).
        move: as sampled.
        period: of the samples [s].
    """
    if move.valid.sum() < 3:
        return move
    real = _follow(friction, state.copy(), variation, move, period)
    level = _follow(friction, scaled.copy(), None, move, period)
    return replace(move, force=move.force - (real - level))


def state_after(
    friction: FrictionFigures, state: FrictionState, variation: F64, move: MoveData, period: float
) -> FrictionState:
    """Friction state at the end of a move that begins in `state`.

    `variation` is float64[K], one for each sample; the rest as for `level_with_target`.
    """
    follower = state.copy()
    if move.valid.sum() >= 3:
        _follow(friction, follower, variation, move, period)
    return follower


def _follow(
    friction: FrictionFigures,
    state: FrictionState,
    variation: F64 | None,
    move: MoveData,
    period: float,
) -> F64:
    """Internal forces added up along a move [N], shape (K,); `state` is advanced."""
    path = move.path
    state.settle_at(float(path[0]))
    return follow(friction, state, path, slope(path, period), period, variation=variation)[0]
