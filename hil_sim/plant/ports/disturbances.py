"""Forces and factors that the ports of an axis add to its plant, compiled.

Per control tick `refresh` linearises tables and everything that depends on time about the middle of
the tick. Per substep `drive` gives the force on the carriage; `swing` and `drag` advance
oscillators and hysteretic elements. Layout of records and arena: `hil_sim.plant.ports.port_arrays`.
"""

from __future__ import annotations

import math

from stagedata.compiled import kernel


@kernel()
def _table(p, arena, offset, x):  # type: ignore[no-untyped-def]
    """Value and slope at x by cubic interpolation (Catmull-Rom); held at the ends.

    The axis' tables have `table_count` nodes from `table_low` on, 1/`table_inverse` apart, and one
    more entry at each end; this one begins at `offset`.
    """
    u = (x - p.table_low) * p.table_inverse
    if u >= p.table_count - 1.0:
        return arena[offset + p.table_count], 0.0
    if not u > 0.0:  # NaN included
        return arena[offset + 1], 0.0
    cell = int(u)
    t = u - cell
    p0 = arena[offset + cell]
    p1 = arena[offset + cell + 1]
    p2 = arena[offset + cell + 2]
    p3 = arena[offset + cell + 3]
    a = 0.5 * (p3 - p0) + 1.5 * (p1 - p2)
    b = p0 - 2.5 * p1 + 2.0 * p2 - 0.5 * p3
    c = 0.5 * (p2 - p0)
    slope = ((3.0 * a * t + 2.0 * b) * t + c) * p.table_inverse
    return ((a * t + b) * t + c) * t + p1, slope


@kernel()
def _dense(arena, offset, half, scale, x):  # type: ignore[no-untyped-def]
    """Value and slope at x, linear between nodes at ± (i / scale)^2; held at the ends."""
    u = math.sqrt(abs(x)) * scale
    if not u < half:
        return arena[offset + (2 * half if x > 0.0 else 0)], 0.0
    cell = int(u)
    low = (cell / scale) ** 2
    high = ((cell + 1) / scale) ** 2
    side = 1 if x > 0.0 else -1
    first = arena[offset + half + side * cell]
    change = (arena[offset + half + side * (cell + 1)] - first) / (high - low)
    return first + change * (abs(x) - low), change * side


@kernel()
def _over_time(arena, offset, inverse, count, t):  # type: ignore[no-untyped-def]
    """Value and rate at t [s] by linear interpolation; held at the ends."""
    u = t * inverse
    if u >= count - 1.0:
        return arena[offset + count - 1], 0.0
    if not u > 0.0:
        return arena[offset], 0.0
    cell = int(u)
    first = arena[offset + cell]
    change = arena[offset + cell + 1] - first
    return first + change * (u - cell), change * inverse


@kernel()
def _field(arena, offset, x, y):  # type: ignore[no-untyped-def]
    """Factor at (x, y) [m], bilinear, held at the edges; and the offset of the next field."""
    rows = int(arena[offset])
    columns = int(arena[offset + 3])
    u = (x - arena[offset + 1]) * arena[offset + 2]
    u = min(u, rows - 1.0) if u > 0.0 else 0.0
    w = (y - arena[offset + 4]) * arena[offset + 5]
    w = min(w, columns - 1.0) if w > 0.0 else 0.0
    i = min(int(u), rows - 2)
    j = min(int(w), columns - 2)
    at = offset + 6 + i * columns + j
    u -= i
    w -= j
    value = (1.0 - u) * ((1.0 - w) * arena[at] + w * arena[at + 1]) + u * (
        (1.0 - w) * arena[at + columns] + w * arena[at + columns + 1]
    )
    return value, offset + 6 + rows * columns


@kernel(inline="always")
def _level(p, s, across, arena, t):  # type: ignore[no-untyped-def]
    """Set the factor on Fc at `s.place` and t, and its slope."""
    coulomb = 1.0
    slope = 0.0
    if p.position_coulomb >= 0:
        coulomb, slope = _table(p, arena, p.position_coulomb, s.place)
    factor = 1.0
    for i in range(p.decays_count):
        at = p.decays + 2 * i
        factor *= 1.0 + arena[at] * math.exp(-t * arena[at + 1])
    if p.time_coulomb >= 0:
        value, _ = _over_time(arena, p.time_coulomb, p.time_inverse, p.time_count, t)
        factor *= value
    if p.fields_count > 0:
        offset = p.fields
        for _ in range(p.fields_count):
            value, offset = _field(arena, offset, s.place, across)
            factor *= value
    s.coulomb = coulomb * factor
    s.coulomb_slope = slope * factor


@kernel(inline="always")
def _push(p, s, arena, t, half):  # type: ignore[no-untyped-def]
    """Set the force over time at t, linear about the middle of the tick, and its rate."""
    push = 0.0
    rate = 0.0
    for i in range(p.harmonics_count):
        at = p.harmonics + 3 * i
        angle = arena[at + 1] * (t + half) + arena[at + 2]
        push += arena[at] * math.sin(angle)
        rate += arena[at] * arena[at + 1] * math.cos(angle)
    if p.time_force >= 0:
        value, slope = _over_time(arena, p.time_force, p.time_inverse, p.time_count, t + half)
        push += value
        rate += slope
    s.push = push - rate * half
    s.push_rate = rate


@kernel()
def lose(p, arena, motor_force, kept):  # type: ignore[no-untyped-def]
    """Motor force that lags behind a measured one [N]; `kept`: the elements follow to there."""
    lost = 0.0
    for i in range(p.lags_count):
        at = p.lags + 4 * i
        moved = (motor_force - arena[at + 3]) * arena[at]
        share = min(max(arena[at + 2] + moved, -1.0), 1.0)
        lost += arena[at + 1] * share
        if kept:
            arena[at + 2] = share
            arena[at + 3] = motor_force
    return lost


@kernel()
def refresh(p, s, across, arena, output, period):  # type: ignore[no-untyped-def]
    """Prepare a control tick, in one long function: passing the arena on costs more than the work.

    Args:
        p: record of the axis.
        s: state of the axis.
        across: position of the other axis [m].
        arena: of all axes, float64[n].
        output: of the controller in this tick [N].
        period: Tc [s].
    """
    if p.history >= 0:
        depth = p.history_depth
        s.ring = (s.ring + 1) % depth
        arena[p.history + s.ring] = output
        s.late = arena[p.history + (s.ring - p.delay_ticks + depth) % depth]
        s.later = arena[p.history + (s.ring - p.delay_ticks - 1 + depth) % depth]
    else:
        s.late = output
        s.later = output
    middle = s.position + 0.5 * period * s.velocity
    s.place = middle
    t = s.clock * period
    s.clock += 1
    half = 0.5 * period
    _level(p, s, across, arena, t + half)
    if p.position_gain >= 0:
        s.gain, s.gain_slope = _table(p, arena, p.position_gain, middle)
    if p.lags_count > 0:
        s.lost = lose(p, arena, s.motor_force, True)
    if p.misreading >= 0:
        s.misread, s.misread_slope = _table(p, arena, p.misreading, middle)
    s.pull = p.force + p.spring * middle
    s.pull_slope = p.spring
    if p.position_force >= 0:
        value, slope = _table(p, arena, p.position_force, middle)
        s.pull += value
        s.pull_slope += slope
    _push(p, s, arena, t, half)


@kernel()
def delayed(p, s, arena, substep):  # type: ignore[no-untyped-def]
    """Input of the current loop in this substep [N], after the dead time."""
    if p.history < 0:
        return s.late
    share = arena[p.delay_share + substep]
    return share * s.later + (1.0 - share) * s.late


@kernel()
def coulomb_factor(p, s, direction):  # type: ignore[no-untyped-def]
    """Factor on Fc at the present position, time, direction and load."""
    value = s.coulomb + s.coulomb_slope * (s.position - s.place)
    value = max(value, 0.0) * (p.coulomb_forward if direction > 0.0 else p.coulomb_backward)
    return value + p.load_friction * abs(s.transmitted)


@kernel()
def drive(p, s, arena, since, motor_force, resistance):  # type: ignore[no-untyped-def]
    """Acceleration of the carriage relative to the base [m/s^2], without coupling.

    Sets `net`, `transmitted`, `sprung`, `response` and `rise`.

    Args:
        p: record of the axis.
        s: state of the axis.
        arena: of all axes, float64[n].
        since: time since the tick's start [s].
        motor_force: as measured [N].
        resistance: friction [N].
    """
    away = s.position - s.place
    force = motor_force - s.lost
    response = 1.0
    s.rise = 0.0
    if p.position_gain >= 0 or p.saturation > 0.0 or p.gain != 1.0 or p.motor_loss >= 0:
        if p.motor_loss >= 0:
            loss, slope = _dense(arena, p.motor_loss, p.velocity_nodes, p.motor_scale, motor_force)
            force -= loss
            response -= slope
        force *= p.gain
        response *= p.gain
        if p.saturation > 0.0:
            bent = math.tanh(force / p.saturation)
            force = p.saturation * bent
            response *= 1.0 - bent * bent
        if p.position_gain >= 0:
            gain = s.gain + s.gain_slope * away
            s.rise = force * s.gain_slope
            force *= gain
            response *= gain
    s.response = response
    against = s.pull + s.pull_slope * away + s.push + s.push_rate * since
    rubbing = 0.0
    if p.velocity_force >= 0:
        rubbing = over_velocity(arena, p, s.velocity)
        against += rubbing
    for i in range(p.hysteresis_count):
        against += arena[p.hysteresis + 3 * i + 2]
    s.net = force - resistance - against
    s.transmitted = against - rubbing + (1.0 - p.motor_share) * s.net
    sprung = 0.0
    for i in range(p.hanging_count):
        at = p.hanging + 5 * i
        sprung += arena[at] * arena[at + 3] + arena[at + 1] * arena[at + 4]
    s.sprung = sprung
    acceleration = (s.net + sprung) / p.mass
    for i in range(p.bases_count):
        at = p.bases + 5 * i
        acceleration += (arena[at] * arena[at + 3] + arena[at + 1] * arena[at + 4] + s.net) / arena[
            at + 2
        ]
    return acceleration


@kernel()
def over_velocity(arena, p, v):  # type: ignore[no-untyped-def]
    """Force at velocity v [m/s] [N]."""
    return _dense(arena, p.velocity_force, p.velocity_nodes, p.velocity_scale, v)[0]


@kernel()
def reported_force(p, arena, wanted):  # type: ignore[no-untyped-def]
    """The force that is `wanted` [N] after the loss [N], found by bisection between the ends."""
    high = (p.velocity_nodes / p.motor_scale) ** 2
    low = -high
    for _ in range(60):
        middle = 0.5 * (low + high)
        loss, _ = _dense(arena, p.motor_loss, p.velocity_nodes, p.motor_scale, middle)
        if middle - loss < wanted:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


@kernel()
def solve_jointly(plant, state, arena, dt):  # type: ignore[no-untyped-def]
    """Replace the kicks of a step `dt` [s] by those with coupling, and update `net`."""
    count = plant.shape[0]
    at = plant[0].coupling
    first = state[0].kick
    second = state[1].kick
    for a in range(count):
        state[a].kick = arena[at + 2 * a] * first + arena[at + 2 * a + 1] * second
    for a in range(count):
        state[a].net -= arena[at + 4 + 2 * a + 1 - a] * state[1 - a].kick / dt


@kernel()
def swing(p, s, arena, dt):  # type: ignore[no-untyped-def]
    """Advance oscillators on the carriage and bases by `dt` [s], after the kick."""
    if p.hanging_count > 0:
        acceleration = (s.net + s.sprung) / p.mass  # of the carriage, absolute
        for i in range(p.hanging_count):
            at = p.hanging + 5 * i
            pull = arena[at] * arena[at + 3] + arena[at + 1] * arena[at + 4]
            arena[at + 4] -= dt * (pull / arena[at + 2] + acceleration)
            arena[at + 3] += dt * arena[at + 4]
        s.deflection = arena[p.hanging + 3]
    for i in range(p.bases_count):
        at = p.bases + 5 * i
        pull = arena[at] * arena[at + 3] + arena[at + 1] * arena[at + 4]
        arena[at + 4] -= dt * (pull + s.net) / arena[at + 2]
        arena[at + 3] += dt * arena[at + 4]


@kernel()
def drag(p, arena, dx):  # type: ignore[no-untyped-def]
    """Advance the hysteretic elements by a displacement [m]; the change of their force [N]."""
    change = 0.0
    for i in range(p.hysteresis_count):
        at = p.hysteresis + 3 * i
        limit = arena[at + 1]
        force = min(max(arena[at + 2] + arena[at] * dx, -limit), limit)
        change += force - arena[at + 2]
        arena[at + 2] = force
    return change
