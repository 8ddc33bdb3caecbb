"""Moves and holds: setpoints and force offsets out, what came back to the compensation.

Knows where the demand stands, which force offsets are in force, the force at rest, and the samples
of the move that is going on. The sequencer's engine decides what to do; this does it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from estimation.move import MoveData
from estimation.trajectory import Limits, Trajectory, plan, plan_stop
from stagectl.errors import RunFault
from stagectl.sequencer import late_setpoint_mask
from stagectl.sequencer.compensation import AxisCompensation, Learned
from stagectl.sequencer.places import Places
from stagectl.sequencer.sample_validity import (
    bridged_positions,
    filled_to_grid,
    mean_force,
    resampled_to_grid,
    without_late,
    without_stale,
    without_unpunctual,
)
from stagedata import Move, Samples

F64 = NDArray[np.float64]
Until = Callable[[tuple[float, ...]], bool]

REST_SAMPLES = 5
"""Samples whose mean is the force at rest."""
BEFORE_MOVE = 2
"""Samples at rest that a move's data begin with."""
ASTRAY = 10
"""An axis that has been outside its following window in so many samples does not follow."""
BRIEF = 0.5
"""Between places an axis that rests for more than this share of the move has shown nothing of the
level at the target: Fc goes on changing under it with the other axes' positions, and by itself."""
_CHUNK = 256
"""Setpoints streamed at once while holding."""


class StagePort(Protocol):
    """What the sequencer needs of a stage that is enabled in csp."""

    @property
    def targets(self) -> tuple[float, ...]:
        """Target positions sent last [m]."""

    def stream(self, position: F64, offset: F64, until: Until | None = None) -> Samples:
        """One setpoint pair per SYNC, [m] and [N], shape (K, n); ends early where `until` says."""


@dataclass(frozen=True, slots=True)
class MovingAxis:
    """One axis of the run.

    Attributes:
        name: as in the machine file.
        limits: most that the axis may be asked for.
        increment: of its setpoints [m].
        compensation: its force offsets.
        following_error: window around the demand [m]. The drive watches its own demand; this is
            for the case that ours does not reach it, or that its position does not reach us.
        mass: moved, about [kg].
    """

    name: str
    limits: Limits
    increment: float
    compensation: AxisCompensation
    following_error: float = math.inf
    mass: float = math.inf


class Mover:
    """Streams moves and holds.

    Args:
        stage: enabled in csp, at rest.
        axes: in the order of all arrays.
        period: Ts [s].
        stop: looked at on every SYNC; True ends what is going on early.
        places: how friction differs over the table; None: not known to.

    Attributes:
        samples: SYNCs streamed so far: the index of the next sample.
        target: demanded position [m], shape (n,).
        move: the move since which samples are collected, None before the first.
    """

    def __init__(
        self,
        stage: StagePort,
        axes: Sequence[MovingAxis],
        period: float,
        stop: Callable[[], bool],
        places: Places | None = None,
    ) -> None:
        self.samples = 0
        self.move: Move | None = None
        self._stage, self._axes, self._period, self._stop = stage, tuple(axes), period, stop
        self._places = places
        self._relief: F64 | None = None
        self._behind: list[F64] = []
        self._brief: list[bool] = []
        self._take_stock()

    def _take_stock(self) -> None:
        """As after enabling: at rest where the stage says, no force offset, nothing seen yet."""
        count = len(self._axes)
        self.target: F64 = np.array(self._stage.targets, dtype=np.float64)
        self._offset: F64 = np.zeros(count)
        self._blocks: list[Samples] = []
        self._tail = Samples.missing(0, count)
        self._before = self._tail
        self._rest_force: F64 = np.zeros(count)

    def begin_anew(self, samples: int) -> Move | None:
        """Go on after a fault, the stage enabled again at rest; see `Engine.begin_anew`."""
        broken, self.move = self.move, None
        self.samples = samples
        self._take_stock()
        for axis in self._axes:
            axis.compensation.forget_state()
        return broken if broken is None else replace(broken, end=min(broken.end, samples))

    @property
    def time(self) -> float:
        """Of the next SYNC, as far as it is known yet [s]."""
        return float(self._tail.time[-1]) + self._period if len(self._tail) else 0.0

    def on_grid(self, position: Sequence[float]) -> tuple[float, ...]:
        """The position [m] that can be sent: whole increments."""
        return tuple(
            round(p / axis.increment) * axis.increment
            for p, axis in zip(position, self._axes, strict=True)
        )

    def go(
        self,
        kind: str,
        site: int | None,
        target: Sequence[float],
        profile: Limits,
        announce: Callable[[Move], object],
        place: Sequence[float] | None = None,
    ) -> bool:
        """Move all axes to rest at `target` [m]; returns False where it was stopped on the way.

        Stopped, the stage is at rest, somewhere on the way.

        Args:
            kind: of the move.
            site: it belongs to.
            target: on the grid of setpoints.
            profile: asked for; the axes' limits hold besides.
            announce: called with the move before its first sample.
            place: whose friction it is to show [m]; None: the target's.
        """
        motion = [
            plan(float(start), end, _within(profile, axis.limits))
            for start, end, axis in zip(self.target, target, self._axes, strict=True)
        ]
        rows = math.ceil(max(m.duration for m in motion) / self._period) + 1
        # The force at rest is only known where there was one: else the last one stands.
        if len(self._tail):
            self._rest_force = mean_force(self._tail)
        demand = _demand(motion, rows, self._period)
        self._relief = self._depart(target if place is None else place, demand)
        longest = max(m.duration for m in motion)
        self._brief = [m.duration < (1.0 - BRIEF) * longest for m in motion]
        offset = np.column_stack(
            [
                axis.compensation.offsets(
                    m, rows, self.time, float(self.target[a]), float(self._rest_force[a]),
                    float(self._offset[a]), self._relief_of(a),
                )
                for a, (axis, m) in enumerate(zip(self._axes, motion, strict=True))
            ]
        )  # fmt: skip
        names = [axis.name for axis in self._axes]
        self.move = Move(
            kind,
            self.samples,
            self.samples + rows,
            dict(zip(names, self.target.tolist(), strict=True)),
            dict(zip(names, target, strict=True)),
            site,
        )
        announce(self.move)
        self._before = self._tail.tail(BEFORE_MOVE)
        self._blocks = []
        done = self._stream_and_revise(motion, demand, offset)
        self._offset = offset[done - 1]
        if done < rows:
            self._break_off(motion, done)
            return False
        self.target = np.array(target)
        return True

    def _stream_and_revise(self, motion: Sequence[Trajectory], demand: F64, offset: F64) -> int:
        """Stream a move; on the way each axis may revise its column of `offset`."""
        asks: dict[int, list[int]] = {}
        for a, (axis, m) in enumerate(zip(self._axes, motion, strict=True)):
            after = axis.compensation.revise_after(m)
            if after < m.duration:
                asks.setdefault(round(after / self._period), []).append(a)
        done = 0
        for row in sorted(asks):
            done += self._stream(demand[done:row], offset[done:row])
            if done < row:
                return done
            data = self._move_data()
            for a in asks[row]:
                if data[a].valid.sum() >= 3:
                    revised = self._axes[a].compensation.revise(
                        motion[a], offset[:, a], row, self._level(a, data[a]), self._relief_of(a)
                    )
                    if revised is not None:
                        offset[:, a] = revised
        return done + self._stream(demand[done:], offset[done:])

    def _move_data(self) -> list[MoveData]:
        """What has come back of the move so far, axis by axis."""
        period = self._period
        data = Samples.concatenate([self._before, *self._blocks])
        data = without_stale(without_unpunctual(data, period))
        upset = late_setpoint_mask.late_setpoints(data, period)
        data = resampled_to_grid(filled_to_grid(data, period), period)
        upset |= late_setpoint_mask.missed_syncs(data, period)
        upset |= late_setpoint_mask.outliers(data, period, [axis.mass for axis in self._axes])
        moves = [
            MoveData(
                np.ascontiguousarray(data.position[:, a]),
                np.ascontiguousarray(data.force[:, a]),
                np.ascontiguousarray(data.valid[:, a]),
                float(data.time[0]),
                float(self._rest_force[a]),
                np.ascontiguousarray(upset[:, a]),
            )
            for a in range(len(self._axes))
        ]
        if self._relief is not None and self._places is not None:
            path = bridged_positions(data)
            self._behind = [self._places.relief(a, path) for a in range(len(self._axes))]
        return moves

    def _level(self, a: int, move: MoveData) -> MoveData:
        """The data of one axis level with the target, where Fc differs on the way."""
        if self._relief is None:
            return move
        return self._axes[a].compensation.level_with_target(move, self._behind[a])

    def _depart(self, place: Sequence[float], demand: F64) -> F64 | None:
        """Tell every axis what to expect at a place; what differs on the way, shape (K, n).

        None where nothing is known of places, or the move stays at its own.
        """
        if self._places is None:
            return None
        expected = self._places.depart(place, self.time)
        if expected is None:
            return None
        for axis, there in zip(self._axes, expected, strict=True):
            if there is not None:
                axis.compensation.expect(there.coulomb, there.sigma, there.level)
        return np.column_stack([self._places.relief(a, demand) for a in range(len(self._axes))])

    def _relief_of(self, axis: int) -> F64 | None:
        return None if self._relief is None else self._relief[:, axis]

    def hold(self, duration: float, until: Until | None = None) -> bool:
        """Stay at the target for `duration` [s]; True where `until` ended it or a stop was asked.

        Args:
            duration: at most.
            until: gets the actual positions [m] after each SYNC.
        """
        left = round(duration / self._period)
        while left > 0:
            rows = min(_CHUNK, left)
            done = self._stream(
                np.tile(self.target, (rows, 1)), np.tile(self._offset, (rows, 1)), until
            )
            if done < rows:
                return True
            left -= rows
        return False

    def learn(self) -> list[tuple[str, Learned]]:
        """Let the compensation of each axis that moved learn from the move, its rest included."""
        move, self.move = self.move, None
        if move is None or not self._blocks:
            return []
        learned = []
        teaches = self._places is None or self._places.teaches(move.kind)
        for a, (axis, data) in enumerate(zip(self._axes, self._move_data(), strict=True)):
            moved = abs(move.distance(axis.name)) >= axis.increment and data.valid.sum() >= 3
            if not teaches or (self._relief is not None and self._brief[a]):
                moved = False  # its friction state is followed all the same
            result = axis.compensation.learn(self._level(a, data)) if moved else None
            if self._relief is not None:
                axis.compensation.arrive(data, self._behind[a])
            if result is not None:
                learned.append((axis.name, result))
                self._tell(a, move.kind, result)
        return learned

    def _tell(self, axis: int, kind: str, learned: Learned) -> None:
        """Let the knowledge of places have what a move has shown, and take what it makes of it."""
        if self._places is None:
            return
        now = self._places.arrived(axis, kind, learned.estimate, self.time)
        if now is not None:
            self._axes[axis].compensation.correct(now.coulomb, now.sigma, now.level)

    def _break_off(self, motion: Sequence[Trajectory], done: int) -> None:
        """From the middle of a motion to rest as fast as the axes' limits allow."""
        states = [[float(s[0]) for s in m.sample(np.array([done * self._period]))] for m in motion]
        stops = [
            plan_stop(state[0], state[1], state[2], axis.limits)
            for state, axis in zip(states, self._axes, strict=True)
        ]
        rows = math.ceil(max(s.duration for s in stops) / self._period) + 1
        offset = np.column_stack(
            [
                axis.compensation.stop_offsets(stop, rows, float(self._offset[a]), states[a][2])
                for a, (axis, stop) in enumerate(zip(self._axes, stops, strict=True))
            ]
        )
        self._stream(_demand(stops, rows, self._period), offset, _never)
        self._offset = offset[-1]
        self.target = np.array([s.target for s in stops])

    def _stream(self, demand: F64, offset: F64, until: Until | None = None) -> int:
        """Stream, keep the samples; returns how many rows were sent."""
        stop = self._stop
        check: Until
        if until is None:

            def check(_: tuple[float, ...]) -> bool:
                return stop()
        elif until is _never:
            check = until
        else:

            def check(position: tuple[float, ...]) -> bool:
                return until(position) or stop()

        block = self._stage.stream(demand, offset, check)
        samples = without_late(block)
        self._blocks.append(samples)
        self.samples += len(samples)
        self._check_following(samples, demand)
        done = len(samples)
        if done < REST_SAMPLES:
            samples = Samples.concatenate([self._tail, samples])
        self._tail = samples.tail(REST_SAMPLES)
        return done

    def _check_following(self, samples: Samples, demand: F64) -> None:
        """Position k against demand k - 1, which the drive was at when it was sampled.

        Raises:
            RunFault: an axis does not follow.
        """
        error = np.abs(samples.position[1:] - demand[: len(samples) - 1])
        for a, axis in enumerate(self._axes):
            worst = error[:, a][samples.valid[1:, a]]
            if (worst > axis.following_error).sum() >= ASTRAY:
                raise RunFault(
                    f"axis {axis.name}: 0x6064:00 position actual: {worst.max() * 1e3:.3g} mm from "
                    f"what was demanded (following_error: {axis.following_error * 1e3:g} mm); "
                    "do setpoints reach the drive?"
                )


def _never(_: tuple[float, ...]) -> bool:
    return False


def _within(profile: Limits, limits: Limits) -> Limits:
    return Limits(
        min(profile.velocity, limits.velocity),
        min(profile.acceleration, limits.acceleration),
        min(profile.jerk, limits.jerk),
    )


def _demand(motion: Sequence[Trajectory], rows: int, period: float) -> F64:
    time = np.asarray(np.arange(1, rows + 1) * period, dtype=np.float64)
    return np.column_stack([m.sample(time)[0] for m in motion])
