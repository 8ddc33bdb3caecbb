"""Friction force along sampled positions, with its derivatives; driven by positions, not speeds.

Source: the equations of docs/reference/reference-stage.md, in the displacement, not the speed.
"""

from __future__ import annotations

import math

import numpy as np

from estimation.friction.law import (
    BY_COULOMB,
    BY_RATE,
    BY_STIFFNESS,
    FAR_ABOVE,
    FORCE,
    NO_SUBSTEPS,
    Figures,
    finish,
    leap,
    make_trace,
    release,
    resume,
    step,
    stribeck_rise,
)
from estimation.friction.model import FrictionState, kernel_figures, make_constants
from stagedata import F64, FrictionFigures
from stagedata.compiled import kernel

REST_BAND = 4e-9
"""Displacement below which the axis counts as at rest: a few times the encoder noise [m]."""
SUBSTEPS = 4
"""Steps inside a sample that is not far above the Stribeck velocity."""


@kernel()
def follow_positions(law, figures, levels, state, path, steps, force, jacobian):  # type: ignore[no-untyped-def]
    """Evaluate a law along sampled positions.

    Args:
        law: its constants.
        figures: at which it is evaluated; their period is that of the samples.
        levels: Fc at each sample [N], shape (K,); or of all, shape (1,).
        state: the arrays of a `FrictionState`; advanced.
        path: positions [m], and velocities at the same samples [m/s], shapes (K,).
        steps: inside a sample that is not far above the Stribeck velocity; and the displacement
            below which nothing moves [m].
        force: written: sum of the internal forces [N], shape (K,).
        jacobian: written: its derivatives by Fc, sigma0 and C/Fc, shape (K, 3).
    """
    (forces, slipping, memory), (position, velocity), (substeps, band) = state, path, steps
    traces, f = make_trace(law), figures
    now = Figures(levels[0], f.stiffness, f.rate, f.alpha, f.period, f.retained)
    trace = traces[0]
    resume(law, now, trace, forces, slipping)
    vs, shape = law.stribeck_velocity, law.stribeck_shape
    fast = vs * FAR_ABOVE ** (1.0 / shape)
    direction, reference = memory[0], memory[1]
    v0 = velocity[0]
    before = stribeck_rise(abs(v0) / vs, shape)
    for k in range(position.shape[0]):
        moved, v1 = position[k] - reference, velocity[k]
        if levels.shape[0] > 1:
            now = Figures(levels[k], f.stiffness, f.rate, f.alpha, f.period, f.retained)
        if abs(moved) > band:
            reference = position[k]
            slowest = min(v0 * direction, v1 * direction)
            if (
                trace.sliding == 1.0
                and slowest > fast
                and moved * direction > 0.0
                and leap(law, now, trace, moved, direction, True)
            ):
                before = 0.0
            else:
                count = 1 if slowest > NO_SUBSTEPS * vs else substeps
                direction, before = _move(
                    law, now, trace, (moved, v0, v1), direction, before, count
                )
        force[k] = trace.total[FORCE]
        jacobian[k, 0] = trace.total[BY_COULOMB]
        jacobian[k, 1] = trace.total[BY_STIFFNESS]
        jacobian[k, 2] = trace.total[BY_RATE]
        v0 = v1
    finish(law, traces[0], forces, slipping)  # `traces` owns what `trace` points to
    memory[0], memory[1] = direction, reference


@kernel()
def _move(law, figures, trace, motion, direction, before, steps):  # type: ignore[no-untyped-def]
    """One sample period in steps; returns direction and Stribeck rise in the last of them.

    `motion`: displacement [m], velocities before and after [m/s]; `direction` and `before`: as
    returned of the period before.
    """
    moved, v0, v1 = motion
    dt = figures.period / steps
    # The velocity is linear, shifted so that it covers the distance moved.
    shift = moved / figures.period - 0.5 * (v0 + v1)
    for j in range(steps):
        v = v0 + (v1 - v0) * (j + 0.5) / steps + shift
        if v == 0.0:
            continue
        if v * direction <= 0.0:
            release(law, figures, trace, direction)
            direction = math.copysign(1.0, v)
        rise = stribeck_rise(abs(v) / law.stribeck_velocity, law.stribeck_shape)
        step(law, figures, trace, v * dt, direction, before, rise, dt)
        before = rise
    return direction, before


def follow(
    friction: FrictionFigures,
    state: FrictionState,
    position: F64,
    velocity: F64,
    period: float,
    substeps: int = SUBSTEPS,
    band: float = REST_BAND,
    variation: F64 | None = None,
) -> tuple[F64, F64]:
    """Friction force without its viscous part along sampled positions, starting from `state`.

    Args:
        friction: the model.
        state: friction state at the sample before position[0]; advanced in place.
        position: sampled positions [m], shape (K,).
        velocity: at the same samples [m/s], shape (K,); used inside a sample only.
        period: of the samples [s].
        substeps: steps inside a sample of a law that has presliding. One without takes one: at a
            stop the linear velocity inside a sample ends a little beyond zero, a spring back of
            nothing with presliding, twice the static force without.
        band: displacement below which nothing moves [m].
        variation: Coulomb force at each sample relative to the model's, minus 1, shape (K,): what
            slides follows it, what sticks keeps its force. None: it is the same everywhere.

    Returns:
        force: at each sample [N], shape (K,).
        jacobian: its derivatives by Fc, sigma0 and C/Fc, each with the others and the start
            fixed, shape (K, 3).
    """
    force = np.empty(len(position))
    jacobian = np.empty((len(position), 3))
    level = np.array([friction.coulomb])
    follow_positions(
        make_constants(friction), kernel_figures(friction, period),
        level if variation is None else level * (1.0 + variation), state.arrays,
        (np.ascontiguousarray(position), np.ascontiguousarray(velocity)),
        (substeps if friction.has("stiffness") else 1, band), force, jacobian,
    )  # fmt: skip
    return force, jacobian
