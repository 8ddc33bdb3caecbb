"""Jerk-limited setpoints from one state to another at rest; arrays in, arrays out.

The time-optimal profile of each axis comes from ruckig (state to state only; intermediate waypoints
would go to a network service and are never given). Sampled here by its pieces of constant jerk.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import ruckig

from stagedata import F64

_PLANNER = ruckig.Ruckig(1)


@dataclass(frozen=True, slots=True)
class Limits:
    """Largest velocity [m/s], acceleration [m/s^2] and jerk [m/s^3]."""

    velocity: float
    acceleration: float
    jerk: float

    def __post_init__(self) -> None:
        for name in ("velocity", "acceleration", "jerk"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"{name}: must be > 0, is {value!r}")


@dataclass(frozen=True, slots=True)
class Trajectory:
    """A motion of one axis: pieces of constant jerk, then rest at `target`.

    Attributes:
        start: beginning of each piece [s], shape (n,).
        position, velocity, acceleration, jerk: at the beginning of each piece [m, m/s, ...].
        duration: time until rest [s].
        target: position then [m].
    """

    start: F64
    position: F64
    velocity: F64
    acceleration: F64
    jerk: F64
    duration: float
    target: float

    def sample(self, time: F64) -> tuple[F64, F64, F64]:
        """Position [m], velocity [m/s] and acceleration [m/s^2] at `time` [s], same shape.

        Before 0 the first state holds still, after the end the target does.
        """
        from estimation.trajectory_samples import sample_pieces  # a plan alone needs no compiler

        time = np.asarray(time, dtype=np.float64)
        position, velocity, acceleration = np.empty((3, time.size))
        pieces = self.start, self.position, self.velocity, self.acceleration, self.jerk
        sample_pieces(
            pieces, self.duration, self.target, time.ravel(), position, velocity, acceleration
        )
        shape = time.shape
        return position.reshape(shape), velocity.reshape(shape), acceleration.reshape(shape)


def plan(start: float, target: float, limits: Limits) -> Trajectory:
    """The fastest motion from rest to rest at `target` [m].

    Args:
        start: position [m].
        target: position to come to rest at [m].
        limits: of the motion.

    Raises:
        ValueError: not finite, or no such motion.
    """
    return _solve(ruckig.ControlInterface.Position, start, 0.0, 0.0, target, limits)


def plan_stop(position: float, velocity: float, acceleration: float, limits: Limits) -> Trajectory:
    """The fastest motion from a moving state to rest, wherever that is."""
    return _solve(
        ruckig.ControlInterface.Velocity, position, velocity, acceleration, position, limits
    )


def duration(distance: float, velocity: float, acceleration: float, jerk: float) -> float:
    """Time of a motion from rest to rest over `distance` [m], in s."""
    return plan(0.0, distance, Limits(velocity, acceleration, jerk)).duration


def _solve(  # type: ignore[no-untyped-def]
    interface, start: float, velocity: float, acceleration: float, target: float, limits: Limits
) -> Trajectory:
    if not all(map(math.isfinite, (start, velocity, acceleration, target))):
        raise ValueError(f"a motion from {start!r} m to {target!r} m is not finite")
    # Positions are handed over relative to the start: best resolution for nanometre moves.
    request = ruckig.InputParameter(1)
    request.control_interface = interface
    request.current_position = [0.0]
    request.current_velocity = [velocity]
    request.current_acceleration = [acceleration]
    request.target_position = [target - start]
    request.target_velocity = [0.0]
    request.target_acceleration = [0.0]
    request.max_velocity = [limits.velocity]
    request.max_acceleration = [limits.acceleration]
    request.max_jerk = [limits.jerk]
    found = ruckig.Trajectory(1)
    result = _PLANNER.calculate(request, found)
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise ValueError(f"no motion from {start!r} m to {target!r} m: {result.name}")
    profile = found.profiles[0][0]
    times = [*profile.brake.t, *profile.t]
    jerks = [*profile.brake.j, *profile.j]
    pieces = []
    now, x, v, a = 0.0, 0.0, velocity, acceleration
    for t, j in zip(times, jerks, strict=True):
        if t <= 0.0:
            continue
        pieces.append((now, x, v, a, j))
        x += t * (v + t * (a / 2 + t * j / 6))
        v += t * (a + t * j / 2)
        a += t * j
        now += t
    if not pieces:
        pieces.append((0.0, 0.0, 0.0, 0.0, 0.0))
    at = np.array(pieces).T.copy()
    end = target if interface == ruckig.ControlInterface.Position else start + x
    return Trajectory(at[0], start + at[1], at[2], at[3], at[4], now, end)
