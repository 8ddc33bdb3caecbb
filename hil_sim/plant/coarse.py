"""The plant in one step per control tick, compiled: for many simulations of one recording.

The reference integrates in steps of Tc/5 (semi-implicit Euler). Only the current loop needs steps
that short, and its response to a constant input has a closed form. The coarse step of length h = Tc
replaces n = 5 fine ones: the motor force enters by the sums that the fine steps would make
(`ports.current_loop.motor_weights`); friction and the other forces, which change little, enter as a
straight line from the step's start to its end:

    x1 - x0 = h (v0 + h/m (F_x - R0 (n + 1)/(2n))),   v1 - v0 = h/m (F_v - R0 - c (R1 - R0))

with c = (n - 1)/(2n). Springs of oscillators take the whole change of velocity at once, which
conserves their energy.
Friction advances as in `friction/gms.py`; other laws have no coarse step.
"""

from __future__ import annotations

import math

from hil_sim.plant.control import advance_demand, position_loop
from hil_sim.plant.encoder import read_encoder
from hil_sim.plant.friction.gms import Slip, slip_step, turn
from hil_sim.plant.friction.stribeck import stribeck
from hil_sim.plant.ports.disturbances import (
    coulomb_factor,
    drag,
    drive,
    over_velocity,
    refresh,
    solve_jointly,
    swing,
)
from stagedata.compiled import kernel


@kernel()
def _decay(y):  # type: ignore[no-untyped-def]
    """exp(-y) for y >= 0, to 1e-9 for small y."""
    if y > 0.05:
        return math.exp(-y)
    return 1.0 - y * (1.0 - y * (0.5 - y * (1.0 / 6.0 - y / 24.0)))


@kernel()
def advance_coarsely(m, normals, first, ticks):  # type: ignore[no-untyped-def]
    """Advance every axis, in one long function: passing arrays on costs more than the step itself.

    (numba counts their references at every call.) Each of the `ticks` control ticks is one step.
    Arguments: as those of `mechanics.advance`.
    """
    plant, control, state, loop = m.plant, m.control, m.state, m.loop
    forces, slipping, shares, arena = m.forces, m.slipping, m.shares, m.arena
    period = m.period
    axes = plant.shape[0]
    noisy = normals.shape[2] > 0
    coupled = plant[0].coupled
    dt = period
    for tick in range(first, first + ticks):
        for a in range(axes):
            p = plant[a]
            s = state[a]
            own = loop[a]
            advance_demand(own)
            if own.powered:
                error = position_loop(control[a], own, s.encoder, period)
                s.worst_error = max(s.worst_error, abs(error))
            new = own.output
            old = new
            if p.ported:
                refresh(plant[a], state[a], state[axes - 1 - a].position, arena, new, period)
                new = s.late
                old = s.later
            start = s.motor_force
            share = p.coarse_share  # (n + 1)/(2n)
            mean = new + p.mean_old * (old - new) + p.mean_start * (start - new)
            early = share * new + p.early_old * (old - new) + p.early_start * (start - new)
            s.motor_force = new + p.end_old * (old - new) + p.end_start * (start - new)
            resistance = s.friction + p.viscous * s.velocity
            ahead = (early - share * mean) * p.mobility
            s.springs = 0.0
            if p.ported:
                s.kick = dt * drive(p, s, arena, 0.0, mean, resistance)
                ahead *= s.response
            else:
                s.kick = dt * (mean - resistance) * p.mobility
            s.lead = dt * ahead
        if coupled:
            solve_jointly(plant, state, arena, dt)
        for a in range(axes):
            p = plant[a]
            s = state[a]
            share = p.coarse_share
            before = s.velocity
            after = before + s.kick
            speed = before + share * s.kick + (1.0 - share) * dt * s.springs + s.lead
            dx = dt * speed
            s.position += dx
            change = p.viscous * s.kick
            level = p.coulomb
            if p.ported:
                change += drag(p, arena, dx) + (s.pull_slope - s.rise) * dx + s.push_rate * dt
                if p.velocity_force >= 0:
                    change += over_velocity(arena, p, after) - over_velocity(arena, p, before)
                level *= coulomb_factor(p, s, dx)
            if dx != 0.0:
                direction = math.copysign(1.0, dx)
                turn(p, s, slipping, direction)
                curve = 1.0
                if abs(speed) < p.stribeck_end:
                    curve = stribeck(speed, p.static_ratio, p.stribeck_velocity, p.stribeck_shape)
                decay = _decay(p.relaxation_rate * dt / curve)
                slip = Slip(direction, dx, level * curve * (1.0 + s.wander), decay)
                friction = slip_step(
                    forces, slipping, shares, slip, p.element_stiffness, p.elements, p.first_element
                )
                change += friction - s.friction
                s.friction = friction
            change *= 1.0 - share
            s.velocity = after - dt * p.mobility * change
            if p.ported:
                s.net -= change
                swing(p, s, arena, dt)
            if noisy:
                s.wander = p.wander_keep * s.wander + p.wander * normals[a, 1, tick]
                read_encoder(p, s, period, normals[a, 0, tick])
            else:
                s.wander *= p.wander_keep
                read_encoder(p, s, period, 0.0)
