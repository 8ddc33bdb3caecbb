"""What the machine file's effects mean for the moves of one axis.

`estimation.known_effects` knows forces, factors and friction along a path. This carries their state
from move to move along the measured positions, predicts them along the coming demand, and takes
them from what is measured before anything is learned from it. In which order:

    plan -> friction_at_rest -> offsets -> (revised) -> hold ... -> without -> carry
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimation.known_effects import (
    F64,
    KnownForces,
    KnownTerms,
    Path,
    coulomb_factor,
    delivered_force,
    directions,
    force_to_demand,
)
from estimation.move import MoveData
from estimation.trajectory import Trajectory
from stagectl.config.machine import Axis

SAMPLES_BEFORE_MOVE = 2
"""Samples at rest at the start of a move's record; they end the record before it, too."""
REST_SAMPLES = 5
"""The force at rest is the mean of this many samples."""
UNIFORM = 3e-3
"""Largest relative change of the Coulomb force along a move at which it counts as constant; its own
wander is larger."""


class KnownAxis:
    """Known effects along the moves of one axis.

    Args:
        terms: what is known.
        number: of the axis, in arrays of positions.
        axis: with what is known of it.
        period: Ts [s].

    Attributes:
        terms: as above.
        peak: largest force of the drive [N].
        local: factor on Fc where the last move ends, mean of both directions.
        varies: whether the factor differs along that move, or between its directions.
    """

    def __init__(self, terms: KnownTerms, number: int, axis: Axis, period: float) -> None:
        self.terms, self.peak = terms, axis.drive.peak_force
        self._own, self._other = number, -1 - number
        plant = axis.plant
        self._forces = KnownForces(terms, plant.mass, plant.friction.figures, period)
        self._period = period
        # From the last sample before a move to the demand's time 0.
        self._lead = period - axis.drive.control_period
        self.local = 1.0
        self.varies = False
        self.forget()

    def forget(self) -> None:
        """Start again from relaxed effects: the axis has moved unobserved."""
        self._before = self._now = self._forces.at_start()
        self._at_rest: float | None = None
        self._demanded = np.zeros(1)
        self._planned = np.zeros(1)
        self._held = self._forces.at_start()
        self._end = 0.0

    def compile_kernels(self) -> None:
        """Run the compiled kernels once, before anything moves."""
        path = np.zeros((3, 2))
        self._forces.along(self._path(path), self._forces.at_start())
        directions(path[:, 0])

    def plan(
        self, motion: Trajectory, across: Trajectory | None, samples: int, ahead: float
    ) -> None:
        """Predict the known forces of a move.

        Args:
            motion: demand of this axis.
            across: demand of the other axis.
            samples: number of setpoints.
            ahead: how much earlier than its effect a force is sent [s].
        """
        time = np.asarray(np.arange(samples + 1) * self._period + ahead, np.float64)
        time[0] = 0.0  # at rest, whatever the drive's lag
        position, velocity, acceleration = motion.sample(time)
        other = np.zeros(samples + 1) if across is None else across.sample(time)[2]
        acceleration[0] = other[0] = 0.0
        state = self._now.copy()
        self._forces.rest(state, max(self._lead + ahead - self._period, 0.0))
        self._demanded = position
        self._planned = self._forces.along(Path(position, velocity, acceleration, other), state)
        self._held = state

    def friction_at_rest(self, force: float, position: float) -> float:
        """The part of a force measured at rest that is friction [N].

        Args:
            force: mean of the last samples [N].
            position: of the axis [m].
        """
        if self._at_rest is None:
            zero = np.zeros(1)
            here = Path(np.array([position]), zero, zero, zero)
            self._at_rest = float(self._forces.along(here, self._now.copy())[0])
        carried = delivered_force(self.terms, np.array([force]), np.array([position]))
        return float(carried[0]) - self._at_rest

    def offsets(self, start: float, change: F64, sent: int = 0) -> F64:
        """Change of the force offset since setpoint `sent` [N], shape (K - sent,).

        Args:
            start: force on the carriage at that setpoint, without known forces [N].
            change: of it since, at every setpoint after it [N], shape (K - sent,).
            sent: setpoints 1..sent are gone; 0: at rest before the move.
        """
        known = self._planned[sent:]
        self._end = start + float(change[-1]) + float(known[-1])
        if not self.terms.has_motor_factor:
            both: F64 = change + (known[1:] - known[0])
            return both
        demand = self._to_demand(np.append(start, start + change) + known, self._demanded[sent:])
        return np.asarray(demand[1:] - demand[0])

    def hold(self, count: int) -> F64:
        """Change of the force offset since the last setpoint, at rest behind a move [N], (count,).

        Other than 0 only where a base still swings.
        """
        if not self.terms.bases:
            return np.zeros(count)
        before = self._forces.sway(self._held)
        sway = self._forces.sway_at_rest(self._held.copy(), count)
        force = self._end + np.append(0.0, sway - before)
        demand = self._to_demand(force, self._demanded[-1:])
        return np.asarray(demand[1:] - demand[0])

    def held(self, count: int) -> None:
        """Note that this many setpoints of `hold` have been sent."""
        if self.terms.bases and count:
            before = self._forces.sway(self._held)
            self._end += float(self._forces.sway_at_rest(self._held, count)[-1]) - before

    def without(self, record: MoveData, path: F64, seen: NDArray[np.bool_]) -> MoveData:
        """A move's record as if there were nothing but mass and friction.

        Saturated samples are marked as disturbed. So are those where the other axis has no valid
        sample nearby, if its acceleration makes a force on this one.

        Args:
            record: as measured.
            path: positions of all axes [m], shape (M, n).
            seen: where the other axis has a valid sample, shape (M,).
        """
        terms = self.terms
        known = self._forces.along(self._path(path), self._before.copy())
        disturbed = np.abs(record.force) >= self.peak
        if terms.coupled_mass:
            disturbed |= np.convolve(~seen, np.ones(3), "same") > 0.0
        if record.disturbed is not None:
            disturbed |= record.disturbed
        position = path[:, self._own]
        return MoveData(
            record.position,
            delivered_force(terms, record.force, position) - known,
            record.valid,
            record.time,
            self.friction_at_rest(record.rest_force, float(position[0])),
            disturbed if disturbed.any() else None,
        )

    def carry(self, path: F64) -> None:
        """Carry the state through a move and the rest behind it; `path` as in `without`."""
        motion = self._path(path)
        last = max(len(path) - SAMPLES_BEFORE_MOVE, 0)
        state = self._before
        early = self._forces.along(Path(*(part[:last] for part in motion)), state)
        self._now = state.copy()
        late = self._forces.along(Path(*(part[last:] for part in motion)), self._now)
        self._at_rest = float(np.concatenate((early, late))[-REST_SAMPLES:].mean())

    def meet_coulomb(self, demand: F64, time: float) -> float:
        """Factor on Fc where a move ends, mean of both directions; `variation` is relative to it.

        Args:
            demand: setpoints of all axes [m], shape (K, n).
            time: of the rest before the move [s].
        """
        moments = np.asarray(time + np.arange(len(demand)) * self._period, np.float64)
        factor = self._coulomb(demand, moments, None)
        self.local = float(factor[-1])
        change = float(np.abs(factor / self.local - 1.0).max())
        self.varies = change > UNIFORM or self.terms.forward != self.terms.backward
        return self.local

    def variation(self, other: F64 | None, path: F64, time: F64) -> F64 | None:
        """Fc along a path relative to that where the move ends, minus 1, shape (K,), or None.

        Args:
            other: the same of what is not known from effects; None: nothing.
            path: positions of all axes [m], shape (K, n).
            time: of the stage [s], shape (K,).
        """
        if not self.varies:
            return other
        factor = self._coulomb(path, time, directions(path[:, self._own])) / self.local
        return factor - 1.0 if other is None else factor * (1.0 + other) - 1.0

    def _coulomb(self, path: F64, time: F64, heading: F64 | None) -> F64:
        own, other = path[:, self._own], path[:, self._other]
        return coulomb_factor(self.terms, own, other, time, heading)

    def _to_demand(self, force: F64, position: F64) -> F64:
        return np.clip(force_to_demand(self.terms, force, position), -self.peak, self.peak)

    def _path(self, path: F64) -> Path:
        """Motion of an axis from positions of all at the samples."""
        own = path[:, self._own]
        if len(own) < 3:
            still = np.zeros(len(own))
            return Path(own, still, still, still)
        across = self._bend(path[:, self._other]) if self.terms.coupled_mass else np.zeros(len(own))
        speed = np.asarray(np.gradient(own, self._period), np.float64)
        return Path(own, speed, self._bend(own), across)

    def _bend(self, position: F64) -> F64:
        """Acceleration at the samples [m/s^2]; at the ends, at rest, 0."""
        result = np.zeros(len(position))
        result[1:-1] = np.diff(position, 2) / self._period**2
        return result
