"""The stage's mechanics with its drive loops, all axes jointly, compiled.

One kernel simulates every stage. What the plain model does not have enters through ports
(`hil_sim.plant.ports.disturbances`); an axis without ports takes the plain path, bit for bit.

A control tick at time t (docs/reference-stage.md): the encoder reading taken at t feeds the
position loop, whose output drives current loop and plant until t + Tc, when the encoder is read
again. The plant is integrated in steps of Tc/5, semi-implicit Euler.

Not modelled: power electronics, commutation. Cables, the machine's base and much else are effects
(`hil_sim.effects`).
"""

from __future__ import annotations

import math

from hil_sim.plant.coarse import advance_coarsely
from hil_sim.plant.control import advance_demand, position_loop
from hil_sim.plant.encoder import read_encoder
from hil_sim.plant.friction.coulomb import hold
from hil_sim.plant.friction.gms import slip_step
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
def step(  # type: ignore[no-untyped-def]
    plant, control, state, loop, forces, slipping, shares, arena, period, normals, first, ticks,
    orders, report,
):  # fmt: skip
    """Execute commands, advance and report (14 arguments: one call for `Plant`).

    Arguments up to `ticks`: as those of `advance`. `orders`, float64[axes, 5]: 1 to command,
    position [m], force offset [N], ticks; 1 to restart the worst following error. Executed flags
    are set to 0. `report`, float64[axes, 5], written: encoder counts, motor force [N], demand [m],
    encoder velocity [m/s], worst following error [m].
    """
    for a in range(plant.shape[0]):
        if orders[a, 0] != 0.0:
            command(loop[a], orders[a, 1], orders[a, 2], int(orders[a, 3]))
            orders[a, 0] = 0.0
        if orders[a, 4] != 0.0:
            state[a].worst_error = 0.0
            orders[a, 4] = 0.0
    advance(
        plant, control, state, loop, forces, slipping, shares, arena, period, SUBSTEPS, normals,
        first, ticks,
    )  # fmt: skip
    for a in range(plant.shape[0]):
        report[a, 0] = round(state[a].encoder / plant[a].increment)
        report[a, 1] = state[a].motor_force
        report[a, 2] = loop[a].demand
        report[a, 3] = state[a].speed
        report[a, 4] = state[a].worst_error


@kernel()
def _kick(p, s, arena, substep, dt):  # type: ignore[no-untyped-def]
    """Set `kick`, the change of velocity [m/s] of an axis with ports in this substep of `dt` [s].

    Coupling with the other axis is not included: `solve_jointly`.
    """
    s.motor_force += p.current_gain * (delayed(p, s, arena, substep) - s.motor_force)
    resistance = s.friction + p.viscous * s.velocity
    s.kick = dt * drive(p, s, arena, substep * dt, s.motor_force, resistance)


@kernel()
def advance(  # type: ignore[no-untyped-def]
    plant, control, state, loop, forces, slipping, shares, arena, period, substeps, normals, first,
    ticks,
):  # fmt: skip
    """Advance every axis, in one long function: passing arrays on costs more than a substep.

    Args:
        plant: records of the axes, [axes]; read only.
        control: records of their loops, [axes]; read only.
        state: states of the axes, [axes]; changed in place.
        loop: states of their loops, [axes].
        forces: friction elements of all axes, float64[elements] [N].
        slipping: whether each slips, bool[elements].
        shares: nu of each, float64[elements].
        arena: tables and extra states of all axes, float64[n] (`port_arrays`).
        period: control tick Tc [s].
        substeps: plant steps per tick; fewer than 5: one coarse step.
        normals: standard normals for encoder and wander, float64[axes, 2, n]; n = 0: no noise.
        first: index in `normals` of the first tick.
        ticks: control ticks to advance.
    """
    if substeps < SUBSTEPS:
        advance_coarsely(
            plant, control, state, loop, forces, slipping, shares, arena, period, normals, first,
            ticks,
        )  # fmt: skip
        return
    axes = plant.shape[0]
    dt = period / substeps
    noisy = normals.shape[2] > 0
    coupled = plant[0].coupled
    for tick in range(first, first + ticks):
        for a in range(axes):
            advance_demand(loop[a])
            if loop[a].powered:
                error = position_loop(control[a], loop[a], state[a].encoder, period)
                state[a].worst_error = max(state[a].worst_error, abs(error))
        for a in range(axes):
            if plant[a].ported:
                refresh(
                    plant[a], state[a], state[axes - 1 - a].position, arena, loop[a].output, period
                )
        for substep in range(substeps):
            if coupled:
                for a in range(axes):
                    _kick(plant[a], state[a], arena, substep, dt)
                solve_jointly(plant, state, arena, dt)
            for a in range(axes):
                p = plant[a]
                s = state[a]
                if p.ported:
                    if not coupled:
                        _kick(p, s, arena, substep, dt)
                    v = s.velocity + s.kick
                else:
                    s.motor_force += p.current_gain * (loop[a].output - s.motor_force)
                    v = s.velocity + dt / p.mass * (
                        s.motor_force - s.friction - p.viscous * s.velocity
                    )
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
                    direction = math.copysign(1.0, v)
                    if direction != s.direction:
                        s.direction = direction
                        for i in range(p.first_element, p.first_element + p.elements):
                            slipping[i] = False
                    curve = stribeck(v, p.static_ratio, p.stribeck_velocity, p.stribeck_shape)
                    s.friction = slip_step(
                        forces,
                        slipping,
                        shares,
                        p.elements,
                        direction,
                        dx,
                        p.element_stiffness,
                        level * curve * (1.0 + s.wander),
                        math.exp(-p.relaxation_rate * dt / curve),
                        p.first_element,
                    )
        for a in range(axes):
            p = plant[a]
            s = state[a]
            if noisy:
                s.wander = p.wander_keep * s.wander + p.wander * normals[a, 1, tick]
                read_encoder(p, s, period, normals[a, 0, tick])
            else:
                s.wander = p.wander_keep * s.wander
                read_encoder(p, s, period, 0.0)


@kernel(nogil=True)
def run_demands(  # type: ignore[no-untyped-def]
    plant, control, state, loop, forces, slipping, shares, arena, period, substeps, ticks, normals,
    demand, offset, unit, position_out, force_out,
):  # fmt: skip
    """Run whole demands: many arguments, as `advance` has.

    Arguments up to `normals`: as those of `advance`, `ticks` per SYNC. Row k of the others is SYNC
    k: `demand` [m] and `offset` [N], float64[K, axes]; `position_out` [m] and `force_out` [N],
    written, float64[K, axes]. `unit`, float64[axes] [N]: rounding of the reported force, 0: none.
    """
    axes = plant.shape[0]
    for k in range(demand.shape[0]):
        for a in range(axes):
            position_out[k, a] = state[a].encoder
            force = state[a].motor_force
            force_out[k, a] = round(force / unit[a]) * unit[a] if unit[a] > 0.0 else force
            command(loop[a], demand[k, a], offset[k, a], ticks)
        advance(
            plant, control, state, loop, forces, slipping, shares, arena, period, substeps, normals,
            k * ticks, ticks,
        )  # fmt: skip
