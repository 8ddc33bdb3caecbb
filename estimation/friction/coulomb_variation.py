"""Friction along a path on which the Coulomb force differs from place to place.

`follow` with a Coulomb force of its own for every sample: what slides follows it, what sticks keeps
its force. `variation` is the Coulomb force on the way relative to that at the move's target, minus
1.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from estimation.friction.follow import REST_BAND, follow, follow_positions, steps_within
from estimation.friction.law import F64
from estimation.friction.model import FrictionState, kernel_figures, make_constants
from estimation.move import MoveData
from estimation.trajectory import Trajectory
from stagedata import FrictionFigures

_STEPS = 5  # of the friction model per sample of a demand


def follow_varying(
    friction: FrictionFigures,
    state: FrictionState,
    variation: F64,
    position: F64,
    velocity: F64,
    period: float,
    substeps: int = 4,
    band: float = REST_BAND,
) -> F64:
    """Sum of the element forces along sampled positions [N], shape (K,).

    Args:
        friction: the model at the target.
        state: friction state at the sample before position[0], its forces as they are there;
            advanced in place.
        variation: at each sample, shape (K,).
        position: sampled positions [m], shape (K,).
        velocity: at the same samples [m/s], shape (K,).
        period: of the samples [s].
        substeps: steps inside a sample.
        band: displacement below which nothing moves [m].
    """
    force = np.empty(len(position))
    follow_positions(
        make_constants(friction), kernel_figures(friction, period),
        friction.coulomb * (1.0 + variation), state.forces, state.slipping, state.memory,
        np.ascontiguousarray(position),
        np.ascontiguousarray(velocity), steps_within(friction, substeps), band, force,
        np.empty((len(position), 3)),
    )  # fmt: skip
    return force


def varying_feedforward(
    friction: FrictionFigures,
    state: FrictionState,
    variation: F64,
    trajectory: Trajectory,
    period: float,
    ahead: float,
    sent: int = 0,
) -> F64:
    """Friction force along a demand, or the rest of one, relative to where it begins.

    As `feedforward.friction_feedforward`.

    Args:
        friction: the model at the target.
        state: friction state where it begins, its forces as they are there; not changed.
        variation: at every setpoint k = 1..K of the demand, shape (K,).
        trajectory: of the demand; setpoint k is at time k period.
        period: of the setpoints [s].
        ahead: how much earlier the force is wanted [s].
        sent: setpoints 1..sent are gone.

    Returns:
        Friction force minus that at `sent` [N], shape (K - sent,).
    """
    follower = state.copy()
    left = len(variation) - sent
    steps = np.arange(left * _STEPS + 1)
    time = np.asarray(sent * period + steps * (period / _STEPS), np.float64)
    place = np.interp(time, np.arange(1, len(variation) + 1) * period, variation)
    position, velocity, _ = trajectory.sample(time + ahead)
    begin = float(trajectory.sample(np.zeros(1))[0][0]) if sent == 0 else float(position[0])
    follower.settle_at(begin)
    first = follower.total + (friction.viscous * float(velocity[0]) if sent else 0.0)
    force = follow_varying(
        friction, follower, place[1:], position[1:], velocity[1:], period / _STEPS, 1, 0.0
    )
    change: F64 = force + friction.viscous * velocity[1:] - first
    return change[_STEPS - 1 :: _STEPS]


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
    position, velocity = _path(move, period)
    there, everywhere = state.copy(), scaled.copy()
    for follower in (there, everywhere):
        follower.settle_at(float(position[0]))
    real = follow_varying(friction, there, variation, position, velocity, period)
    level, _ = follow(friction, everywhere, position, velocity, period)
    return replace(move, force=move.force - (real - level))


def state_after(
    friction: FrictionFigures, state: FrictionState, variation: F64, move: MoveData, period: float
) -> FrictionState:
    """Friction state at the end of a move that begins in `state`; arguments as above."""
    follower = state.copy()
    if move.valid.sum() >= 3:
        position, velocity = _path(move, period)
        follower.settle_at(float(position[0]))
        follow_varying(friction, follower, variation, position, velocity, period)
    return follower


def _path(move: MoveData, period: float) -> tuple[F64, F64]:
    """Positions with straight lines across invalid samples, and velocities."""
    return move.path, np.asarray(np.gradient(move.path, period), np.float64)
