"""Generalized Maxwell-slip friction for estimation and feedforward, with forward sensitivities.

Driven by positions, not velocities: a sticking element stretches with the displacement itself, a
slipping one relaxes by the exact exponential of its law, and an element that reaches its limit
inside a step lands on it (research on the source paper's equations (1) to (3), consistent signs):

    stick:  dF_i = k_i sigma0 dx,  until sgn(v) F_i >= nu_i s(v) Fc
    slip, until v changes sign:  F_i <- G + (F_i - G) exp(-rate dt/s(v)),  G = sgn(v) nu_i s(v) Fc
    s(v) = 1 + alpha exp(-|v/vs|^delta);  k_i = 1/N;  nu_i = 2i/(N(N+1));  rate = C/Fc

The relaxation rate C/Fc is a parameter, C follows from it: the rate is what stays when Fc changes.
Viscous friction sigma_v v is linear and added by whoever uses the element forces.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cache

import numba
import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

MAX_ELEMENTS = 64
REST_BAND = 4e-9
"""Displacement below which the axis counts as at rest: a few times the encoder noise [m]."""

# exp(-12) of the Stribeck rise is left: far below any sensor.
_FAR_ABOVE = 12.0
# Above so many Stribeck velocities the curve is straight enough inside a sample.
_NO_SUBSTEPS = 4.0
# Rows of the kernels' array of elements, and its scalars behind the model's vector.
E_SHARE, E_FORCE, E_SLIP, E_BY_COULOMB, E_BY_STIFFNESS, E_BY_RATE = range(6)
ELEMENT_ROWS = 6
S_DIRECTION, S_REFERENCE, S_OWED_DECAY, S_OWED_TIME, S_FAST_DECAY, S_FAST_SPEED = range(6, 12)
S_ALL_SLIP, S_TOTAL, S_BY_COULOMB, S_BY_STIFFNESS, S_BY_RATE = range(12, 17)
SCALARS = 17

# Order of a friction model's figures in the vector that the kernels take.
COULOMB, STIFFNESS, ALPHA, VS, DELTA, RATE = range(6)


@dataclass(frozen=True, slots=True)
class Friction:
    """Parameters of one axis' friction.

    Attributes:
        elements: number N of Maxwell-slip elements, 1..64.
        coulomb: Fc [N].
        viscous: sigma_v [N s/m].
        stiffness: sigma0, initial presliding stiffness [N/m].
        relaxation_rate: C/Fc [1/s].
        static_ratio: alpha = (Fs - Fc)/Fc, > -1.
        stribeck_velocity: vs [m/s].
        stribeck_shape: delta.

    Raises:
        ValueError: a figure outside its range, named.
    """

    elements: int
    coulomb: float
    viscous: float
    stiffness: float
    relaxation_rate: float
    static_ratio: float
    stribeck_velocity: float
    stribeck_shape: float

    def __post_init__(self) -> None:
        if not 1 <= self.elements <= MAX_ELEMENTS:
            raise ValueError(f"elements: must be 1..{MAX_ELEMENTS}, is {self.elements}")
        for name in (
            "coulomb", "stiffness", "relaxation_rate", "stribeck_velocity", "stribeck_shape",
        ):  # fmt: skip
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"{name}: must be > 0, is {value!r}")
        if not (math.isfinite(self.viscous) and self.viscous >= 0):
            raise ValueError(f"viscous: must be >= 0, is {self.viscous!r}")
        if not (math.isfinite(self.static_ratio) and self.static_ratio > -1):
            raise ValueError(f"static_ratio: must be > -1, is {self.static_ratio!r}")

    @property
    def attraction(self) -> float:
        """C [N/s]."""
        return self.relaxation_rate * self.coulomb

    @property
    def breakaway_travel(self) -> float:
        """Displacement from relaxed to all elements slipping, at most [m]."""
        largest = 2.0 / (self.elements + 1)
        return largest * (1.0 + self.static_ratio) * self.coulomb * self.elements / self.stiffness

    def scaled(self, factor: float) -> Friction:
        """Coulomb, viscous, stiffness and attraction figures times `factor` (C/Fc stays)."""
        return replace(
            self,
            coulomb=self.coulomb * factor,
            viscous=self.viscous * factor,
            stiffness=self.stiffness * factor,
        )

    def vector(self) -> F64:
        """The figures as the kernels take them, shape (6,)."""
        return np.array(
            [
                self.coulomb,
                self.stiffness,
                self.static_ratio,
                self.stribeck_velocity,
                self.stribeck_shape,
                self.relaxation_rate,
            ]
        )


@cache
def element_shares(elements: int) -> F64:
    """nu_i = 2i/(N(N+1)), i = 1..N: each element's share in the Coulomb force; read-only."""
    shares: F64 = 2.0 * np.arange(1, elements + 1) / (elements * (elements + 1))
    shares.flags.writeable = False
    return shares


@dataclass(slots=True)
class FrictionState:
    """What an axis' friction remembers; changed in place as the axis moves.

    Attributes:
        forces: F_i [N], shape (N,).
        slipping: which elements slip, shape (N,).
        memory: [direction of motion (+1, -1, 0), position up to which motion was taken [m]].
    """

    forces: F64
    slipping: NDArray[np.bool_]
    memory: F64 = field(default_factory=lambda: np.zeros(2))

    @classmethod
    def relaxed(cls, elements: int, position: float = 0.0) -> FrictionState:
        """No force in any element, at rest at `position` [m]."""
        return cls(
            np.zeros(elements), np.zeros(elements, dtype=np.bool_), np.array([0.0, position])
        )

    @property
    def total(self) -> float:
        """Sum of the element forces [N]."""
        return float(self.forces.sum())

    def copy(self) -> FrictionState:
        """An independent copy."""
        return FrictionState(self.forces.copy(), self.slipping.copy(), self.memory.copy())

    def settle_at(self, position: float) -> None:
        """Take `position` [m] as where the axis rests now; the forces stay."""
        self.memory[1] = position

    def rescale(self, factor: float) -> None:
        """Carry the state over to a model whose Coulomb force is `factor` times the old one's."""
        self.forces *= factor

    def correct(self, total: float, friction: Friction) -> None:
        """Make the element forces add up to `total` [N], the force measured at rest.

        The difference is spread evenly, as an unseen displacement would, but no element passes
        its static limit; what no element can take is left out.
        """
        static = friction.coulomb * (1.0 + friction.static_ratio)
        correct_forces(self.forces, element_shares(friction.elements), static, total)


@numba.njit(cache=True, error_model="numpy")
def correct_forces(forces, shares, static, total):  # type: ignore[no-untyped-def]
    """Spread what is missing to `total` over the elements that are not at their limit."""
    count = forces.shape[0]
    for i in range(count):
        limit = shares[i] * static
        forces[i] = min(max(forces[i], -limit), limit)
    for _ in range(count):
        missing = total - forces.sum()
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


@numba.njit(cache=True, error_model="numpy")
def pack(p, shares, forces, slipping, direction, reference, period):  # type: ignore[no-untyped-def]
    """Elements and scalars of a model and its state, as two arrays: what `advance` works on.

    Few arrays, because each one that is handed to a compiled function costs a counted reference.
    `p` is `Friction.vector()`; the sensitivities start at zero.
    """
    count = shares.shape[0]
    elements = np.zeros((ELEMENT_ROWS, count))
    scalars = np.zeros(SCALARS)
    total, all_slip = 0.0, 1.0
    for i in range(count):
        elements[E_SHARE, i] = shares[i]
        elements[E_FORCE, i] = forces[i]
        elements[E_SLIP, i] = 1.0 if slipping[i] else 0.0
        total += forces[i]
        if not slipping[i]:
            all_slip = 0.0
    for i in range(6):
        scalars[i] = p[i]
    scalars[S_DIRECTION] = direction
    scalars[S_REFERENCE] = reference
    scalars[S_OWED_DECAY] = 1.0
    scalars[S_FAST_DECAY] = math.exp(-p[RATE] * period)
    scalars[S_FAST_SPEED] = p[VS] * _FAR_ABOVE ** (1.0 / p[DELTA])
    scalars[S_ALL_SLIP] = all_slip
    scalars[S_TOTAL] = total
    return elements, scalars


@numba.njit(cache=True, error_model="numpy")
def unpack(elements, scalars, forces, slipping, memory):  # type: ignore[no-untyped-def]
    """The state back out of `pack`'s arrays."""
    catch_up(elements, scalars)
    for i in range(forces.shape[0]):
        forces[i] = elements[E_FORCE, i]
        slipping[i] = elements[E_SLIP, i] > 0.0
    memory[0] = scalars[S_DIRECTION]
    memory[1] = scalars[S_REFERENCE]


@numba.njit(cache=True, error_model="numpy")
def advance(elements, scalars, position, v0, v1, period, substeps):  # type: ignore[no-untyped-def]
    """Move the elements to the next sampled position.

    `v0`, `v1`: velocity at the last sample and at this one; inside the sample it is linear, shifted
    so that it covers the distance moved. The sums over all elements are kept in `scalars`: force
    and its derivatives by Fc, sigma0 and C/Fc.

    Where all elements slip far above the Stribeck velocity they relax together: only the sums are
    advanced, and what the elements are owed is remembered (`catch_up`).
    """
    moved = position - scalars[S_REFERENCE]
    scalars[S_REFERENCE] = position
    coulomb, direction = scalars[COULOMB], scalars[S_DIRECTION]
    slowest = min(v0 * direction, v1 * direction)
    all_slip = scalars[S_ALL_SLIP] > 0.0
    if all_slip and slowest > scalars[S_FAST_SPEED] and moved * direction > 0.0:
        decay = scalars[S_FAST_DECAY]
        away = (scalars[S_TOTAL] - direction * coulomb) * decay
        scalars[S_TOTAL] = direction * coulomb + away
        scalars[S_BY_COULOMB] = direction + (scalars[S_BY_COULOMB] - direction) * decay
        scalars[S_BY_STIFFNESS] *= decay
        scalars[S_BY_RATE] = scalars[S_BY_RATE] * decay - away * period
        scalars[S_OWED_DECAY] *= decay
        scalars[S_OWED_TIME] += period
        return
    catch_up(elements, scalars)
    count = elements.shape[1]
    alpha, vs, delta, rate = scalars[ALPHA], scalars[VS], scalars[DELTA], scalars[RATE]
    if all_slip and slowest > _NO_SUBSTEPS * vs:
        substeps = 1
    share = 1.0 / count
    stiffness = scalars[STIFFNESS] * share
    dt = period / substeps
    shift = moved / period - 0.5 * (v0 + v1)
    for j in range(substeps):
        v = v0 + (v1 - v0) * (j + 0.5) / substeps + shift
        dx = v * dt
        if dx == 0.0:
            continue
        direction = math.copysign(1.0, dx)
        if direction != scalars[S_DIRECTION]:
            scalars[S_DIRECTION] = direction
            for i in range(count):
                elements[E_SLIP, i] = 0.0
        ratio = abs(v) / vs
        if delta != 1.0:
            ratio = ratio**delta
        curve = 1.0 + alpha * math.exp(-ratio)
        decay = math.exp(-rate * dt / curve)
        total = by_coulomb = by_stiffness = by_rate = 0.0
        slipping = 1.0
        for i in range(count):
            goal = direction * elements[E_SHARE, i] * curve
            f = elements[E_FORCE, i]
            if elements[E_SLIP, i] == 0.0:
                stretched = f + stiffness * dx
                if stretched * direction >= abs(goal) * coulomb:
                    elements[E_SLIP, i] = 1.0
                    if f * direction < abs(goal) * coulomb:
                        f = goal * coulomb
                        elements[E_BY_COULOMB, i] = goal
                        elements[E_BY_STIFFNESS, i] = 0.0
                        elements[E_BY_RATE, i] = 0.0
                else:
                    f = stretched
                    elements[E_BY_STIFFNESS, i] += dx * share
                    slipping = 0.0
            if elements[E_SLIP, i] > 0.0:
                away = (f - goal * coulomb) * decay
                f = goal * coulomb + away
                elements[E_BY_RATE, i] = elements[E_BY_RATE, i] * decay - away * dt / curve
                elements[E_BY_COULOMB, i] = goal + (elements[E_BY_COULOMB, i] - goal) * decay
                elements[E_BY_STIFFNESS, i] *= decay
            elements[E_FORCE, i] = f
            total += f
            by_coulomb += elements[E_BY_COULOMB, i]
            by_stiffness += elements[E_BY_STIFFNESS, i]
            by_rate += elements[E_BY_RATE, i]
        scalars[S_TOTAL] = total
        scalars[S_BY_COULOMB] = by_coulomb
        scalars[S_BY_STIFFNESS] = by_stiffness
        scalars[S_BY_RATE] = by_rate
        scalars[S_ALL_SLIP] = slipping


@numba.njit(cache=True, error_model="numpy")
def catch_up(elements, scalars):  # type: ignore[no-untyped-def]
    """Give the elements what `advance` owes them."""
    decay, time = scalars[S_OWED_DECAY], scalars[S_OWED_TIME]
    if decay == 1.0:
        return
    coulomb, direction = scalars[COULOMB], scalars[S_DIRECTION]
    for i in range(elements.shape[1]):
        goal = direction * elements[E_SHARE, i]
        away = (elements[E_FORCE, i] - goal * coulomb) * decay
        elements[E_FORCE, i] = goal * coulomb + away
        elements[E_BY_RATE, i] = elements[E_BY_RATE, i] * decay - away * time
        elements[E_BY_COULOMB, i] = goal + (elements[E_BY_COULOMB, i] - goal) * decay
        elements[E_BY_STIFFNESS, i] *= decay
    scalars[S_OWED_DECAY] = 1.0
    scalars[S_OWED_TIME] = 0.0


@numba.njit(cache=True, error_model="numpy")
def follow_positions(  # type: ignore[no-untyped-def]
    p, shares, forces, slipping, memory, position, velocity, period, substeps, band,
    force, jacobian,
):  # fmt: skip
    """Drive the elements through sampled positions; see `follow`, which calls it."""
    elements, scalars = pack(p, shares, forces, slipping, memory[0], memory[1], period)
    for k in range(position.shape[0]):
        if abs(position[k] - scalars[S_REFERENCE]) > band:
            v1 = velocity[k]
            v0 = velocity[k - 1] if k > 0 else v1
            advance(elements, scalars, position[k], v0, v1, period, substeps)
        force[k] = scalars[S_TOTAL]
        for i in range(3):
            jacobian[k, i] = scalars[S_BY_COULOMB + i]
    unpack(elements, scalars, forces, slipping, memory)


def follow(
    friction: Friction,
    state: FrictionState,
    position: F64,
    velocity: F64,
    period: float,
    substeps: int = 4,
    band: float = REST_BAND,
) -> tuple[F64, F64]:
    """Sum of the element forces along sampled positions, starting from `state`.

    Args:
        friction: the model.
        state: friction state at the sample before position[0]; advanced in place.
        position: sampled positions [m], shape (K,).
        velocity: at the same samples [m/s], shape (K,); used inside a sample only.
        period: of the samples [s].
        substeps: steps inside a sample.
        band: displacement below which nothing moves [m].

    Returns:
        force: sum of F_i at each sample [N], shape (K,).
        jacobian: its derivatives by Fc, sigma0 and C/Fc, each with the others and the start
            fixed, shape (K, 3).
    """
    force = np.empty(len(position))
    jacobian = np.empty((len(position), 3))
    follow_positions(
        friction.vector(), element_shares(friction.elements), state.forces, state.slipping,
        state.memory, np.ascontiguousarray(position), np.ascontiguousarray(velocity), period,
        substeps, band, force, jacobian,
    )  # fmt: skip
    return force, jacobian
