"""What a position's error leaves in the force of elements that slip.

An error of one position shifts the instant at which an element begins to slip, and the limit it
slips at. What that changes stays in the element's force and fades with it, at the rate that all
slipping elements share. Derivatives are differences of the step that `rows` takes.
"""

from __future__ import annotations

import math

import numpy as np

from estimation.compiled import kernel
from estimation.elements import (
    ELEMENT_ROWS,
    FORCE,
    SHARES,
    SLIPS,
    begin,
    step_elements,
    stribeck_rise,
)
from estimation.gms import FAR_ABOVE, NO_SUBSTEPS
from estimation.move_tables import SUBSTEPS, T_POSITION, T_SHARE
from estimation.rows import lead_sample

TINY = 1e-3
"""Change of a position by which derivatives are taken [its standard deviations]."""
REACH = 4
"""Positions that touch the slipping elements of row k: k-1...k+2 (its own is k+1). What k-2 does to
the limit before, where an element begins to slip at once, is a tenth of that at most: left out."""


@kernel()
def carry(  # type: ignore[no-untyped-def]
    coulomb, stiffness, rate, alpha, shape, noise, period, start, known_coulomb, rest_force,
    tables, heading, ready, shares, pull, keep, left,
):  # fmt: skip
    """Lead the elements through a move; what errors of positions do to those that slip.

    Args:
        coulomb: Fc [N].
        stiffness: sigma0 [N/m].
        rate: C/Fc [1/s].
        alpha: of the Stribeck curve.
        shape: Stribeck velocity [m/s] and exponent.
        noise: rms of a position [m].
        period: of the samples [s].
        start: element forces at rest before the move [N], shape (N,).
        known_coulomb: Coulomb force under which they are known [N].
        rest_force: measured there [N].
        tables: of `rows.fill_rows`.
        heading: the same.
        ready: the same.
        shares: nu_i, shape (N,).
        pull: written: what the errors of the positions k-1...k+2 add to the force of the elements
            that slip behind row k [N per standard deviation], shape (REACH, K).
        keep: written: share that row k keeps of what there was before, shape (K,).
        left: written: variance of that [N^2], shape (K,).
    """
    n, count = shares.shape[0], keep.shape[0]
    elements, trial = np.zeros((ELEMENT_ROWS, n + 1)), np.zeros((ELEMENT_ROWS, n + 1))
    for i in range(n):
        elements[SHARES, i] = trial[SHARES, i] = shares[i]
    begin(elements, start, coulomb, alpha, known_coulomb, rest_force)
    far = shape[0] * FAR_ABOVE ** (1.0 / shape[1]) * 2.0 * period
    kept, spring = math.exp(-rate * period), stiffness / n
    small = TINY * noise
    near, position = np.empty(REACH + 1), tables[T_POSITION]
    forces, slips, slid = np.empty(n), np.empty(n), np.empty(n)
    variance = 0.0
    for k in range(count):
        direction = float(heading[k])
        keep[k] = 0.0
        for j in range(REACH):
            pull[j, k] = 0.0
        for j in range(REACH + 1):
            near[j] = position[max(k - 2 + j, 0)]
        before = _slipping(elements)
        if direction == 0.0:
            for i in range(n):
                elements[FORCE, i] += spring * (near[3] - near[2])
            elements[SHARES, n] = -1.0
        elif before == n and tables[T_SHARE, k] < 0.0 and _lowest(near, direction) > far:
            keep[k] = kept
            for i in range(n):
                goal = direction * shares[i] * coulomb
                elements[FORCE, i] = goal + (elements[FORCE, i] - goal) * kept
            elements[SHARES, n] = -1.0
        else:
            for i in range(n):
                forces[i], slips[i] = elements[FORCE, i], elements[SLIPS, i]
            lead_sample(
                k, 0.0, kept, 0.0, coulomb, spring, rate, alpha, shape, noise, period, tables,
                heading, ready, elements,
            )  # fmt: skip
            if tables[T_SHARE, k] < 0.0 and _slipping(elements) > 0:
                for i in range(n):
                    slid[i] = elements[SLIPS, i]
                for j in range(REACH + 1):
                    # First as it is, then with an error of each position.
                    at = REACH - j
                    near[at] += small if at > 0 else 0.0
                    for i in range(n):
                        trial[FORCE, i], trial[SLIPS, i] = forces[i], slips[i]
                        if at == 2 and slips[i] == 0.0:  # it has stretched with that error
                            trial[FORCE, i] += spring * small
                    share = _step(
                        near, k, direction, period, coulomb, spring, rate, alpha, shape, trial
                    )
                    near[at] = position[max(k - 2 + at, 0)]
                    total = 0.0
                    for i in range(n):
                        total += slid[i] * trial[FORCE, i]
                    if at > 0:
                        pull[at - 1, k] = total / TINY
                    else:
                        keep[k] = share if before > 0 else 0.0
                        for i in range(REACH):
                            pull[i, k] -= total / TINY
        if keep[k] > 0.0:
            variance *= keep[k] * keep[k]
        left[k] = variance
        if _slipping(elements) == 0:
            variance = 0.0
        for j in range(REACH):
            variance += pull[j, k] * pull[j, k]


@kernel()
def _slipping(elements):  # type: ignore[no-untyped-def]
    """How many slip."""
    number = 0
    for i in range(elements.shape[1] - 1):
        number += elements[SLIPS, i] > 0.0
    return number


@kernel()
def _lowest(near, direction):  # type: ignore[no-untyped-def]
    """Travel of two samples, about the row's own and the one before: the lesser."""
    return min((near[4] - near[2]) * direction, (near[3] - near[1]) * direction)


@kernel()
def _step(near, k, direction, period, coulomb, spring, rate, alpha, shape, elements):  # type: ignore[no-untyped-def]
    """One row, as `rows` leads the elements, from the positions k-2...k+2; returns what is kept."""
    n = elements.shape[1] - 1
    vs, delta = shape[0], shape[1]
    v1 = 0.5 * (near[4] - near[2]) / period
    v0 = 0.5 * (near[3] - near[1]) / period if k > 0 else v1
    ago = 0.5 * (near[2] - near[0]) / period if k > 1 else v0
    steps = SUBSTEPS if min(abs(v0), abs(ago)) <= NO_SUBSTEPS * vs else 1
    last = (near[2] - near[1]) / period + (v0 - ago) * (steps - 1) / (2 * steps)
    elements[SHARES, n] = stribeck_rise(abs(last if k > 0 else v1) / vs, delta)
    steps = SUBSTEPS if min(v0 * direction, v1 * direction) <= NO_SUBSTEPS * vs else 1
    dt, whole = period / steps, 1.0
    shift = (near[3] - near[2]) / period - 0.5 * (v0 + v1)
    for j in range(steps):
        v = v0 + (v1 - v0) * (j + 0.5) / steps + shift
        rise = stribeck_rise(abs(v) / vs, delta)
        decay = math.exp(-rate * dt / (1.0 + alpha * rise))
        step_elements(v * dt, direction, rise, decay, dt, coulomb, spring, rate, alpha, elements)
        whole *= decay
    return whole
