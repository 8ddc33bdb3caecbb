"""Makes moves and holds: setpoints and force offsets to the stage, samples to the compensation.

A move in four steps (`Mover.move_to`):

1. plan a jerk-limited trajectory per axis (`estimation.trajectory`),
2. compute a force offset for every setpoint (`compensation.AxisCompensation.force_offsets`),
3. stream both, one pair per SYNC (`streamer`),
4. while a long move decelerates, revise the remaining offsets.

`Mover.learn` then hands the samples of the move and of the rest after it to the compensation.
The engine decides what happens next; this carries it out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimation.move import MoveData
from estimation.trajectory import Limits, Trajectory, plan, plan_stop
from stagectl.sequencer.compensation import TAKE_OVER, AxisCompensation, Learned
from stagectl.sequencer.compensation.axis_compensation import AtRest, AxisMotion
from stagectl.sequencer.compensation.path_friction import PathFriction
from stagectl.sequencer.compensation.places import Places
from stagectl.sequencer.samples.move_data import courses, prepare_move_data
from stagectl.sequencer.streamer import StagePort, Streamer, Until
from stagedata import F64, Move, Samples

LEAST_VALID = 3
"""Fewer valid samples than this make no record to learn from."""
SHORT_MOTION = 0.5
"""An axis that moves for less than this share of the whole move says nothing about the friction at
the target: its Coulomb force still changes while the other axis moves the table."""
_BLOCK = 256
"""Setpoints per block while holding."""


@dataclass(frozen=True, slots=True)
class MovingAxis:
    """One axis of the run.

    Attributes:
        name: as in the machine file.
        limits: of velocity, acceleration and jerk.
        increment: resolution of its setpoints [m].
        compensation: where its force offsets come from.
        following_error: window of the host's own watch [m].
        mass: moved mass, approximate [kg].
    """

    name: str
    limits: Limits
    increment: float
    compensation: AxisCompensation
    following_error: float = math.inf
    mass: float = math.inf


class Mover:
    """Makes moves and holds.

    Args:
        stage: enabled in csp, at rest.
        axes: in the order of all arrays.
        period: Ts [s].
        stop: asked on every SYNC; True ends the current move or hold early.
        places: friction over the table; None where it is taken to be the same everywhere.

    Attributes:
        target: demanded position [m], shape (n,).
        move: the move that samples are being collected for; None before the first one and after
            `learn`.
    """

    def __init__(
        self,
        stage: StagePort,
        axes: Sequence[MovingAxis],
        period: float,
        stop: Callable[[], bool],
        places: Places | None = None,
    ) -> None:
        self.move: Move | None = None
        self._stage, self._axes, self._period = stage, tuple(axes), period
        windows = [axis.following_error for axis in axes]
        self._streamer = Streamer(stage, [axis.name for axis in axes], windows, period, stop)
        self._friction = PathFriction([axis.compensation for axis in axes], places, period)
        self._short_motion: list[bool] = []
        self._is_long = False
        self._reset()

    def _reset(self) -> None:
        """The state after enabling: at rest, no force offset."""
        self.target: F64 = np.array(self._stage.targets, dtype=np.float64)
        self._offset: F64 = np.zeros(len(self._axes))

    def restart(self, samples: int) -> Move | None:
        """Start again after a fault, the stage enabled again at rest; see `Engine.restart`."""
        interrupted, self.move = self.move, None
        self._streamer.restart(samples)
        self._reset()
        for axis in self._axes:
            axis.compensation.forget_state()
        if interrupted is None:
            return None
        return replace(interrupted, end=min(interrupted.end, samples))

    @property
    def samples(self) -> int:
        """SYNCs streamed so far, which is the index of the next sample."""
        return self._streamer.samples

    @property
    def time(self) -> float:
        """Time of the next SYNC if it is punctual [s]."""
        return self._streamer.time

    def on_grid(self, position: Sequence[float]) -> tuple[float, ...]:
        """The position [m] rounded to whole increments of the setpoints."""
        return tuple(
            round(p / axis.increment) * axis.increment
            for p, axis in zip(position, self._axes, strict=True)
        )

    def move_to(
        self,
        target: Sequence[float],
        profile: Limits,
        kind: str,
        site: int | None,
        announce: Callable[[Move], object],
        place: Sequence[float] | None = None,
    ) -> bool:
        """Move all axes to rest at `target` [m].

        Args:
            target: on the grid of the setpoints.
            profile: as asked for; the axes' own limits apply as well.
            kind: of the move.
            site: it belongs to.
            announce: called with the move before its first sample.
            place: whose friction the move will meet [m]; None: the target's.

        Returns:
            False where a stop was asked for: the stage is then at rest short of the target.
        """
        limits = [_within(profile, axis.limits) for axis in self._axes]
        motion = [
            plan(float(start), end, within)
            for start, end, within in zip(self.target, target, limits, strict=True)
        ]
        duration = max(m.duration for m in motion)
        count = math.ceil(duration / self._period) + 1
        self._is_long = duration >= TAKE_OVER
        self._short_motion = [m.duration < (1.0 - SHORT_MOTION) * duration for m in motion]
        self._streamer.begin_move()
        demand = _setpoints(motion, count, self._period)
        place = target if place is None else place
        motions = self._friction.begin(place, motion, demand, self.time)
        offset = self._force_offsets(motions)
        announce(self._begin(kind, target, count, site))
        if not self._stage.streams:
            return self._move_by_profile(target, limits, count)
        done = self._stream_and_revise(motions, demand, offset)
        self._offset = offset[done - 1]
        if done < count:
            now = np.array([done * self._period])
            self._decelerate([[float(s[0]) for s in m.sample(now)] for m in motion])
            return False
        self.target = np.array(target)
        return True

    def _move_by_profile(
        self, target: Sequence[float], limits: Sequence[Limits], count: int
    ) -> bool:
        """Move by the drives' own profiles, without force offsets; `move_to` has planned it.

        Args:
            target: of all axes [m].
            limits: of each axis' profile.
            count: least number of samples, which the move was announced with.
        """
        before = self.samples
        if not self._streamer.stream_to(target, limits):
            self.target = np.array(self._stage.targets, dtype=np.float64)
            return False
        self._reset()
        left = max(0, count - (self.samples - before))
        return not self.hold(left * self._period)

    def excite(self, axis: int, displacement: F64, announce: Callable[[Move], object]) -> bool:
        """Shake one axis around the target, the force offsets as they are.

        Args:
            axis: its number.
            displacement: from the target, at rest at both ends [m], shape (K,).
            announce: called with the move before its first sample.

        Returns:
            False where a stop was asked for: the stage is then at rest.
        """
        count = len(displacement)
        demand = np.tile(self.target, (count, 1))
        demand[:, axis] += displacement
        announce(self._begin("other", self.target.tolist(), count, None))
        self._streamer.begin_move()
        self._is_long = False
        done = self._streamer.stream(demand, np.tile(self._offset, (count, 1)))
        if done == count:
            return True
        path = np.concatenate((np.tile(self.target, (3, 1)), demand[:done]))
        self._decelerate(_last_state(path, self._period))
        return False

    def _begin(self, kind: str, target: Sequence[float], count: int, site: int | None) -> Move:
        names = [axis.name for axis in self._axes]
        origin = dict(zip(names, self.target.tolist(), strict=True))
        there = dict(zip(names, target, strict=True))
        self.move = Move(kind, self.samples, self.samples + count, origin, there, site)
        return self.move

    def _force_offsets(self, motions: Sequence[AxisMotion]) -> F64:
        """Force offset of every setpoint [N], shape (count, n)."""
        at_rest = np.column_stack((self.target, self._streamer.rest_force, self._offset)).tolist()
        return np.column_stack(
            [
                axis.compensation.force_offsets(motion, AtRest(self.time, *rest))
                for axis, motion, rest in zip(self._axes, motions, at_rest, strict=True)
            ]
        )

    def _stream_and_revise(self, motions: Sequence[AxisMotion], demand: F64, offset: F64) -> int:
        """Stream a move; each axis may revise its column of `offset` on the way."""
        revisions: dict[int, list[int]] = {}
        for a, (axis, motion) in enumerate(zip(self._axes, motions, strict=True)):
            when = axis.compensation.revision_time(motion.trajectory)
            if when < motion.trajectory.duration:
                revisions.setdefault(round(when / self._period), []).append(a)
        done = 0
        for row in sorted(revisions):
            done += self._streamer.stream(demand[done:row], offset[done:row])
            if done < row:
                return done
            records = self._records()
            for a in revisions[row]:
                if np.count_nonzero(records[a].valid) < LEAST_VALID:
                    continue
                revised = self._axes[a].compensation.revise_offsets(
                    motions[a], offset[:, a], row, self._friction.leveled(a, records[a])
                )
                if revised is not None:
                    offset[:, a] = revised
        return done + self._streamer.stream(demand[done:], offset[done:])

    def _records(self) -> list[MoveData]:
        """What has been measured of the move so far, one record per axis."""
        records, path = prepare_move_data(
            self._streamer.record(),
            self._streamer.rest_force,
            [axis.mass for axis in self._axes],
            self._period,
        )
        return self._friction.measure(records, path)

    def hold(self, duration: float, until: Until | None = None) -> bool:
        """Hold the target for `duration` [s] at most.

        Args:
            duration: at most.
            until: called with the measured positions [m] after each SYNC; True ends the hold.

        Returns:
            True where `until` or a stop ended it early.
        """
        left = round(duration / self._period)
        while left > 0:
            count = min(_BLOCK, left)
            offset = self._friction.hold_offsets(self._offset, count)
            done = self._streamer.stream(np.tile(self.target, (count, 1)), offset, until)
            self._offset = self._friction.held(self._offset, offset, done)
            if done < count:
                return True
            left -= count
        return False

    def learn(self) -> list[tuple[str, Learned]]:
        """Let the compensation learn from the last move and the rest after it.

        Returns:
            Axis name and estimate of each axis that has one.
        """
        move, self.move = self.move, None
        if move is None or not self._streamer.has_record:
            return []
        if any(axis.compensation.observed for axis in self._axes):
            self._learn_from_corrections()
        learned = []
        for a, (axis, record) in enumerate(zip(self._axes, self._records(), strict=True)):
            result = None
            if self._is_instructive(a, move, record):
                result = axis.compensation.learn(self._friction.leveled(a, record))
            self._friction.carry_state(a, record)
            if result is not None:
                learned.append((axis.name, result))
                self._friction.report(a, move.kind, result, self.time)
        return learned

    def streamed(self) -> Samples | None:
        """The samples since the move began; None before the first one."""
        return self._streamer.streamed()[0] if self._streamer.has_record else None

    def _learn_from_corrections(self) -> None:
        """What a long move lacked; where friction has no presliding, observers assume none."""
        samples, planned = self._streamer.streamed()
        if self._is_long:
            found = courses(samples, planned, self._period)
            for axis, course in zip(self._axes, found, strict=False):
                axis.compensation.acceleration.learn(course)
        rests = (samples.position_demand[1:] == samples.position_demand[:-1]).all(axis=1)
        for a, axis in enumerate(self._axes):
            if axis.compensation.sticking.watches:
                still = samples.valid[1:, a] & rests
                position, force = samples.position[1:, a], samples.force[1:, a]
                axis.compensation.sticking.judge(position, force, still)

    def _is_instructive(self, a: int, move: Move, record: MoveData) -> bool:
        """Whether the estimator can learn from this move of an axis."""
        axis = self._axes[a]
        if abs(move.distance(axis.name)) < axis.increment:
            return False
        if np.count_nonzero(record.valid) < LEAST_VALID:
            return False
        varies = self._friction.varies
        return self._friction.is_known(move.kind) and not (varies and self._short_motion[a])

    def _decelerate(self, states: Sequence[Sequence[float]]) -> None:
        """From the middle of a motion to rest as fast as the axes' limits allow.

        Args:
            states: position, velocity and acceleration of each axis [m, m/s, m/s^2].
        """
        stops = [
            plan_stop(position, velocity, acceleration, axis.limits)
            for (position, velocity, acceleration), axis in zip(states, self._axes, strict=True)
        ]
        count = math.ceil(max(s.duration for s in stops) / self._period) + 1
        offset = np.column_stack(
            [
                axis.compensation.stop_offsets(stop, count, float(self._offset[a]), states[a][2])
                for a, (axis, stop) in enumerate(zip(self._axes, stops, strict=True))
            ]
        )
        self._streamer.stream_to_rest(_setpoints(stops, count, self._period), offset)
        self._offset = offset[-1]
        self.target = np.array([s.target for s in stops])


def _last_state(path: F64, period: float) -> list[list[float]]:
    """Position, velocity and acceleration of each axis at the end of its setpoints."""
    velocity = (path[-1] - path[-2]) / period
    acceleration = (path[-1] - 2.0 * path[-2] + path[-3]) / period**2
    return [list(map(float, state)) for state in zip(path[-1], velocity, acceleration, strict=True)]


def _within(profile: Limits, limits: Limits) -> Limits:
    return Limits(
        min(profile.velocity, limits.velocity),
        min(profile.acceleration, limits.acceleration),
        min(profile.jerk, limits.jerk),
    )


def _setpoints(motion: Sequence[Trajectory], count: int, period: float) -> F64:
    """Positions at Ts, 2 Ts, ... [m], shape (count, n)."""
    time = np.asarray(np.arange(1, count + 1) * period, dtype=np.float64)
    setpoints = np.empty((count, len(motion)))
    for a, m in enumerate(motion):
        setpoints[:, a] = m.sample(time)[0]
    return setpoints
