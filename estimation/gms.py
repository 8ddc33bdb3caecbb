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


@numba.njit(cache=True)
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


@numba.njit(cache=True)
def follow_positions(  # type: ignore[no-untyped-def]
    p, shares, forces, slipping, memory, position, velocity, period, substeps, band,
    force, jacobian, d_coulomb, d_stiffness, d_rate,
):  # fmt: skip
    """Drive the elements through sampled positions; see `follow`, which calls it.

    `p` is `Friction.vector()`; d_coulomb, d_stiffness, d_rate are dF_i by Fc, sigma0 and C/Fc.
    """
    count = shares.shape[0]
    coulomb, alpha, vs, delta, rate = p[COULOMB], p[ALPHA], p[VS], p[DELTA], p[RATE]
    stiffness = p[STIFFNESS] / count
    dt = period / substeps
    total = forces.sum()
    by_coulomb = d_coulomb.sum()
    by_stiffness = d_stiffness.sum()
    by_rate = d_rate.sum()
    for k in range(position.shape[0]):
        moved = position[k] - memory[1]
        if abs(moved) > band:
            memory[1] = position[k]
            v1 = velocity[k]
            v0 = velocity[k - 1] if k > 0 else v1
            # Linear velocity inside the sample, shifted so that it covers the distance moved.
            shift = moved / period - 0.5 * (v0 + v1)
            for j in range(substeps):
                v = v0 + (v1 - v0) * (j + 0.5) / substeps + shift
                dx = v * dt
                if dx == 0.0:
                    continue
                direction = math.copysign(1.0, dx)
                if direction != memory[0]:
                    memory[0] = direction
                    for i in range(count):
                        slipping[i] = False
                ratio = abs(v) / vs
                if delta != 1.0:
                    ratio = ratio**delta
                curve = 1.0 + alpha * math.exp(-ratio)
                decay = math.exp(-rate * dt / curve)
                total = 0.0
                by_coulomb = 0.0
                by_stiffness = 0.0
                by_rate = 0.0
                for i in range(count):
                    limit = shares[i] * curve
                    f = forces[i]
                    if not slipping[i]:
                        stretched = f + stiffness * dx
                        if stretched * direction >= limit * coulomb:
                            slipping[i] = True
                            if f * direction < limit * coulomb:
                                f = direction * limit * coulomb
                                d_coulomb[i] = direction * limit
                                d_stiffness[i] = 0.0
                                d_rate[i] = 0.0
                        else:
                            f = stretched
                            d_stiffness[i] += dx / count
                    if slipping[i]:
                        goal = direction * limit
                        away = (f - goal * coulomb) * decay
                        f = goal * coulomb + away
                        d_rate[i] = d_rate[i] * decay - away * dt / curve
                        d_coulomb[i] = goal + (d_coulomb[i] - goal) * decay
                        d_stiffness[i] *= decay
                    forces[i] = f
                    total += f
                    by_coulomb += d_coulomb[i]
                    by_stiffness += d_stiffness[i]
                    by_rate += d_rate[i]
        force[k] = total
        jacobian[k, 0] = by_coulomb
        jacobian[k, 1] = by_stiffness
        jacobian[k, 2] = by_rate


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
    none = np.zeros(friction.elements)
    follow_positions(
        friction.vector(), element_shares(friction.elements), state.forces, state.slipping,
        state.memory, np.ascontiguousarray(position), np.ascontiguousarray(velocity), period,
        substeps, band, force, jacobian, none, none.copy(), none.copy(),
    )  # fmt: skip
    return force, jacobian
