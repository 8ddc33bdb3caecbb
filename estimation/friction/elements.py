"""The elements of a generalized Maxwell-slip model as an array, and their steps, compiled.

One step covers one displacement in one direction at one point of the Stribeck curve:

    stick:  dF_i = k_i sigma0 dx,  until sgn(v) F_i >= nu_i s(v) Fc
    slip:   F_i <- G + (F_i - G) exp(-rate dt/s(v)),  G = sgn(v) nu_i s(v) Fc
    s(v) = 1 + alpha exp(-|v/vs|^delta);  k_i = 1/N;  nu_i = 2i/(N(N+1));  rate = C/Fc

A sticking element stretches with the displacement itself, a slipping one takes the exact
exponential. One that reaches its limit inside a step slips for the rest of it, the limit moving
from where the last step left it: force and derivatives are continuous in every parameter, whatever
step it lands in. Derivatives by the unknowns are carried along, row by row.
"""

from __future__ import annotations

import math

from estimation.compiled import kernel

# Rows: force, and its derivatives by Fc, sigma0, an offset of all sticking elements since the rest
# before the move, the same since the last turn, the same since zone A, C/Fc and alpha; whether the
# element slips; nu_i. The column behind the elements has the sums; behind nu_i it has the Stribeck
# rise at the end of the last step, negative where there was none.
FORCE, BY_COULOMB, BY_STIFFNESS, BY_REST, BY_TURN, BY_SLIP, BY_RATE, BY_ALPHA = range(8)
SLIPS, SHARES = 8, 9
ELEMENT_ROWS = 10


@kernel()
def correct_forces(forces, shares, static, total):  # type: ignore[no-untyped-def]
    """Spread what is missing to `total` over the elements that are not at their limit."""
    count = forces.shape[0]
    for i in range(count):
        limit = shares[i] * static
        forces[i] = min(max(forces[i], -limit), limit)
    for _ in range(count):
        missing = total
        for i in range(count):
            missing -= forces[i]
        if abs(missing) < 1e-9:
            return
        free = 0
        for i in range(count):
            limit = shares[i] * static
            if (forces[i] < limit) if missing > 0 else (forces[i] > -limit):
                free += 1
        if free == 0:
            return
        for i in range(count):
            limit = shares[i] * static
            if (forces[i] < limit) if missing > 0 else (forces[i] > -limit):
                forces[i] = min(max(forces[i] + missing / free, -limit), limit)


@kernel()
def begin(elements, start, coulomb, alpha, known_coulomb, rest_force):  # type: ignore[no-untyped-def]
    """State at rest: scaled from the Coulomb force it was known under, the sum as measured."""
    n = start.shape[0]
    forces = elements[FORCE]
    for row in range(ELEMENT_ROWS):
        if row != SHARES:
            for i in range(n + 1):
                elements[row, i] = 0.0
    for i in range(n):
        forces[i] = start[i] * (coulomb / known_coulomb)
    correct_forces(forces[:n], elements[SHARES, :n], coulomb * (1.0 + alpha), rest_force)
    total = 0.0
    for i in range(n):
        total += forces[i]
    for i in range(n):
        elements[BY_COULOMB, i] = (forces[i] - total / n) / coulomb
        elements[BY_REST, i] = 1.0 / n
    forces[n] = total
    elements[BY_REST, n] = 1.0
    elements[SHARES, n] = -1.0


@kernel()
def stribeck_rise(ratio, delta):  # type: ignore[no-untyped-def]
    """exp(-|v/vs|^delta)."""
    if delta != 1.0:
        ratio = ratio**delta
    return math.exp(-ratio) if ratio < 40.0 else 0.0


@kernel(forceinline=True)
def step_elements(dx, direction, rise, decay, dt, coulomb, stiffness, rate, alpha, elements):  # type: ignore[no-untyped-def]
    """Every element by one displacement.

    Returns the share of those that land on their limit, and by how much a position's error moves
    the force they land at [N/m].
    """
    n = elements.shape[1] - 1
    landed = slack = 0.0
    curve = 1.0 + alpha * rise
    rise_before = elements[SHARES, n]  # left here by the step before
    elements[SHARES, n] = rise
    stretch = stiffness * dx
    part = dx / n
    slower = rate * dt * rise / (curve * curve)  # d ln decay / d alpha
    for i in range(n):
        share = elements[SHARES, i]
        goal = direction * share * curve
        rising = direction * share * rise * coulomb
        force = elements[FORCE, i]
        if elements[SLIPS, i] == 0.0:
            limit = share * curve * coulomb
            ahead = (force + stretch) * direction
            if ahead < limit:
                elements[FORCE, i] = force + stretch
                elements[BY_STIFFNESS, i] += part
                continue
            elements[SLIPS, i] = 1.0
            limit_before = share * (1.0 + alpha * rise_before) * coulomb
            room = limit_before - force * direction
            closing = stretch * direction - (limit - limit_before)
            if room > 0.0 and closing > 0.0:
                # Inside the step it reaches a limit that moves too; what is left of the step it
                # slips, so that nothing jumps where the step it lands in changes.
                landed += share
                slack += stiffness * abs(limit - limit_before) / closing
                at = min(room / closing, 1.0)
                land = force + at * stretch
                rest = 1.0 - (1.0 - at) * (1.0 - decay)
                away = land - goal * coulomb
                limit_by_coulomb = share * (1.0 + alpha * (rise_before + (rise - rise_before) * at))
                limit_by_alpha = share * coulomb * (rise_before + (rise - rise_before) * at)
                for row in range(BY_COULOMB, BY_ALPHA + 1):
                    before = elements[row, i]
                    push = part * at if row == BY_STIFFNESS else 0.0
                    moves = towards = itself = 0.0
                    if row == BY_COULOMB:
                        moves, towards = limit_by_coulomb, goal
                    elif row == BY_ALPHA:
                        moves, towards = limit_by_alpha, rising
                        itself = (1.0 - at) * decay * slower
                    elif row == BY_RATE:
                        itself = -(1.0 - at) * decay * dt / curve
                    sooner = (moves - (before + push) * direction) / closing
                    by_land = before + push + stretch * sooner
                    elements[row, i] = (
                        towards
                        + (by_land - towards) * rest
                        + away * ((1.0 - decay) * sooner + itself)
                    )
                elements[FORCE, i] = goal * coulomb + away * rest
                continue
        away = (force - goal * coulomb) * decay
        elements[FORCE, i] = goal * coulomb + away
        elements[BY_COULOMB, i] = goal + (elements[BY_COULOMB, i] - goal) * decay
        elements[BY_RATE, i] = elements[BY_RATE, i] * decay - away * dt / curve
        elements[BY_ALPHA, i] = rising + (elements[BY_ALPHA, i] - rising) * decay + away * slower
        elements[BY_STIFFNESS, i] *= decay
        elements[BY_REST, i] *= decay
        elements[BY_TURN, i] *= decay
        elements[BY_SLIP, i] *= decay
    return landed, slack


@kernel()
def sum_elements(elements):  # type: ignore[no-untyped-def]
    """Sums over the elements into the column behind them; returns how many elements stick."""
    n = elements.shape[1] - 1
    for row in range(SLIPS):
        total = 0.0
        for i in range(n):
            total += elements[row, i]
        elements[row, n] = total
    stuck = n
    for i in range(n):
        if elements[SLIPS, i] > 0.0:
            stuck -= 1
    return stuck
