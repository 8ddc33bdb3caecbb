"""The stage's mechanics with its drive loops, all axes jointly, compiled.

One kernel simulates every stage. What the plain model does not have enters through ports
(`hil_sim.plant.ports.disturbances`); an axis without ports takes the plain path, bit for bit.

A control tick at time t (docs/reference/reference-stage.md): the encoder reading taken at t feeds
the position loop, whose output drives current loop and plant until t + Tc, when the encoder is read
again. The plant is integrated in steps of Tc/5, semi-implicit Euler.

Not modelled: power electronics, commutation. Cables, the machine's base and much else are effects
(`hil_sim.effects`).
"""

from __future__ import annotations

import math

from hil_sim.plant.coarse import advance_coarsely
from hil_sim.plant.control import run_loop
from hil_sim.plant.encoder import end_tick
from hil_sim.plant.friction.coulomb import hold
from hil_sim.plant.friction.gms import Slip, slide
from hil_sim.plant.friction.laws import COULOMB, GMS
from hil_sim.plant.friction.stribeck import stribeck
from hil_sim.plant.ports.disturbances import (
    coulomb_factor,
    delayed,
    drag,
    drive,
    refresh,
    solve_jointly,
    swing,
)
from hil_sim.settings import SUBSTEPS
from stagedata.compiled import kernel


@kernel()
def command(loop, position, force, ticks):  # type: ignore[no-untyped-def]
    """Ramp demand and force offset of one axis linearly to this pair [m, N] within `ticks`.

    `loop` is its record of `CONTROL_STATE_DTYPE`.
    """
    loop.from_position = loop.demand
    loop.from_force = loop.offset
    loop.to_position = position
    loop.to_force = force
    loop.ramp_ticks = ticks
    loop.ramp_done = 0


@kernel()
def _kick(p, s, arena, substep, dt):  # type: ignore[no-untyped-def]
    """Set `kick`, the change of velocity [m/s] of an axis with ports in this substep of `dt` [s].

    Coupling with the other axis is not included: `solve_jointly`.
    """
    s.motor_force += p.current_gain * (delayed(p, s, arena, substep) - s.motor_force)
    resistance = s.friction + p.viscous * s.velocity
    s.kick = dt * drive(p, s, arena, substep * dt, s.motor_force, resistance)


@kernel()
def _advance_finely(m, normals, first, ticks):  # type: ignore[no-untyped-def]
    """Advance every axis, in one long function: passing arrays on costs more than a substep."""
    plant, control, state, loop = m.plant, m.control, m.state, m.loop
    forces, slipping, shares, arena = m.forces, m.slipping, m.shares, m.arena
    period, substeps = m.period, m.substeps
    axes = plant.shape[0]
    dt = period / substeps
    coupled = plant[0].coupled
    for tick in range(first, first + ticks):
        for a in range(axes):
            s, own = state[a], loop[a]
            run_loop(control[a], own, s, period)
            if plant[a].ported:
                refresh(plant[a], s, state[axes - 1 - a].position, arena, own.output, period)
        for substep in range(substeps):
            if coupled:
                for a in range(axes):
                    _kick(plant[a], state[a], arena, substep, dt)
                solve_jointly(plant, state, arena, dt)
            for a in range(axes):
                p, s = plant[a], state[a]
                if p.ported:
                    if not coupled:
                        _kick(p, s, arena, substep, dt)
                    v = s.velocity + s.kick
                else:
                    s.motor_force += p.current_gain * (loop[a].output - s.motor_force)
                    net = s.motor_force - s.friction - p.viscous * s.velocity
                    v = s.velocity + dt / p.mass * net
                if p.law == COULOMB:
                    v = hold(p, s, v, dt)
                dx = v * dt
                s.velocity = v
                s.position += dx
                level = p.coulomb
                if p.ported:
                    swing(p, s, arena, dt)
                    drag(p, arena, dx)
                    level *= coulomb_factor(p, s, v)
                if p.law == GMS and v != 0.0:
                    curve = stribeck(v, p.static_ratio, p.stribeck_velocity, p.stribeck_shape)
                    decay = math.exp(-p.relaxation_rate * dt / curve)
                    level = level * curve * (1.0 + s.wander)
                    slip = Slip(math.copysign(1.0, v), dx, level, decay)
                    slide(p, s, forces, slipping, shares, slip)
        for a in range(axes):
            end_tick(plant[a], state[a], normals, a, tick, period)


@kernel(inline="always")
def advance(m, normals, first, ticks):  # type: ignore[no-untyped-def]
    """Advance every axis, by fine steps or coarse ones.

    Args:
        m: `Mechanics`, whose states are changed in place.
        normals: standard normals for encoder and wander, float64[axes, 2, n]; n = 0: no noise.
        first: index in `normals` of the first tick.
        ticks: control ticks to advance.
    """
    if m.substeps < SUBSTEPS:
        advance_coarsely(m, normals, first, ticks)
    else:
        _advance_finely(m, normals, first, ticks)


@kernel()
def step(m, normals, first, ticks, orders, report):  # type: ignore[no-untyped-def]
    """Execute commands, advance and report: one call for `Plant`.

    Arguments up to `ticks`: as those of `advance`. `orders`, float64[axes, 5]: 1 to command,
    position [m], force offset [N], ticks; 1 to restart the worst following error. Executed flags
    are set to 0. `report`, float64[axes, 5], written: encoder counts, motor force [N], demand [m],
    encoder velocity [m/s], worst following error [m].
    """
    plant, state, loop = m.plant, m.state, m.loop
    for a in range(plant.shape[0]):
        if orders[a, 0] != 0.0:
            command(loop[a], orders[a, 1], orders[a, 2], int(orders[a, 3]))
            orders[a, 0] = 0.0
        if orders[a, 4] != 0.0:
            state[a].worst_error = 0.0
            orders[a, 4] = 0.0
    advance(m, normals, first, ticks)
    for a in range(plant.shape[0]):
        report[a, 0] = round(state[a].encoder / plant[a].increment)
        report[a, 1] = state[a].motor_force
        report[a, 2] = loop[a].demand
        report[a, 3] = state[a].speed
        report[a, 4] = state[a].worst_error


@kernel(nogil=True)
def run_demands(m, normals, unit, setpoints, response):  # type: ignore[no-untyped-def]
    """Run whole demands.

    Args:
        m: as in `advance`.
        normals: likewise.
        unit: rounding of the reported force, float64[axes] [N]; 0: none.
        setpoints: at each SYNC, demand [m] and force offset [N], float64[K, axes] each.
        response: written, position [m] and force [N], float64[K, axes] each.
    """
    state, loop = m.state, m.loop
    demand, offset = setpoints
    position, measured = response
    for k in range(demand.shape[0]):
        for a in range(m.plant.shape[0]):
            position[k, a] = state[a].encoder
            force = state[a].motor_force
            measured[k, a] = round(force / unit[a]) * unit[a] if unit[a] > 0.0 else force
            command(loop[a], demand[k, a], offset[k, a], m.ticks)
        advance(m, normals, k * m.ticks, m.ticks)
