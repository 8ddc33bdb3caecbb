"""The drive's profile generator, for pp, pv, homing and every controlled stop.

A trapezoid of velocity from any position and velocity to rest at a target, in closed form, sampled
once per period. For a jerk-limited profile the samples pass through a moving average; its length
makes the steepest change of acceleration (from +a to -a) keep the jerk, but is at most 1 s. The
demand comes to rest exactly at the target. Successive setpoints are not blended.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

_LONGEST_SMOOTHING = 1.0  # [s]


@dataclass(frozen=True, slots=True)
class Segment:
    """Constant acceleration for `duration` [s] from `position` [m] and `velocity` [m/s]."""

    duration: float
    position: float
    velocity: float
    acceleration: float

    def at(self, t: float) -> tuple[float, float]:
        """Position and velocity `t` seconds after the segment's start."""
        return (
            self.position + (self.velocity + 0.5 * self.acceleration * t) * t,
            self.velocity + self.acceleration * t,
        )


def _chain(
    position: float, velocity: float, steps: list[tuple[float, float]]
) -> tuple[Segment, ...]:
    segments = []
    for duration, acceleration in steps:
        if duration > 0:
            segments.append(Segment(duration, position, velocity, acceleration))
            position, velocity = segments[-1].at(duration)
    return tuple(segments)


def trapezoid(
    position: float,
    velocity: float,
    target: float,
    speed: float,
    acceleration: float,
    deceleration: float,
) -> tuple[Segment, ...]:
    """Plan the fastest way to rest at `target` within the limits, from any velocity.

    Args:
        position: now [m].
        velocity: now [m/s]; above `speed` it is reduced first.
        target: [m].
        speed: > 0 [m/s].
        acceleration: > 0 [m/s^2].
        deceleration: > 0 [m/s^2].

    Returns:
        One to four segments; the last one ends at the target with velocity zero.
    """
    stop = velocity * abs(velocity) / (2 * deceleration)
    sign = 1.0 if target - position - stop >= 0 else -1.0
    v0 = sign * velocity
    distance = sign * (target - position)
    if v0 > speed:  # too fast towards the target: brake to `speed`, cruise, brake
        down = (v0 - speed) / deceleration
        cruise = (distance - v0 * v0 / (2 * deceleration)) / speed
        steps = [
            (down, -sign * deceleration),
            (cruise, 0.0),
            (speed / deceleration, -sign * deceleration),
        ]
        return _chain(position, velocity, steps)
    # distance = (vp^2 - v0^2) / 2a + vp^2 / 2d, where a v0 < 0 is first braked to zero with d
    rate = deceleration if v0 < 0 else acceleration
    steps = []
    if v0 < 0:
        steps.append((-v0 / rate, sign * rate))
        distance += v0 * v0 / (2 * rate)
        v0 = 0.0
    half = 0.5 / acceleration + 0.5 / deceleration
    peak = math.sqrt(max(0.0, (distance + v0 * v0 / (2 * acceleration)) / half))
    cruise = 0.0
    if peak > speed:
        rest = distance - (speed * speed - v0 * v0) / (2 * acceleration)
        cruise = (rest - speed * speed / (2 * deceleration)) / speed
        peak = speed
    peak = max(peak, v0)
    steps += [
        ((peak - v0) / acceleration, sign * acceleration),
        (cruise, 0.0),
        (peak / deceleration, -sign * deceleration),
    ]
    return _chain(position, velocity, steps)


class ProfileGenerator:
    """Demand positions, one per period.

    Args:
        period: [s] between calls of `step`.

    Attributes:
        position: latest demand [m].
        velocity: of the profile, before smoothing [m/s].
        done: the demand is at rest at the target.
    """

    def __init__(self, period: float) -> None:
        self.period = period
        self.take_over(0.0, 0.0)

    def take_over(self, position: float, velocity: float) -> None:
        """Restart from this demand [m, m/s]; at rest if the velocity is 0."""
        self.position = self._raw = self._end = position
        self.velocity = velocity
        self.done = velocity == 0.0
        self._segments: tuple[Segment, ...] = ()
        self._time = 0.0
        self._window: deque[float] = deque([position], maxlen=1)

    def move(
        self,
        target: float,
        speed: float,
        acceleration: float,
        deceleration: float,
        jerk: float | None = None,
    ) -> None:
        """Move to `target` [m] from where the profile is now; jerk None: not limited."""
        self._smooth(None if jerk is None else 2 * max(acceleration, deceleration) / jerk)
        self._plan(
            trapezoid(self._raw, self.velocity, target, speed, acceleration, deceleration), target
        )

    def stop(self, deceleration: float) -> None:
        """Brake to rest."""
        if self.done:
            return
        distance = self.velocity * abs(self.velocity) / (2 * deceleration)
        steps = [(abs(self.velocity) / deceleration, -math.copysign(deceleration, self.velocity))]
        self._plan(_chain(self._raw, self.velocity, steps), self._raw + distance)

    def step(self) -> float:
        """Advance by one period; the demand [m]."""
        if self.done:
            return self.position
        self._time += self.period
        while self._segments and self._time >= self._segments[0].duration:
            self._time -= self._segments[0].duration
            self._segments = self._segments[1:]
        if self._segments:
            self._raw, self.velocity = self._segments[0].at(self._time)
        else:
            self._raw, self.velocity = self._end, 0.0
        self._window.append(self._raw)
        if not self._segments and self._window[0] == self._end:
            self.done = True
            self.position = self._end
        else:
            self.position = math.fsum(self._window) / len(self._window)
        return self.position

    def _plan(self, segments: tuple[Segment, ...], end: float) -> None:
        self._segments, self._end, self._time = segments, end, 0.0
        self.done = False

    def _smooth(self, duration: float | None) -> None:
        if self.done:  # a change in motion would make the demand jump
            duration = min(duration or 0.0, _LONGEST_SMOOTHING)
            length = max(1, round(duration / self.period))
            self._window = deque([self.position] * length, maxlen=length)
