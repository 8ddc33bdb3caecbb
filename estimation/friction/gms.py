"""Generalized Maxwell-slip friction for estimation and feedforward, with forward sensitivities.

Driven by positions, not velocities; the law and its steps: `elements`.

The relaxation rate C/Fc is a parameter, C follows from it: the rate is what stays when Fc changes.
Viscous friction sigma_v v is linear and added by whoever uses the element forces.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from estimation.compiled import kernel
from estimation.friction.elements import (
    BY_COULOMB,
    BY_RATE,
    BY_STIFFNESS,
    ELEMENT_ROWS,
    FORCE,
    SHARES,
    SLIPS,
    correct_forces,
    step_elements,
    stribeck_rise,
    sum_elements,
)

F64 = NDArray[np.float64]

MAX_ELEMENTS = 64
REST_BAND = 4e-9
"""Displacement below which the axis counts as at rest: a few times the encoder noise [m]."""

FAR_ABOVE = 12.0
"""exp(-12) of the Stribeck rise is left: far below any sensor."""
NO_SUBSTEPS = 4.0
"""Above so many Stribeck velocities the curve is straight enough inside a sample."""

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
        correct_forces(self.forces, element_shares(friction.elements).copy(), static, total)


@kernel()
def follow_positions(  # type: ignore[no-untyped-def]
    p, levels, shares, forces, slipping, memory, position, velocity, period, substeps, band,
    force, jacobian,
):  # fmt: skip
    """Drive the elements through sampled positions; see `follow`, which calls it.

    `levels`: Coulomb force of each sample [N], shape (K,); or of all, shape (1,).
    """
    n = shares.shape[0]
    alpha, vs, delta, rate = p[ALPHA], p[VS], p[DELTA], p[RATE]
    coulomb = levels[0]
    stiffness = p[STIFFNESS] / n
    elements = np.zeros((ELEMENT_ROWS, n + 1))
    for i in range(n):
        elements[FORCE, i], elements[SHARES, i] = forces[i], shares[i]
        elements[SLIPS, i] = 1.0 if slipping[i] else 0.0
    elements[SHARES, n] = -1.0
    stuck = sum_elements(elements)
    direction, reference = memory[0], memory[1]
    fast = vs * FAR_ABOVE ** (1.0 / delta)
    fast_decay = math.exp(-rate * period)
    v0 = velocity[0]
    for k in range(position.shape[0]):
        moved, v1 = position[k] - reference, velocity[k]
        if levels.shape[0] > 1:
            coulomb = levels[k]
        if abs(moved) > band:
            reference = position[k]
            slowest = min(v0 * direction, v1 * direction)
            if stuck == 0 and slowest > fast and moved * direction > 0.0:
                step_elements(
                    moved, direction, 0.0, fast_decay, period, coulomb, stiffness, rate, alpha,
                    elements,
                )  # fmt: skip
            else:
                # The velocity is linear, shifted so that it covers the distance moved.
                steps = 1 if slowest > NO_SUBSTEPS * vs else substeps
                dt = period / steps
                shift = moved / period - 0.5 * (v0 + v1)
                if elements[SHARES, n] < 0.0:
                    elements[SHARES, n] = stribeck_rise(abs(v0) / vs, delta)
                for j in range(steps):
                    v = v0 + (v1 - v0) * (j + 0.5) / steps + shift
                    if v == 0.0:
                        continue
                    if v * direction <= 0.0:
                        direction = math.copysign(1.0, v)
                        for i in range(n):
                            elements[SLIPS, i] = 0.0
                    rise = stribeck_rise(abs(v) / vs, delta)
                    step_elements(
                        v * dt, direction, rise, math.exp(-rate * dt / (1.0 + alpha * rise)), dt,
                        coulomb, stiffness, rate, alpha, elements,
                    )  # fmt: skip
            stuck = sum_elements(elements)
        force[k] = elements[FORCE, n]
        jacobian[k, 0] = elements[BY_COULOMB, n]
        jacobian[k, 1] = elements[BY_STIFFNESS, n]
        jacobian[k, 2] = elements[BY_RATE, n]
        v0 = v1
    for i in range(n):
        forces[i], slipping[i] = elements[FORCE, i], elements[SLIPS, i] > 0.0
    memory[0], memory[1] = direction, reference


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
        friction.vector(), np.array([friction.coulomb]), element_shares(friction.elements),
        state.forces, state.slipping, state.memory,
        np.ascontiguousarray(position), np.ascontiguousarray(velocity), period, substeps, band,
        force, jacobian,
    )  # fmt: skip
    return force, jacobian
