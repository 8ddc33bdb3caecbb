"""Known forces along a path, with what they remember: hysteresis of cables, swing of the base.

A base of mass M = m / ratio on isolators takes the reaction of the net force on the carriage. With
b its position, a the carriage's acceleration relative to it and all positions relative to it,

    m (a + b'') = net,   b'' = -(w^2 b + 2 z w b' + ratio (a + b'')),

so m b'' is a force to be made up for besides m a. Several bases add their b''. Between samples a is
taken to be linear, for which the step is exact.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from estimation.known_effects.terms import KnownTerms
from stagedata import F64, FrictionFigures
from stagedata.compiled import kernel


class Path(NamedTuple):
    """Motion of an axis, each of shape (K,): position [m], velocity and acceleration (SI).

    `across` is the acceleration of the other axis.
    """

    position: F64
    velocity: F64
    acceleration: F64
    across: F64


@dataclass(slots=True)
class ForceState:
    """Internal state of the known forces.

    Attributes:
        pulls: force of each hysteretic element [N], shape (n,).
        place: position up to which they have been taken [m], shape (1,); nan: nowhere yet.
        sway: position and velocity of each base, then the last acceleration of the axis (SI),
            shape (2 bases + 1,).
    """

    pulls: F64
    place: F64
    sway: F64

    def copy(self) -> ForceState:
        """An independent copy."""
        return ForceState(self.pulls.copy(), self.place.copy(), self.sway.copy())


class KnownForces:
    """Known disturbance forces of one axis.

    Args:
        terms: of the axis.
        mass: moved, the known addition included [kg].
        friction: figures of the machine file, which effects relative to friction refer to.
        period: of the samples of a path [s].
    """

    def __init__(
        self, terms: KnownTerms, mass: float, friction: FrictionFigures, period: float
    ) -> None:
        self._terms, self._mass, self._period = terms, mass, period
        self._friction = replace(friction, viscous=friction.viscous * terms.viscous)
        self._limits = np.array([force for force, _ in terms.hysteresis], np.float64)
        self._stiffness = np.array([stiffness for _, stiffness in terms.hysteresis], np.float64)
        self._flow, self._readout = _base_dynamics(terms)
        nothing = np.zeros(0)
        self._step: tuple[F64, F64, F64] = (np.zeros((0, 0)), nothing, nothing)
        if terms.bases:
            self._step = self._transition(period)

    def at_start(self) -> ForceState:
        """Relaxed, at rest at position 0."""
        bases = len(self._terms.bases)
        return ForceState(
            np.zeros(len(self._limits)), np.array([math.nan]), np.zeros(2 * bases + 1)
        )

    def along(self, path: Path, state: ForceState) -> F64:
        """Force at each sample of a path [N], shape (K,); `state`, before it, is advanced."""
        terms = self._terms
        force = terms.coupled_mass * path.across
        for curve in terms.forces:
            force = force + curve(path.position)
        for curve in terms.velocity_forces:
            force = force + curve(path.velocity)
        for friction_curve in terms.friction_forces:
            force = force + friction_curve(path.velocity, self._friction)
        if len(self._limits):
            pull = np.empty(len(path.position))
            _drag(np.ascontiguousarray(path.position), self._limits, self._stiffness, state.pulls,
                  state.place, pull)  # fmt: skip
            force = force + pull
        if terms.bases:
            force = force + self._swing(path.acceleration, state)
        return np.asarray(force)

    def rest(self, state: ForceState, duration: float) -> None:
        """Advance `state` by `duration` [s], the axis at rest."""
        if self._terms.bases:
            state.sway[-1] = 0.0
            state.sway[:-1] = self._transition(duration)[0] @ state.sway[:-1]

    def sway(self, state: ForceState) -> float:
        """Present force of the bases [N]."""
        return float(self._mass * (self._readout @ state.sway))

    def sway_at_rest(self, state: ForceState, count: int) -> F64:
        """Force of the bases at the next samples, the axis at rest [N], (count,); advances."""
        return self._swing(np.zeros(count), state)

    def _swing(self, acceleration: F64, state: ForceState) -> F64:
        """Force of the bases under accelerations [m/s^2] at the next samples [N]; advances."""
        matrix, first, second = self._step
        force = np.empty(len(acceleration))
        _swing(
            np.ascontiguousarray(acceleration), matrix, first, second, self._readout, state.sway,
            force,
        )  # fmt: skip
        return self._mass * force

    def _transition(self, time: float) -> tuple[F64, F64, F64]:
        """State after `time` [s]: matrix, and what the accelerations at both ends add to it.

        Shapes (2n, 2n), (2n,), (2n,).
        """
        from scipy.linalg import expm

        size = len(self._flow)
        whole = np.zeros((size + 1, size + 1))
        whole[:size, :size], whole[:size, size] = self._flow[:, :size], self._flow[:, size]
        # Acceleration a0 + (a1 - a0) t / time: two more states, the ramp and its slope.
        ramp = np.zeros((size + 2, size + 2))
        ramp[: size + 1, : size + 1] = whole
        ramp[size, size + 1] = 1.0 / time if time > 0.0 else 0.0
        grown = expm(ramp * time)
        first, second = grown[:size, size], grown[:size, size + 1]
        return (
            np.ascontiguousarray(grown[:size, :size]),
            np.ascontiguousarray(first - second),
            np.ascontiguousarray(second),
        )


def _base_dynamics(terms: KnownTerms) -> tuple[F64, F64]:
    """Rates of the bases' positions and velocities, and their summed acceleration.

    Both linear in (b1, b1', b2, b2', ..., a): shapes (2n, 2n + 1) and (2n + 1,).
    """
    count = len(terms.bases)
    pull = np.zeros((count, 2 * count + 1))
    ratio = np.array([base.mass_ratio for base in terms.bases], np.float64)
    for i, base in enumerate(terms.bases):
        rate = 2.0 * math.pi * base.frequency
        pull[i, 2 * i], pull[i, 2 * i + 1] = rate**2, 2.0 * base.damping * rate
    pull[:, -1] = ratio
    total = -pull.sum(axis=0) / (1.0 + ratio.sum())
    flow = np.zeros((2 * count, 2 * count + 1))
    for i in range(count):
        flow[2 * i, 2 * i + 1] = 1.0
        flow[2 * i + 1] = -pull[i] - ratio[i] * total
    return flow, total


@kernel()
def _drag(position, limits, stiffness, pulls, place, force):  # type: ignore[no-untyped-def]
    """Hysteretic elements along positions [m], shape (K,): writes the sum of their forces [N]."""
    if math.isnan(place[0]):
        place[0] = position[0]
    for k in range(position.shape[0]):
        moved, total = position[k] - place[0], 0.0
        place[0] = position[k]
        for i in range(limits.shape[0]):
            pulls[i] = min(max(pulls[i] + stiffness[i] * moved, -limits[i]), limits[i])
            total += pulls[i]
        force[k] = total


@kernel()
def _swing(acceleration, matrix, first, second, readout, sway, result):  # type: ignore[no-untyped-def]
    """Bases under accelerations [m/s^2], shape (K,): writes the sum of theirs, shape (K,)."""
    size = matrix.shape[0]
    after = np.empty(size)
    for k in range(acceleration.shape[0]):
        before = sway[size]
        for i in range(size):
            after[i] = first[i] * before + second[i] * acceleration[k]
            for j in range(size):
                after[i] += matrix[i, j] * sway[j]
        total = readout[size] * acceleration[k]
        for i in range(size):
            sway[i] = after[i]
            total += readout[i] * after[i]
        sway[size] = acceleration[k]
        result[k] = total
