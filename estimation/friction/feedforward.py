"""Friction along a demanded trajectory, from the friction state that the stage is in.

Predicted by driving a copy of the handed-over state along the demand, evaluated a little ahead of
it: the drive holds its output for a control tick, half of which is a delay.
"""

from __future__ import annotations

import numpy as np

from estimation.friction.follow import follow
from estimation.friction.law import F64
from estimation.friction.model import FrictionState
from estimation.trajectory import Trajectory
from stagedata import FrictionFigures

_STEPS = 5  # of the friction model per sample


def friction_feedforward(
    friction: FrictionFigures,
    state: FrictionState,
    trajectory: Trajectory,
    samples: int,
    period: float,
    ahead: float,
) -> F64:
    """Friction force along the demand, relative to the force at rest before it.

    Args:
        friction: the model.
        state: friction state at rest at the start of the trajectory; not changed.
        trajectory: of the demand; sample k is at time k period, k = 1..samples.
        samples: how many, K.
        period: of the samples [s].
        ahead: how much earlier the force is wanted [s].

    Returns:
        Friction force minus the state's sum [N], shape (K,): added to the offset in force at rest,
        so that the offset has no jump.
    """
    follower = state.copy()
    time = np.asarray(np.arange(1, samples * _STEPS + 1) * (period / _STEPS) + ahead, np.float64)
    position, velocity, _ = trajectory.sample(time)
    follower.settle_at(float(trajectory.position[0]))
    force, _ = follow(friction, follower, position, velocity, period / _STEPS, substeps=1, band=0.0)
    at = np.arange(_STEPS - 1, samples * _STEPS, _STEPS)
    total: F64 = force[at] + friction.viscous * velocity[at] - state.total
    return total


def remaining_feedforward(
    friction: FrictionFigures,
    state: FrictionState,
    trajectory: Trajectory,
    sent: int,
    samples: int,
    period: float,
    ahead: float,
) -> F64:
    """Friction force along the rest of a demand, relative to the last sample sent.

    Args:
        friction: the model as it is believed now.
        state: friction state now, in the middle of the motion; not changed.
        trajectory: of the demand; sample k is at time k period.
        sent: samples k = 1..sent are gone.
        samples: how many there are in all, K.
        period: of the samples [s].
        ahead: how much earlier the force is wanted [s].

    Returns:
        Friction force at samples sent + 1..K minus that at `sent` [N], shape (K - sent,).
    """
    follower = state.copy()
    steps = (samples - sent) * _STEPS
    time = np.asarray(
        sent * period + np.arange(steps + 1) * (period / _STEPS) + ahead, dtype=np.float64
    )
    position, velocity, _ = trajectory.sample(time)
    follower.settle_at(float(position[0]))
    first = follower.total + friction.viscous * velocity[0]
    force, _ = follow(
        friction, follower, position[1:], velocity[1:], period / _STEPS, substeps=1, band=0.0
    )
    change: F64 = force + friction.viscous * velocity[1:] - first
    return change[_STEPS - 1 :: _STEPS]
