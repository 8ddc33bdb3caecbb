"""Generalized Maxwell-slip friction of any shape, with its derivatives, along sampled positions.

As `estimation.friction.gms`, but every figure can be estimated:

    stick:  dF_i = k_i sigma0 dx,  until sgn(v) F_i >= nu_i S
    slip, until v changes sign:  F_i <- G + (F_i - G) exp(-rate dt/s(v)),  G = sgn(v) nu_i S
    S = Fc (1 + w) (1 + asymmetry sgn(v)) s(v);  s(v) = 1 + alpha exp(-|v/vs|^delta)

w is the level, linear between knots in time: the Coulomb force of a real stage wanders. A sticking
element keeps the level at which it last slipped, so the derivatives of its force by the knots are
carried along. Shapes below: N elements, M samples, K knots, E unknowns of the state at the start.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from stagedata import F64
from stagedata.compiled import kernel

BY_COULOMB, BY_STIFFNESS, BY_RATE, BY_ALPHA, BY_VS, BY_DELTA, BY_ASYMMETRY = range(7)
BY_SPRING, BY_SHARE = 7, 8
"""Columns of an element's derivatives: by the figures, then by its own k_i and nu_i."""
SUBSTEPS = 4
NO_SUBSTEPS = 4.0
"""Above this many Stribeck velocities, with all elements slipping, a sample is one step."""


class Figures(NamedTuple):
    """Figures at which the law is evaluated.

    Attributes:
        coulomb: Fc [N].
        stiffness: sigma0 [N/m].
        rate: C/Fc [1/s].
        alpha: static ratio, (Fs - Fc)/Fc.
        stribeck_velocity: vs [m/s].  stribeck_shape: delta.
        asymmetry: surplus of the force in the positive direction, relative.
        springs, shares: k_i and nu_i, shape (N,); each adds up to 1.
    """

    coulomb: float
    stiffness: float
    rate: float
    alpha: float
    stribeck_velocity: float
    stribeck_shape: float
    asymmetry: float
    springs: F64
    shares: F64


class Level(NamedTuple):
    """Wander w of the Coulomb force over a block.

    Attributes:
        knots: w at the knots, the first at the block's first position, shape (K,), K >= 2.
        spacing: of the knots [s].
    """

    knots: F64
    spacing: float


class Path(NamedTuple):
    """Sampled motion through a block.

    Attributes:
        position: [m], shape (M,).
        velocity: at the same instants [m/s], shape (M,).
        period: of the samples [s].
        rest_band: displacements up to this count as rest [m].
    """

    position: F64
    velocity: F64
    period: float
    rest_band: float


LAST = np.dtype([("direction", np.float64), ("position", np.float64)])
"""Last motion: its sign, 0 before the first; position up to which the elements are led [m]."""


class State(NamedTuple):
    """Elements with their derivatives; `lead` changes it in place.

    Attributes:
        forces: [N], shape (N,).
        slipping: shape (N,).
        by_figures: derivatives of each force by the figures, own k_i and own nu_i, shape (N, 9).
        by_knots: the same by the knots, shape (N, K).
        by_start: the same by what else the state at the start depends on, shape (N, E).
        last: one record of `LAST`, shape (1,).
    """

    forces: F64
    slipping: NDArray[np.bool_]
    by_figures: F64
    by_knots: F64
    by_start: F64
    last: NDArray[Any]


class Prediction(NamedTuple):
    """Friction force at every sample with its derivatives; `lead` writes it.

    Attributes:
        force: without the viscous part [N], shape (M,).
        by_figures: by the first seven figures, shape (M, 7).
        by_springs, by_shares: by k_i and nu_i, shape (M, N).
        by_knots: shape (M, K).
        by_start: shape (M, E).
    """

    force: F64
    by_figures: F64
    by_springs: F64
    by_shares: F64
    by_knots: F64
    by_start: F64


class _Curve(NamedTuple):
    """Stribeck curve s(v) with its derivatives by alpha, vs and delta; decay over one step of it.

    `decay`: share of a deviation from the sliding force that is left after the step.
    """

    value: float
    by_alpha: float
    by_vs: float
    by_delta: float
    decay: float
    decay_by_curve: float
    decay_by_rate: float


def make_state(position: float, elements: int, knots: int, starts: int) -> State:
    """Elements without force at `position` [m]."""
    return State(
        np.zeros(elements), np.zeros(elements, dtype=np.bool_), np.zeros((elements, 9)),
        np.zeros((elements, knots)), np.zeros((elements, starts)),
        np.array([(0.0, position)], dtype=LAST),
    )  # fmt: skip


def make_prediction(samples: int, elements: int, knots: int, starts: int) -> Prediction:
    """Workspace for the force at `samples` samples."""
    shapes = ((samples, n) for n in (7, elements, elements, knots, starts))
    return Prediction(np.empty(samples), *(np.empty(shape) for shape in shapes))


@kernel()
def lead(figures, level, path, state, prediction):  # type: ignore[no-untyped-def]
    """Lead the elements through sampled positions: `Figures`, `Level`, `Path`.

    Changes `state`, shapes as in `State`, and writes `prediction`, shapes as in `Prediction`.
    """
    last = state.last[0]
    all_slip = False
    for k in range(path.position.shape[0]):
        place = min(k * path.period / level.spacing, level.knots.shape[0] - 1.0)
        knot = min(int(place), level.knots.shape[0] - 2)
        after = place - knot
        w = level.knots[knot] * (1.0 - after) + level.knots[knot + 1] * after
        moved = path.position[k] - last.position
        if abs(moved) > path.rest_band:
            last.position = path.position[k]
            v1 = path.velocity[k]
            v0 = path.velocity[k - 1] if k > 0 else v1
            slowest = min(v0 * last.direction, v1 * last.direction)
            straight = all_slip and slowest > NO_SUBSTEPS * figures.stribeck_velocity
            steps = 1 if straight else SUBSTEPS
            dt = path.period / steps
            shift = moved / path.period - 0.5 * (v0 + v1)
            for j in range(steps):
                v = v0 + (v1 - v0) * (j + 0.5) / steps + shift
                if v * dt != 0.0:
                    all_slip = _step(figures, state, v, dt, w, knot, after)
        _add_up(state, prediction, k)


@kernel()
def _step(figures, state, v, dt, w, knot, after):  # type: ignore[no-untyped-def]
    """All elements over `dt` [s] at velocity `v` [m/s]; returns whether all of them slip.

    The level is `w`, a share `after` of the way from `knot` to the next one.
    """
    last, dx = state.last[0], v * dt
    direction = math.copysign(1.0, dx)
    if direction != last.direction:
        last.direction = direction
        state.slipping[:] = False
    curve = _evaluate_curve(figures, abs(v), dt)
    scale = figures.coulomb * ((1.0 + w) * (1.0 + figures.asymmetry * direction))
    all_slip = True
    for i in range(state.forces.shape[0]):
        unit = direction * figures.shares[i]
        goal = unit * scale * curve.value
        force, lands = state.forces[i], False
        if not state.slipping[i]:
            stretched = force + figures.springs[i] * figures.stiffness * dx
            if stretched * direction < abs(goal):
                state.forces[i] = stretched
                state.by_figures[i, BY_STIFFNESS] += figures.springs[i] * dx
                state.by_figures[i, BY_SPRING] += figures.stiffness * dx
                all_slip = False
                continue
            state.slipping[i] = True
            lands = force * direction < abs(goal)  # on its limit, within this step
        away, keep = (0.0, 0.0) if lands else (force - goal, curve.decay)
        _slip_derivatives(figures, state, i, curve, unit * scale, away, keep)
        for c in range(knot + 2):  # later knots are not felt yet
            state.by_knots[i, c] *= keep
        for c in range(state.by_start.shape[1]):
            state.by_start[i, c] *= keep
        by_level = goal / (1.0 + w) * (1.0 - keep)
        state.by_knots[i, knot] += by_level * (1.0 - after)
        state.by_knots[i, knot + 1] += by_level * after
        state.forces[i] = goal + away * curve.decay
    return all_slip


@kernel()
def _evaluate_curve(figures, speed, dt):  # type: ignore[no-untyped-def]
    """The Stribeck curve at `speed` > 0 [m/s] and the decay over `dt` [s]."""
    ratio = speed / figures.stribeck_velocity
    power = ratio**figures.stribeck_shape
    rise = math.exp(-power)
    value = 1.0 + figures.alpha * rise
    decay = math.exp(-figures.rate * dt / value)
    return _Curve(
        value,
        rise,
        figures.alpha * rise * figures.stribeck_shape * power / figures.stribeck_velocity,
        -figures.alpha * rise * power * math.log(ratio),
        decay,
        decay * figures.rate * dt / value**2,
        -decay * dt / value,
    )


@kernel()
def _slip_derivatives(figures, state, i, curve, limit, away, keep):  # type: ignore[no-untyped-def]
    """Derivatives of element `i` by the figures, after a step in which it slips.

    `limit`: signed, at s(v) = 1 [N]; `away`: from where it slides to, before the step [N]; `keep`:
    share of that left after the step.
    """
    by, goal = state.by_figures, limit * curve.value
    direction = math.copysign(1.0, limit)
    for c in range(by.shape[1]):
        by[i, c] *= keep
    left = 1.0 - keep
    by[i, BY_COULOMB] += left * goal / figures.coulomb
    by[i, BY_ASYMMETRY] += left * direction * goal / (1.0 + figures.asymmetry * direction)
    by[i, BY_SHARE] += left * goal / figures.shares[i]
    by[i, BY_RATE] += away * curve.decay_by_rate
    by_curve = left * limit + away * curve.decay_by_curve
    by[i, BY_ALPHA] += by_curve * curve.by_alpha
    by[i, BY_VS] += by_curve * curve.by_vs
    by[i, BY_DELTA] += by_curve * curve.by_delta


@kernel()
def _add_up(state, prediction, k):  # type: ignore[no-untyped-def]
    """Force and derivatives of all elements together, at sample `k`."""
    force = 0.0
    prediction.by_figures[k, :] = 0.0
    prediction.by_knots[k, :] = 0.0
    prediction.by_start[k, :] = 0.0
    for i in range(state.forces.shape[0]):
        force += state.forces[i]
        for c in range(prediction.by_figures.shape[1]):
            prediction.by_figures[k, c] += state.by_figures[i, c]
        for c in range(state.by_knots.shape[1]):
            prediction.by_knots[k, c] += state.by_knots[i, c]
        for c in range(state.by_start.shape[1]):
            prediction.by_start[k, c] += state.by_start[i, c]
        prediction.by_springs[k, i] = state.by_figures[i, BY_SPRING]
        prediction.by_shares[k, i] = state.by_figures[i, BY_SHARE]
    prediction.force[k] = force
