"""Generalized Maxwell slip: N elements in parallel, each sticking as a spring or slipping.

One step covers one displacement in one direction at one point of the Stribeck curve:

    stick:  dF_i = k_i sigma0 dx,  until sgn(v) F_i >= nu_i s(v) Fc
    slip:   F_i <- G + (F_i - G) exp(-rate dt/s(v)),  G = sgn(v) nu_i s(v) Fc
    s(v) = 1 + alpha exp(-|v/vs|^delta);  k_i = 1/N;  nu_i = 2i/(N(N+1));  rate = C/Fc

A sticking element stretches with the displacement itself, a slipping one takes the exact
exponential. One that reaches its limit inside a step slips for the rest of it, the limit moving
from where the last step left it: force and derivatives are continuous in every parameter, whatever
step it falls into. C/Fc is the parameter, not C: it is what stays when Fc changes.

While all elements slip, each goes through the same affine map F_i <- K F_i + nu_i G: the map is
kept instead of the elements, which are brought up to date when the motion ends.

Source: docs/reference/reference-stage.md, the plant.
"""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np

from estimation.friction.law import (
    BY_ALPHA,
    BY_COULOMB,
    BY_RATE,
    BY_REST,
    BY_SLIP,
    BY_STIFFNESS,
    BY_TURN,
    FORCE,
    ROWS,
)
from stagedata import F64, MAX_ELEMENTS
from stagedata.compiled import kernel

# The map of all elements since they all slip: share kept K; gain G [N]; derivative of G by Fc; and
# of both by C/Fc and alpha.
_KEPT, _GAIN, _GAIN_BY_COULOMB, _KEPT_BY_RATE, _GAIN_BY_RATE, _KEPT_BY_ALPHA, _GAIN_BY_ALPHA = (
    range(7)
)


class Constants(NamedTuple):
    """What is not estimated: N, Stribeck velocity [m/s] and shape."""

    elements: int
    stribeck_velocity: float
    stribeck_shape: float


TRACE = np.dtype(
    [
        ("total", np.float64, (ROWS,)),  # sums over the elements
        ("sliding", np.float64),  # share of the elements that slip
        ("spring", np.float64),  # stiffness of those that stick [N/m]
        ("element", np.float64, (ROWS, MAX_ELEMENTS)),  # the rows of each; behind, while all slip
        ("slips", np.int8, (MAX_ELEMENTS,)),
        ("before", np.float64, (ROWS,)),  # sums when the last element began to slip
        ("map", np.float64, (7,)),  # of all elements since then
    ]
)
"""State of the elements in a pass, with derivatives; see `law.make_trace`."""


@cache
def element_shares(elements: int) -> F64:
    """float64[N], nu_i = 2i/(N(N+1)): each element's share in the Coulomb force; read-only."""
    shares: F64 = 2.0 * np.arange(1, elements + 1) / (elements * (elements + 1))
    shares.flags.writeable = False
    return shares


@cache
def make_constants(elements: int, stribeck_velocity: float, stribeck_shape: float) -> Constants:
    """Constants of the law; the Stribeck velocity in m/s."""
    return Constants(elements, stribeck_velocity, stribeck_shape)


def count_states(elements: int) -> int:
    """One force per element."""
    return elements


@kernel()
def _share(law, i):  # type: ignore[no-untyped-def]
    """Nu of element i."""
    return 2.0 * (i + 1) / (law.elements * (law.elements + 1))


@kernel()
def retained(law, rate, period):  # type: ignore[no-untyped-def]
    """Share of a deviation left after `period` [s]; rate C/Fc [1/s]."""
    return math.exp(-rate * period)


@kernel()
def has_presliding(law):  # type: ignore[no-untyped-def]
    """True: elements that stick are springs."""
    return True


@kernel()
def breakaway_travel(law, coulomb, stiffness, alpha):  # type: ignore[no-untyped-def]
    """Displacement from relaxed to all elements slipping [m]; Fc [N], sigma0 [N/m], alpha."""
    n = law.elements
    return _share(law, n - 1) * (1.0 + alpha) * coulomb * n / stiffness


@kernel()
def stick_range(law, forces, known, coulomb):  # type: ignore[no-untyped-def]
    """Change of the sum [N], down and up, before the first element slips; `forces`: shape (N,)."""
    n = law.elements
    up = down = 1e300
    for i in range(n):
        limit = _share(law, i) * coulomb
        force = forces[i] * coulomb / known
        up, down = min(up, limit - force), min(down, limit + force)
    return -n * max(down, 0.0), n * max(up, 0.0)


@kernel()
def correct(law, forces, static, total):  # type: ignore[no-untyped-def]
    """Spread what is missing to `total` [N] over the elements that are not at their limit.

    As an unseen displacement would. `forces`: shape (N,); `static`: Fs [N].
    """
    n = forces.shape[0]
    for i in range(n):
        limit = _share(law, i) * static
        forces[i] = min(max(forces[i], -limit), limit)
    for _ in range(n):
        missing = total
        for i in range(n):
            missing -= forces[i]
        if abs(missing) < 1e-9:
            return
        free = 0
        for i in range(n):
            limit = _share(law, i) * static
            free += (forces[i] < limit) if missing > 0 else (forces[i] > -limit)
        if free == 0:
            return
        for i in range(n):
            limit = _share(law, i) * static
            if (forces[i] < limit) if missing > 0 else (forces[i] > -limit):
                forces[i] = min(max(forces[i] + missing / free, -limit), limit)


@kernel()
def make_trace(law):  # type: ignore[no-untyped-def]
    """Workspace of a pass."""
    return np.zeros(1, TRACE)


@kernel()
def begin(law, figures, trace, forces, known, total):  # type: ignore[no-untyped-def]
    """At rest: `forces` [N], shape (N,), scaled from Fc = `known`, their sum as measured [N]."""
    n, element = forces.shape[0], trace.element
    for i in range(n):
        element[FORCE, i] = forces[i] * (figures.coulomb / known)
    correct(law, element[FORCE, :n], figures.coulomb * (1.0 + figures.alpha), total)
    held = 0.0
    for i in range(n):
        held += element[FORCE, i]
    for i in range(n):
        for row in range(1, ROWS):
            element[row, i] = 0.0
        element[BY_COULOMB, i] = (element[FORCE, i] - held / n) / figures.coulomb
        element[BY_REST, i] = 1.0 / n
        trace.slips[i] = 0
    _add_up(law, figures, trace)


@kernel()
def resume(law, figures, trace, forces, slips):  # type: ignore[no-untyped-def]
    """Start with the given element forces [N] and slips, shapes (N,)."""
    for i in range(forces.shape[0]):
        for row in range(1, ROWS):
            trace.element[row, i] = 0.0
        trace.element[FORCE, i] = forces[i]
        trace.slips[i] = slips[i]
    _add_up(law, figures, trace)


@kernel()
def slide(law, figures, trace, direction):  # type: ignore[no-untyped-def]
    """Start with all elements slipping, each at its share of Fc."""
    for i in range(law.elements):
        for row in range(1, ROWS):
            trace.element[row, i] = 0.0
        trace.element[FORCE, i] = direction * _share(law, i) * figures.coulomb
        trace.element[BY_COULOMB, i] = direction * _share(law, i)
        trace.slips[i] = 1
    _add_up(law, figures, trace)
    begin_zone(law, trace)


@kernel()
def begin_zone(law, trace):  # type: ignore[no-untyped-def]
    """From here on an offset of all forces, in proportion to their shares, is an unknown."""
    _bring_up_to_date(law, trace)
    for i in range(law.elements):
        trace.element[BY_SLIP, i] = _share(law, i)
    trace.total[BY_SLIP] = trace.before[BY_SLIP] = 1.0


@kernel(forceinline=True)
def leap(law, figures, trace, travel, direction, fast):  # type: ignore[no-untyped-def]
    """Take a whole period at once, while all elements stick, or all slip far above vs.

    Returns False, with nothing changed, where neither is so. Sticking elements add up to a spring.
    """
    if trace.sliding == 1.0:
        if fast:
            _relax(figures, trace, direction, 0.0, figures.retained, figures.period)
        return fast
    if trace.sliding > 0.0:
        return False
    n, element = law.elements, trace.element
    stretch = figures.stiffness / n * travel
    lowest = figures.coulomb * min(1.0, 1.0 + figures.alpha)
    for i in range(n):
        if direction != 0.0 and (element[FORCE, i] + stretch) * direction >= (
            _share(law, i) * lowest
        ):
            return False
    for i in range(n):
        element[FORCE, i] += stretch
        element[BY_STIFFNESS, i] += travel / n
    trace.total[FORCE] += n * stretch
    trace.total[BY_STIFFNESS] += travel
    return True


@kernel()
def step(law, figures, trace, travel, direction, before, rise, time):  # type: ignore[no-untyped-def]
    """Move every element by a displacement [m] within `time` [s]; see `law.step`.

    An element sticks through the step, slips through it, or begins to slip in it (`_land`). Where
    all slip already, `_relax` extends the common map instead. Returns the sum of the shares nu_i of
    the elements that begin to slip, and the force error that an error of the position makes
    when they do [N/m].
    """
    n, element, alpha = law.elements, trace.element, figures.alpha
    curve = 1.0 + alpha * rise
    if rise == 0.0 and time == figures.period:
        decay = figures.retained
    else:
        decay = math.exp(-figures.rate * time / curve)
    if trace.sliding == 1.0:
        _relax(figures, trace, direction, rise, decay, time)
        return 0.0, 0.0
    coulomb, stiffness = figures.coulomb, figures.stiffness / n
    stretch, part = stiffness * travel, travel / n
    decay_by_alpha = figures.rate * time * rise / (curve * curve)  # d ln decay / d alpha
    landed = slack = 0.0
    for i in range(n):
        share, force = _share(law, i), element[FORCE, i]
        goal = direction * share * curve
        rising = direction * share * rise * coulomb
        if trace.slips[i] == 0:
            limit, limit_before = share * curve * coulomb, share * (1.0 + alpha * before) * coulomb
            if (force + stretch) * direction < limit:
                element[FORCE, i] = force + stretch
                element[BY_STIFFNESS, i] += part
                continue
            trace.slips[i] = 1
            margin = limit_before - force * direction
            closing = stretch * direction - (limit - limit_before)
            if margin > 0.0 and closing > 0.0:
                landed += share
                slack += stiffness * abs(limit - limit_before) / closing
                _land(trace, i, figures, share, part, (direction, before, rise, time, decay))
                continue
        away = (force - goal * coulomb) * decay
        element[FORCE, i] = goal * coulomb + away
        element[BY_COULOMB, i] = goal + (element[BY_COULOMB, i] - goal) * decay
        element[BY_RATE, i] = element[BY_RATE, i] * decay - away * time / curve
        element[BY_ALPHA, i] = (
            rising + (element[BY_ALPHA, i] - rising) * decay + away * decay_by_alpha
        )
        for row in (BY_STIFFNESS, BY_REST, BY_TURN, BY_SLIP):
            element[row, i] *= decay
    _add_up(law, figures, trace)
    return landed, slack


@kernel()
def _land(trace, i, figures, share, part, how):  # type: ignore[no-untyped-def]
    """Let element i begin to slip inside a step.

    Its limit moves linearly from nu_i (1 + alpha before) Fc to nu_i (1 + alpha rise) Fc. It sticks
    until it meets the limit and slips for the remaining share of the step, so force and derivatives
    stay continuous when a parameter moves that point into another step.

    `share`: nu_i; `part`: d force/d sigma0 of the whole step [m]; `how`: direction, before, rise
    and time as of `step`, and exp(-rate dt/s) of it.
    """
    direction, before, rise, time, decay = how
    element, coulomb, alpha = trace.element, figures.coulomb, figures.alpha
    curve, stretch = 1.0 + alpha * rise, figures.stiffness * part
    limit, limit_before = share * curve * coulomb, share * (1.0 + alpha * before) * coulomb
    closing = stretch * direction - (limit - limit_before)
    at = min((limit_before - element[FORCE, i] * direction) / closing, 1.0)
    goal, rising = direction * share * curve, direction * share * rise * coulomb
    left = 1.0 - at
    rest = 1.0 - left * (1.0 - decay)
    away = element[FORCE, i] + at * stretch - goal * coulomb
    rise_at = before + (rise - before) * at
    for row in range(BY_COULOMB, ROWS):
        own, moves, towards, itself = element[row, i], 0.0, 0.0, 0.0
        if row == BY_STIFFNESS:
            own += part * at
        elif row == BY_COULOMB:
            moves, towards = share * (1.0 + alpha * rise_at), goal
        elif row == BY_ALPHA:
            moves, towards = share * coulomb * rise_at, rising
            itself = left * decay * figures.rate * time * rise / (curve * curve)
        elif row == BY_RATE:
            itself = -left * decay * time / curve
        sooner = (moves - own * direction) / closing
        landing = own + stretch * sooner
        element[row, i] = (
            towards + (landing - towards) * rest + away * ((1.0 - decay) * sooner + itself)
        )
    element[FORCE, i] = goal * coulomb + away * rest


@kernel()
def release(law, figures, trace, direction):  # type: ignore[no-untyped-def]
    """Make every element stick.

    Returns how far those that slipped are from their limits at zero speed, added up [N].
    """
    _bring_up_to_date(law, trace)
    n, away = law.elements, 0.0
    static = figures.coulomb * (1.0 + figures.alpha)
    for i in range(n):
        if trace.slips[i] != 0:
            away += abs(direction * _share(law, i) * static - trace.element[FORCE, i])
            trace.element[BY_TURN, i] = 1.0 / n
            trace.slips[i] = 0
    _add_up(law, figures, trace)
    return away


@kernel()
def finish(law, trace, forces, slips):  # type: ignore[no-untyped-def]
    """Element forces [N] and which of them slip, shapes (N,)."""
    _bring_up_to_date(law, trace)
    for i in range(forces.shape[0]):
        forces[i], slips[i] = trace.element[FORCE, i], trace.slips[i] != 0


@kernel()
def _add_up(law, figures, trace):  # type: ignore[no-untyped-def]
    """Sums over the elements, and how many slip; begins the map where all do."""
    n = law.elements
    for row in range(ROWS):
        total = 0.0
        for i in range(n):
            total += trace.element[row, i]
        trace.total[row] = total
    slipping = 0
    for i in range(n):
        slipping += trace.slips[i]
    trace.sliding = slipping / n
    trace.spring = (n - slipping) * figures.stiffness / n
    if slipping == n:
        for row in range(ROWS):
            trace.before[row] = trace.total[row]
        for j in range(7):
            trace.map[j] = 0.0
        trace.map[_KEPT] = 1.0


@kernel(forceinline=True)
def _relax(figures, trace, direction, rise, decay, time):  # type: ignore[no-untyped-def]
    """Let all elements slip for `time` [s]: extend their common map, and apply it to the sums.

    In F_i <- K F_i + nu_i G: K <- K decay, G <- G decay + (1 - decay) direction s Fc.
    """
    m, total, before = trace.map, trace.total, trace.before
    curve = 1.0 + figures.alpha * rise
    goal = direction * curve
    by_rate = -decay * time / curve
    by_alpha = -by_rate * figures.rate * rise / curve
    off = m[_GAIN] - goal * figures.coulomb
    m[_KEPT_BY_RATE] = decay * m[_KEPT_BY_RATE] + by_rate * m[_KEPT]
    m[_GAIN_BY_RATE] = decay * m[_GAIN_BY_RATE] + by_rate * off
    m[_KEPT_BY_ALPHA] = decay * m[_KEPT_BY_ALPHA] + by_alpha * m[_KEPT]
    m[_GAIN_BY_ALPHA] = (
        decay * m[_GAIN_BY_ALPHA] + by_alpha * off
        + (1.0 - decay) * direction * rise * figures.coulomb
    )  # fmt: skip
    m[_KEPT] *= decay
    m[_GAIN] = goal * figures.coulomb + decay * off
    m[_GAIN_BY_COULOMB] = goal + decay * (m[_GAIN_BY_COULOMB] - goal)
    kept = m[_KEPT]
    total[FORCE] = kept * before[FORCE] + m[_GAIN]
    total[BY_COULOMB] = kept * before[BY_COULOMB] + m[_GAIN_BY_COULOMB]
    total[BY_STIFFNESS] = kept * before[BY_STIFFNESS]
    total[BY_RATE] = kept * before[BY_RATE] + m[_KEPT_BY_RATE] * before[FORCE] + m[_GAIN_BY_RATE]
    total[BY_ALPHA] = (
        kept * before[BY_ALPHA] + m[_KEPT_BY_ALPHA] * before[FORCE] + m[_GAIN_BY_ALPHA]
    )
    total[BY_REST] = kept * before[BY_REST]
    total[BY_TURN] = kept * before[BY_TURN]
    total[BY_SLIP] = kept * before[BY_SLIP]


@kernel()
def _bring_up_to_date(law, trace):  # type: ignore[no-untyped-def]
    """Apply the map of the slipping elements to each of them, and start a new map."""
    if trace.sliding < 1.0:
        return
    m, element = trace.map, trace.element
    for i in range(law.elements):
        share, force = _share(law, i), element[FORCE, i]
        element[FORCE, i] = m[_KEPT] * force + share * m[_GAIN]
        for row in range(BY_COULOMB, ROWS):
            element[row, i] *= m[_KEPT]
        element[BY_COULOMB, i] += share * m[_GAIN_BY_COULOMB]
        element[BY_RATE, i] += m[_KEPT_BY_RATE] * force + share * m[_GAIN_BY_RATE]
        element[BY_ALPHA, i] += m[_KEPT_BY_ALPHA] * force + share * m[_GAIN_BY_ALPHA]
    for row in range(ROWS):
        trace.before[row] = trace.total[row]
    for j in range(1, 7):
        m[j] = 0.0
    m[_KEPT] = 1.0
