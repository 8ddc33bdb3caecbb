"""The plant in few steps per control tick, compiled: for many simulations of one recording.

The reference integrates in steps of Tc/5 (semi-implicit Euler), which is more than the mechanics
ask for: only the current loop is that fast, and its answer to a constant input has a closed form.
A coarse step of length h stands for n fine ones. What the motor does within it enters by the sums
that the fine steps would make (`motor_weights`); friction and the other forces, which change
little, enter as a straight line from the step's start to its end:

    x1 - x0 = h (v0 + h/m (F_x - R0 (n + 1)/(2n))),   v1 - v0 = h/m (F_v - R0 - c (R1 - R0))

with c = (n - 1)/(2n). Springs of what swings take the whole kick at once: that keeps their energy.
"""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

from hil_sim.disturbances import (
    coulomb_factor,
    delayed_pair,
    drag,
    drive,
    over_velocity,
    swing,
)
from hil_sim.friction import slip_step, stribeck

F64 = NDArray[np.float64]


def fine_steps(substeps: int, reference: int) -> int:
    """Fine steps that one coarse step stands for."""
    return max(1, round(reference / substeps))


def motor_weights(decay: float, share: F64) -> F64:
    """How the motor force acts in one coarse step, as weights of what it depends on.

    Args:
        decay: 2 pi bandwidth times the fine step.
        share: weight of the output before its step in each fine step, float64[n].

    Returns:
        float64[3, 2]: rows for the force at the end, its mean for the velocity and its mean for
        the displacement; columns for the earlier output and the force at the start. What is
        missing to 1 (displacement: to (n + 1)/(2n)) is the weight of the present output.
    """
    count = len(share)
    gain = 1.0 - math.exp(-decay)
    end = np.array([0.0, 1.0])
    velocity, displacement = np.zeros(2), np.zeros(2)
    for i, before in enumerate(share):
        end = end + gain * (np.array([before, 0.0]) - end)
        velocity += end / count
        displacement += end * (count - i) / count**2
    return np.array([end, velocity, displacement])


@numba.njit(cache=True)
def coarse_kick(plant, state, loop, arena, a, substep, dt):  # type: ignore[no-untyped-def]
    """Forces at the step's start: sets `kick`, `lead` and what `drive` sets."""
    p = plant[a]
    s = state[a]
    start = s.motor_force
    if p.ported:
        old, new = delayed_pair(s)
    else:
        new = loop[a].output
        old = new
    at = p.motor_weights + 6 * substep
    share = p.coarse_share  # (n + 1)/(2n)
    w = arena
    mean = w[at + 2] * old + w[at + 3] * start + (1.0 - w[at + 2] - w[at + 3]) * new
    early = w[at + 4] * old + w[at + 5] * start + (share - w[at + 4] - w[at + 5]) * new
    s.motor_force = w[at] * old + w[at + 1] * start + (1.0 - w[at] - w[at + 1]) * new
    resistance = s.friction + p.viscous * s.velocity
    ahead = (early - share * mean) / p.mass
    if p.ported:
        s.kick = dt * drive(p, s, arena, substep * dt, mean, resistance)
        ahead *= s.response
    else:
        s.springs = 0.0
        s.kick = dt * (mean - resistance) / p.mass
    s.lead = dt * ahead


@numba.njit(cache=True)
def coarse_move(p, s, forces, slipping, shares, arena, dt):  # type: ignore[no-untyped-def]
    """Displacement, friction at its end, and the velocity with both."""
    before = s.velocity
    share = p.coarse_share
    dx = dt * (before + share * s.kick + (1.0 - share) * dt * s.springs + s.lead)
    s.position += dx
    change = p.viscous * s.kick
    level = p.coulomb
    if p.ported:
        change += drag(p, arena, dx) + s.pull_slope * dx + s.push_rate * dt
        if p.velocity_force >= 0:
            change += over_velocity(arena, p, before + s.kick) - over_velocity(arena, p, before)
        level *= coulomb_factor(p, s, dx)
    if dx != 0.0:
        direction = math.copysign(1.0, dx)
        if direction != s.direction:
            s.direction = direction
            for i in range(p.elements):
                slipping[i] = False
        curve = stribeck(dx / dt, p.static_ratio, p.stribeck_velocity, p.stribeck_shape)
        friction = slip_step(
            forces,
            slipping,
            shares,
            p.elements,
            direction,
            dx,
            p.element_stiffness,
            level * curve * (1.0 + s.wander),
            math.exp(-p.relaxation_rate * dt / curve),
        )
        change += friction - s.friction
        s.friction = friction
    change *= 1.0 - share
    s.velocity = before + s.kick - dt * p.mobility * change
    if p.ported:
        s.net -= change
        swing(p, s, arena, dt)
