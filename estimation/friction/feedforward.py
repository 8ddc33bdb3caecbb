"""Friction along a demanded trajectory, from the friction state that the stage is in.

Predicted by driving a copy of the handed-over state along the demand, evaluated a little ahead of
it: the drive holds its output for a control tick, half of which is a delay.

When a force acts: docs/reference/reference-stage.md, timing.
"""

from __future__ import annotations

import numpy as np

from estimation.friction.follow import follow
from estimation.friction.model import FrictionState
from estimation.trajectory import Trajectory
from stagedata import F64, FrictionFigures

_STEPS = 5  # of the friction model per sample


def friction_feedforward(
    friction: FrictionFigures,
    state: FrictionState,
    trajectory: Trajectory,
    samples: int,
    period: float,
    ahead: float,
    sent: int = 0,
    variation: F64 | None = None,
) -> F64:
    """Friction force along a demand, or the rest of one, relative to where it begins.

    Args:
        friction: the model.
        state: friction state where it begins, at rest or in the middle of the motion, its forces as
            they are there; not changed.
        trajectory: of the demand; sample k is at time k period, k = 1..samples.
        samples: how many there are in all, K.
        period: of the samples [s].
        ahead: how much earlier the force is wanted [s].
        sent: samples k = 1..sent are gone.
        variation: Coulomb force at each sample relative to the model's, minus 1, shape (K,).

    Returns:
        Friction force at samples sent + 1..K minus that at `sent`, or minus the state's sum at rest
        [N], shape (K - sent,): added to the offset in force there, so that the offset has no jump.
    """
    step = period / _STEPS
    rows = np.arange((samples - sent) * _STEPS + 1, dtype=np.float64)
    time = sent * period + rows * step
    there = None
    if variation is not None:
        there = np.interp(time[1:], np.arange(1, samples + 1) * period, variation)
    position, velocity, _ = trajectory.sample(time + ahead)
    follower, before = state.copy(), state.total
    follower.settle_at(float(position[0] if sent else trajectory.position[0]))
    if sent:
        before += friction.viscous * float(velocity[0])
    force, _ = follow(friction, follower, position[1:], velocity[1:], step, 1, 0.0, there)
    change: F64 = force + friction.viscous * velocity[1:] - before
    return change[_STEPS - 1 :: _STEPS]
