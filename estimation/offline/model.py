"""Generalized Maxwell-slip friction of any shape, with its derivatives, along sampled positions.

As `estimation.friction.gms`, but nothing of it is fixed:

    stick:  dF_i = k_i sigma0 dx,  until sgn(v) F_i >= nu_i S
    slip, until v changes sign:  F_i <- G + (F_i - G) exp(-rate dt/s(v)),  G = sgn(v) nu_i S
    S = Fc (1 + w) (1 + asymmetry sgn(v)) s(v);  s(v) = 1 + alpha exp(-|v/vs|^delta)

w is the level, linear between knots in time: the Coulomb force of a real stage wanders. Element
forces keep the level at which they were left, so their derivatives by the knots are carried along.
"""

from __future__ import annotations

import math

import numpy as np

from estimation.compiled import kernel

# The model's figures as a vector; an element's derivatives: by these, its k_i and nu_i, knots.
COULOMB, STIFFNESS, RATE, ALPHA, VS, DELTA, ASYMMETRY = range(7)
SPRING, SHARE, KNOTS = 7, 8, 9
SUBSTEPS = 4
NO_SUBSTEPS = 4.0
"""Above this many Stribeck velocities, with all elements slipping, a sample is one step."""


@kernel()
def lead(  # type: ignore[no-untyped-def]
    theta, springs, shares, forces, slipping, derivative, memory, level, knot_spacing,
    position, velocity, period, band, force, jacobian,
):  # fmt: skip
    """Lead the elements through sampled positions, with derivatives by all (15 arguments).

    `theta`: figures, shape (7,); `springs`, `shares`: k_i and nu_i, shape (N,); `forces`,
    `slipping`, `memory` ([direction, reference position]): state, changed in place; `derivative`:
    of each element's force by figures, own k_i, own nu_i, knots and whatever else the state at the
    start depends on, shape (N, 9 + K + E), changed in place; `level`: w at the knots,
    `knot_spacing` seconds apart, the first at position[0], shape (K,), K >= 2; displacements below
    `band` are rest. `force`: shape (M,); `jacobian`: by figures, all k_i, all nu_i, knots and those
    others, shape (M, 7 + 2 N + K + E).
    """
    count, knots = forces.shape[0], level.shape[0]
    columns, extra = 7 + 2 * count, derivative.shape[1] - KNOTS
    coulomb, stiffness, rate = theta[COULOMB], theta[STIFFNESS], theta[RATE]
    alpha, vs, delta, asymmetry = theta[ALPHA], theta[VS], theta[DELTA], theta[ASYMMETRY]
    goal_by = np.zeros(KNOTS)
    all_slip = False
    for k in range(position.shape[0]):
        place = min(k * period / knot_spacing, knots - 1.0)
        knot = min(int(place), knots - 2)
        after = place - knot
        w = level[knot] * (1.0 - after) + level[knot + 1] * after
        moved = position[k] - memory[1]
        if abs(moved) > band:
            memory[1] = position[k]
            v1 = velocity[k]
            v0 = velocity[k - 1] if k > 0 else v1
            slowest = min(v0 * memory[0], v1 * memory[0])
            steps = 1 if all_slip and slowest > NO_SUBSTEPS * vs else SUBSTEPS
            dt = period / steps
            shift = moved / period - 0.5 * (v0 + v1)
            for j in range(steps):
                v = v0 + (v1 - v0) * (j + 0.5) / steps + shift
                dx = v * dt
                if dx == 0.0:
                    continue
                direction = math.copysign(1.0, dx)
                if direction != memory[0]:
                    memory[0] = direction
                    slipping[:] = False
                ratio = abs(v) / vs
                power = ratio**delta
                rise = math.exp(-power)
                curve = 1.0 + alpha * rise
                decay = math.exp(-rate * dt / curve)
                factor = (1.0 + w) * (1.0 + asymmetry * direction)
                scale = coulomb * factor
                # Of the curve by alpha, vs, delta; of the decay by the curve.
                by_alpha = rise
                by_vs = alpha * rise * delta * power / vs
                by_delta = -alpha * rise * power * math.log(ratio)
                decay_by_curve = decay * rate * dt / curve**2
                all_slip = True
                for i in range(count):
                    unit = direction * shares[i]
                    goal = unit * scale * curve
                    f = forces[i]
                    begins = False
                    if not slipping[i]:
                        stretched = f + springs[i] * stiffness * dx
                        if stretched * direction >= abs(goal):
                            slipping[i] = True
                            begins = f * direction < abs(goal)
                        else:
                            forces[i] = stretched
                            derivative[i, STIFFNESS] += springs[i] * dx
                            derivative[i, SPRING] += stiffness * dx
                            all_slip = False
                            continue
                    goal_by[COULOMB] = goal / coulomb
                    goal_by[ALPHA] = unit * scale * by_alpha
                    goal_by[VS] = unit * scale * by_vs
                    goal_by[DELTA] = unit * scale * by_delta
                    goal_by[ASYMMETRY] = direction * goal / (1.0 + asymmetry * direction)
                    goal_by[SHARE] = goal / shares[i]
                    away = 0.0 if begins else f - goal
                    keep = 0.0 if begins else decay
                    for c in range(KNOTS):
                        own = goal_by[c]
                        derivative[i, c] = own + (derivative[i, c] - own) * keep
                    for c in range(KNOTS, KNOTS + knot + 2):  # later knots are not felt yet
                        derivative[i, c] *= keep
                    for c in range(KNOTS + knots, KNOTS + extra):
                        derivative[i, c] *= keep
                    by_level = goal / (1.0 + w) * (1.0 - keep)
                    derivative[i, KNOTS + knot] += by_level * (1.0 - after)
                    derivative[i, KNOTS + knot + 1] += by_level * after
                    derivative[i, RATE] -= away * decay * dt / curve
                    derivative[i, ALPHA] += away * decay_by_curve * by_alpha
                    derivative[i, VS] += away * decay_by_curve * by_vs
                    derivative[i, DELTA] += away * decay_by_curve * by_delta
                    forces[i] = goal + away * decay
        total = 0.0
        jacobian[k, :] = 0.0
        for i in range(count):
            total += forces[i]
            for c in range(7):
                jacobian[k, c] += derivative[i, c]
            jacobian[k, 7 + i] = derivative[i, SPRING]
            jacobian[k, 7 + count + i] = derivative[i, SHARE]
            for c in range(extra):
                jacobian[k, columns + c] += derivative[i, KNOTS + c]
        force[k] = total
