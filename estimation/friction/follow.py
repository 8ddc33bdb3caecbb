"""Friction force along sampled positions, with its derivatives; driven by positions, not speeds."""

from __future__ import annotations

import math

import numpy as np

from estimation.friction.law import (
    BY_COULOMB,
    BY_RATE,
    BY_STIFFNESS,
    F64,
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
from stagedata import FrictionFigures
from stagedata.compiled import kernel

REST_BAND = 4e-9
"""Displacement below which the axis counts as at rest: a few times the encoder noise [m]."""
SUBSTEPS = 4
"""Steps inside a sample that is not far above the Stribeck velocity."""


@kernel()
def follow_positions(  # type: ignore[no-untyped-def]
    law, figures, levels, forces, slipping, memory, position, velocity, substeps, band, force,
    jacobian,
):  # fmt: skip
    """Evaluate a law along sampled positions (12 arguments: those of `follow`, as arrays).

    Args:
        law: its constants.
        figures: at which it is evaluated; their period is that of the samples.
        levels: Fc at each sample [N], shape (K,); or of all, shape (1,).
        forces: internal forces [N], shape (n,); advanced.
        slipping: which of them slide, shape (n,); advanced.
        memory: direction of motion, and position up to which it was taken [m]; advanced.
        position: sampled [m], shape (K,).
        velocity: at the same samples [m/s], shape (K,).
        substeps: steps inside a sample that is not far above the Stribeck velocity.
        band: displacement below which nothing moves [m].
        force: written: sum of the internal forces [N], shape (K,).
        jacobian: written: its derivatives by Fc, sigma0 and C/Fc, shape (K, 3).
    """
    traces, f = make_trace(law), figures
    now = Figures(levels[0], f.stiffness, f.rate, f.alpha, f.period, f.retained)
    trace = traces[0]
    resume(law, now, trace, forces, slipping)
    vs, shape, period = law.stribeck_velocity, law.stribeck_shape, f.period
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
                # The velocity is linear, shifted so that it covers the distance moved.
                steps = 1 if slowest > NO_SUBSTEPS * vs else substeps
                dt = period / steps
                shift = moved / period - 0.5 * (v0 + v1)
                for j in range(steps):
                    v = v0 + (v1 - v0) * (j + 0.5) / steps + shift
                    if v == 0.0:
                        continue
                    if v * direction <= 0.0:
                        release(law, now, trace, direction)
                        direction = math.copysign(1.0, v)
                    rise = stribeck_rise(abs(v) / vs, shape)
                    step(law, now, trace, v * dt, direction, before, rise, dt)
                    before = rise
        force[k] = trace.total[FORCE]
        jacobian[k, 0] = trace.total[BY_COULOMB]
        jacobian[k, 1] = trace.total[BY_STIFFNESS]
        jacobian[k, 2] = trace.total[BY_RATE]
        v0 = v1
    finish(law, traces[0], forces, slipping)  # `traces` owns what `trace` points to
    memory[0], memory[1] = direction, reference


def steps_within(friction: FrictionFigures, substeps: int) -> int:
    """Steps inside a sample: one where the law has no presliding.

    At a stop the linear velocity inside a sample ends a little beyond zero: a spring back of
    nothing with presliding, twice the static force without.
    """
    return substeps if friction.has("stiffness") else 1


def follow(
    friction: FrictionFigures,
    state: FrictionState,
    position: F64,
    velocity: F64,
    period: float,
    substeps: int = SUBSTEPS,
    band: float = REST_BAND,
) -> tuple[F64, F64]:
    """Friction force without its viscous part along sampled positions, starting from `state`.

    Args:
        friction: the model.
        state: friction state at the sample before position[0]; advanced in place.
        position: sampled positions [m], shape (K,).
        velocity: at the same samples [m/s], shape (K,); used inside a sample only.
        period: of the samples [s].
        substeps: steps inside a sample.
        band: displacement below which nothing moves [m].

    Returns:
        force: at each sample [N], shape (K,).
        jacobian: its derivatives by Fc, sigma0 and C/Fc, each with the others and the start
            fixed, shape (K, 3).
    """
    force = np.empty(len(position))
    jacobian = np.empty((len(position), 3))
    follow_positions(
        make_constants(friction), kernel_figures(friction, period),
        np.array([friction.coulomb]), state.forces, state.slipping, state.memory,
        np.ascontiguousarray(position),
        np.ascontiguousarray(velocity), steps_within(friction, substeps), band, force, jacobian,
    )  # fmt: skip
    return force, jacobian
