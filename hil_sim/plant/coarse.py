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

from hil_sim.plant.control import run_loop
from hil_sim.plant.encoder import end_tick
from hil_sim.plant.friction.gms import Slip, slide
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


@kernel(inline="always")
def _kick(p, s, arena, new, old, dt):  # type: ignore[no-untyped-def]
    """Set `kick` and `lead` of an axis in this step, and its motor force at the end.

    Coupling with the other axis is not included: `solve_jointly`.

    Args:
        p: record of the axis.
        s: state of the axis.
        arena: of all axes, float64[n].
        new: input of the current loop in this step [N].
        old: its input before it changes [N].
        dt: of the step [s].
    """
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


@kernel(inline="always")
def _move(p, s, arena, forces, slipping, shares, dt):  # type: ignore[no-untyped-def]
    """Move an axis by one step of `dt` [s], and let its forces follow.

    Arguments: records of the axis, arrays of all axes.
    """
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
        curve = 1.0
        if abs(speed) < p.stribeck_end:
            curve = stribeck(speed, p.static_ratio, p.stribeck_velocity, p.stribeck_shape)
        decay = _decay(p.relaxation_rate * dt / curve)
        level = level * curve * (1.0 + s.wander)
        held = s.friction
        slide(p, s, forces, slipping, shares, Slip(math.copysign(1.0, dx), dx, level, decay))
        change += s.friction - held
    change *= 1.0 - share
    s.velocity = after - dt * p.mobility * change
    if p.ported:
        s.net -= change
        swing(p, s, arena, dt)


@kernel()
def advance_coarsely(m, normals, first, ticks):  # type: ignore[no-untyped-def]
    """Advance every axis by one step in each of the `ticks` control ticks.

    What it calls with arrays is inlined: passing them on costs more than the step itself. (numba
    counts their references at every call.) Arguments: as those of `mechanics.advance`.
    """
    plant, control, state, loop = m.plant, m.control, m.state, m.loop
    forces, slipping, shares, arena = m.forces, m.slipping, m.shares, m.arena
    period = m.period
    axes = plant.shape[0]
    coupled = plant[0].coupled
    for tick in range(first, first + ticks):
        for a in range(axes):
            s, own = state[a], loop[a]
            run_loop(control[a], own, s, period)
            new = old = own.output
            if plant[a].ported:
                refresh(plant[a], s, state[axes - 1 - a].position, arena, new, period)
                new, old = s.late, s.later
            _kick(plant[a], s, arena, new, old, period)
        if coupled:
            solve_jointly(plant, state, arena, period)
        for a in range(axes):
            p, s = plant[a], state[a]
            _move(p, s, arena, forces, slipping, shares, period)
            end_tick(p, s, normals, a, tick, period)
