"""Friction along a demanded trajectory, from the friction state that the stage is in.

Predicted by driving a copy of the handed-over state along the demand, evaluated a little ahead of
it: the drive holds its output for a control tick, half of which is a delay.
"""

from __future__ import annotations

import numpy as np

from estimation.friction.follow import follow_positions
from estimation.friction.law import F64
from estimation.friction.model import FrictionState, kernel_figures, make_constants
from estimation.trajectory import Trajectory
from estimation.trajectory_samples import sample_pieces
from stagedata import FrictionFigures
from stagedata.compiled import kernel

_STEPS = 5  # of the friction model per sample


def friction_feedforward(
    friction: FrictionFigures,
    state: FrictionState,
    trajectory: Trajectory,
    samples: int,
    period: float,
    ahead: float,
    sent: int = 0,
) -> F64:
    """Friction force along a demand, or the rest of one, relative to where it begins.

    Args:
        friction: the model.
        state: friction state where it begins, at rest or in the middle of the motion; not changed.
        trajectory: of the demand; sample k is at time k period, k = 1..samples.
        samples: how many there are in all, K.
        period: of the samples [s].
        ahead: how much earlier the force is wanted [s].
        sent: samples k = 1..sent are gone.

    Returns:
        Friction force at samples sent + 1..K minus that at `sent`, or minus the state's sum at rest
        [N], shape (K - sent,): added to the offset in force there, so that the offset has no jump.
    """
    follower, force = state.copy(), np.empty(samples - sent)
    follow_demand(
        make_constants(friction), kernel_figures(friction, period / _STEPS), friction.viscous,
        follower.forces, follower.slipping, follower.memory, state.total,
        trajectory.pieces, sent * period, ahead, force,
    )  # fmt: skip
    return force


@kernel()
def follow_demand(  # type: ignore[no-untyped-def]
    law, figures, viscous, forces, slipping, memory, held, trajectory, sent, ahead, force
):
    """Friction along a demand (11 arguments: law, state and trajectory, as arrays).

    Args:
        law: its constants.
        figures: at which it is evaluated; their period is that of the steps.
        viscous: sigma_v [N s/m].
        forces: internal forces [N], shape (n,); advanced.
        slipping: which of them slide, shape (n,); advanced.
        memory: direction of motion, and position up to which it was taken [m]; advanced.
        held: sum of the internal forces [N].
        trajectory: of the demand, as of `trajectory_samples.sample_pieces`.
        sent: time of the sample from which on the force is wanted [s]; 0: the axis rests there.
        ahead: how much earlier the force is wanted [s].
        force: written: change since then [N], shape (K,).
    """
    steps = force.shape[0] * _STEPS
    time, position, velocity = np.empty(steps + 1), np.empty(steps + 1), np.empty(steps + 1)
    for k in range(steps + 1):
        time[k] = sent + k * figures.period + ahead
    followed, jacobian = np.empty(steps), np.empty((steps, 3))
    sample_pieces(trajectory, time, position, velocity, np.empty(steps + 1))
    memory[1], first = trajectory[1][0], held
    if sent > 0.0:
        memory[1], first = position[0], held + viscous * velocity[0]
    follow_positions(
        law, figures, np.array([figures.coulomb]), forces, slipping, memory,
        position[1:], velocity[1:], 1, 0.0, followed, jacobian,
    )  # fmt: skip
    for k in range(force.shape[0]):
        last = (k + 1) * _STEPS
        force[k] = followed[last - 1] + viscous * velocity[last] - first
