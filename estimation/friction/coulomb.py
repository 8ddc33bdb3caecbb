"""Coulomb-Stribeck-viscous friction: a law without presliding, the simplest there is.

In motion the force is sgn(v) Fc (1 + alpha exp(-|v/vs|^delta)), at rest whatever was measured
there, up to Fs. One internal force, no memory but it. Sensitivities follow directly; the stiffness
and the relaxation rate are not part of it.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from estimation.friction.law import BY_ALPHA, BY_COULOMB, BY_REST, BY_TURN, FORCE, ROWS
from stagedata.compiled import kernel


class Constants(NamedTuple):
    """What is not estimated: Stribeck velocity [m/s] and shape."""

    stribeck_velocity: float
    stribeck_shape: float


TRACE = np.dtype([("total", np.float64, (ROWS,)), ("sliding", np.float64), ("spring", np.float64)])
"""See `law.make_trace`."""


@cache
def make_constants(elements: int, stribeck_velocity: float, stribeck_shape: float) -> Constants:
    """Constants of the law; it has no elements."""
    return Constants(stribeck_velocity, stribeck_shape)


def count_states(elements: int) -> int:
    """One: the friction force itself."""
    return 1


@kernel()
def retained(law, rate, period):  # type: ignore[no-untyped-def]
    """0: the force follows the speed at once, without relaxation."""
    return 0.0


@kernel()
def has_presliding(law):  # type: ignore[no-untyped-def]
    """False: the law predicts no force before the axis slides."""
    return False


@kernel()
def breakaway_travel(law, coulomb, stiffness, alpha):  # type: ignore[no-untyped-def]
    """0, without presliding [m]."""
    return 0.0


@kernel()
def stick_range(law, forces, known, coulomb):  # type: ignore[no-untyped-def]
    """An empty range: there is no stiffness to show [N]."""
    return 0.0, 0.0


@kernel()
def correct(law, forces, static, total):  # type: ignore[no-untyped-def]
    """At rest the force is what was measured, up to Fs [N]; `forces` has shape (1,)."""
    forces[0] = min(max(total, -static), static)


@kernel()
def make_trace(law):  # type: ignore[no-untyped-def]
    """Workspace of a pass."""
    return np.zeros(1, TRACE)


@kernel()
def begin(law, figures, trace, forces, known, total):  # type: ignore[no-untyped-def]
    """At rest with the force `total` [N]."""
    static = figures.coulomb * (1.0 + figures.alpha)
    for row in range(ROWS):
        trace.total[row] = 0.0
    trace.total[FORCE] = min(max(total, -static), static)
    trace.total[BY_REST] = 1.0
    trace.sliding = 0.0


@kernel()
def resume(law, figures, trace, forces, slips):  # type: ignore[no-untyped-def]
    """Start in the state given by `forces` [N] and `slips`, shapes (1,)."""
    for row in range(ROWS):
        trace.total[row] = 0.0
    trace.total[FORCE] = forces[0]
    trace.sliding = 1.0 if slips[0] else 0.0


@kernel()
def slide(law, figures, trace, direction):  # type: ignore[no-untyped-def]
    """Start sliding fast in `direction`."""
    step(law, figures, trace, 0.0, direction, 0.0, 0.0, 0.0)


@kernel()
def begin_zone(law, trace):  # type: ignore[no-untyped-def]
    """Nothing to do: without internal forces an offset does not persist."""


@kernel()
def leap(law, figures, trace, travel, direction, fast):  # type: ignore[no-untyped-def]
    """At rest nothing changes."""
    return direction == 0.0


@kernel()
def step(law, figures, trace, travel, direction, before, rise, time):  # type: ignore[no-untyped-def]
    """The force depends on the speed alone [N], not on its past."""
    for row in range(ROWS):
        trace.total[row] = 0.0
    trace.total[BY_COULOMB] = direction * (1.0 + figures.alpha * rise)
    trace.total[BY_ALPHA] = direction * rise * figures.coulomb
    trace.total[FORCE] = trace.total[BY_COULOMB] * figures.coulomb
    trace.sliding = 1.0
    return 1.0, 0.0


@kernel()
def release(law, figures, trace, direction):  # type: ignore[no-untyped-def]
    """The axis sticks with its last force; at rest any force up to Fs is possible [N]."""
    slid = trace.sliding
    trace.total[BY_TURN] = 1.0
    trace.sliding = 0.0
    return slid * figures.coulomb * (1.0 + figures.alpha)


@kernel()
def finish(law, trace, forces, slips):  # type: ignore[no-untyped-def]
    """The force [N] and whether it slides, shapes (1,)."""
    forces[0] = trace.total[FORCE]
    slips[0] = trace.sliding > 0.0
