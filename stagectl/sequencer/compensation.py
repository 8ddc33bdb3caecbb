"""Joins estimator, friction state and feedforward to the run: the force offsets of every move.

Per axis: mass times demanded acceleration; friction predicted from the state that the stage is in
(carried from move to move, corrected by the force at rest, evaluated ahead by the drive's lag); and
the estimator that learns from what came back. The offset never jumps: at rest it stays where the
last move left it, the position loop's integrator holding the rest, and a long move takes over what
the integrator holds.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from estimation.friction import (
    F64,
    Friction,
    FrictionState,
    friction_feedforward,
    level_with_target,
    mass_feedforward,
    remaining_feedforward,
    state_after,
    varying_feedforward,
)
from estimation.move import MoveData
from estimation.online import Estimate, SplitHorizonEstimator
from estimation.sampled_force import kink_share, with_mean_force
from estimation.trajectory import Limits, Trajectory, plan
from stagectl.config.host_model import estimator_settings, friction_model, kink_delay
from stagectl.config.machine import Axis, Machine

TAKE_OVER = 0.1
"""Shortest move in which the offset takes over what the integrator holds [s]."""
REVISE = 0.03
"""Relative change of the sliding force from which a move's own offsets are revised under way."""
REVISE_AT = 0.65
"""When that is looked at: this share of the move's duration, while it still brakes."""


Figures = Mapping[str, tuple[float, float]]
"""Friction figures by name (coulomb, viscous, stiffness, relaxation_rate), each with its sigma."""


class Mode(StrEnum):
    """What the force offsets are made of."""

    NONE = "none"
    MODEL = "model"
    ESTIMATED = "estimated"
    ORACLE = "oracle"


@dataclass(frozen=True, slots=True)
class Learned:
    """An estimate with the time it took.

    Attributes:
        estimate: of one axis from one move.
        compute_time: [s].
    """

    estimate: Estimate
    compute_time: float


class AxisCompensation:
    """Compensation of one axis.

    Args:
        axis: as the host believes it.
        friction: model to start from.
        mode: what the offsets are made of.
        period: Ts [s].
        settled: given where it is known from elsewhere how the Coulomb force differs from place to
            place, so that the figures themselves hardly change from move to move: the relative
            1-sigma of that by name, as of `estimator_settings`.
    """

    def __init__(
        self,
        axis: Axis,
        friction: Friction,
        mode: Mode,
        period: float,
        settled: Mapping[str, float] | None = None,
    ) -> None:
        self.mode = mode
        self._departed: FrictionState | None = None
        self._mass = axis.plant.mass
        self._period = period
        drive = axis.drive
        lag = 1.0 / (2.0 * math.pi * drive.current_bandwidth)
        self._ahead = lag + drive.control_period / 2.0
        self._kink = kink_share(period, kink_delay(drive))
        self.estimator = SplitHorizonEstimator(
            friction,
            estimator_settings(axis, period, settled),
            frozen=mode is not Mode.ESTIMATED,
        )  # fmt: skip

    def offsets(
        self,
        trajectory: Trajectory,
        samples: int,
        moment: float,
        position: float,
        rest_force: float,
        rest_offset: float,
        relief: F64 | None = None,
    ) -> F64:
        """Force offsets of a move, one per setpoint [N], shape (samples,).

        Args:
            trajectory: of the demand; setpoint k = 1..samples is its point at k Ts.
            samples: how many.
            moment: time of the rest before it [s].
            position: at rest [m].
            rest_force: force measured at rest [N].
            rest_offset: force offset in force at rest [N].
            relief: Coulomb force on the way, relative to that at the target, minus 1, when each
                setpoint is reached; None where it is the same everywhere.
        """
        force = mass_feedforward(self._mass, trajectory, samples, self._period, self._ahead)
        if self.mode is Mode.NONE:
            return rest_offset + force
        state = self.estimator.at_rest(position, rest_force, moment)
        friction = self.estimator.effective(moment + trajectory.duration / 2.0)
        real = None if relief is None else self._real_state(rest_force)
        if relief is None or real is None:
            force += friction_feedforward(
                friction, state, trajectory, samples, self._period, self._ahead
            )
        else:
            force += varying_feedforward(
                friction, real, relief, trajectory, self._period, self._ahead
            )
        if trajectory.duration >= TAKE_OVER:
            share = np.arange(1, samples + 1) * (self._period / trajectory.duration)
            share = np.clip(share, 0.0, 1.0)
            force += (rest_force - rest_offset) * share**2 * (3.0 - 2.0 * share)
        return rest_offset + force

    def revise_after(self, trajectory: Trajectory) -> float:
        """When `revise` is worth asking [s]; infinite where it never is."""
        asked = self.mode is Mode.ESTIMATED and trajectory.duration >= TAKE_OVER
        return REVISE_AT * trajectory.duration if asked else math.inf

    def expect(
        self, coulomb: float, sigma: float, level: tuple[float, float] | None = None
    ) -> None:
        """From now on Fc is `coulomb` +- `sigma` [N], and w is as `level` says: another place."""
        state = self.estimator.state
        self._departed = (
            FrictionState.relaxed(self.estimator.friction.states) if state is None else state.copy()
        )
        self.estimator.expect(coulomb, sigma, level)

    def correct(self, coulomb: float, sigma: float, level: tuple[float, float] | None) -> None:
        """As `expect`, of the place where the axis is: its elements keep their forces."""
        state = self.estimator.state
        kept = None if state is None else state.copy()
        self.estimator.expect(coulomb, sigma, level)
        self.estimator.state = kept

    def _real_state(self, rest_force: float) -> FrictionState | None:
        """The friction state at rest as it is where the move begins, None where it is not known."""
        if self._departed is not None:
            # Elements at rest keep their force, whatever the Coulomb force does meanwhile: only
            # their sum is corrected.
            self._departed.forces += (rest_force - self._departed.total) / len(
                self._departed.forces
            )
        return self._departed

    def level_with_target(self, move: MoveData, relief: F64) -> MoveData:
        """A move's data as if the Coulomb force were everywhere what it is at the target.

        Args:
            move: as sampled.
            relief: Fc at each sample's place, relative to that at the target, minus 1.
        """
        scaled = self.estimator.state
        if scaled is None or self._departed is None:
            return move
        friction = self.estimator.effective(move.time)
        return level_with_target(friction, self._departed, scaled, relief, move, self._period)

    def arrive(self, move: MoveData, relief: F64) -> None:
        """After `learn`: the friction state at the end of a move between places.

        Args:
            move: as sampled.
            relief: as in `level_with_target`.
        """
        departed, self._departed = self._departed, None
        if departed is None or self.mode is Mode.NONE:
            return
        end = move.time + (len(move.position) - 1) * self._period
        friction = self.estimator.effective(end)
        self.estimator.state = state_after(friction, departed, relief, move, self._period)

    def revise(
        self,
        trajectory: Trajectory,
        offsets: F64,
        sent: int,
        move: MoveData,
        relief: F64 | None = None,
    ) -> F64 | None:
        """New offsets for the rest of a move that shows the model to be wrong, else None.

        Solves zone A of the move while it goes on (the paper's first aim), so that its own
        settling has the better model already. What was sent stays: the offset goes on from there.

        Args:
            trajectory: of the demand.
            offsets: of the whole move as they were planned, shape (samples,) [N].
            sent: how many of them are gone.
            move: samples up to now, level with the target.
            relief: as in `offsets`.
        """
        preview = self.estimator.preview(self._with_mean_force(move))
        if preview is None or abs(preview.change) < REVISE:
            return None
        samples = len(offsets)
        force = mass_feedforward(self._mass, trajectory, samples, self._period, self._ahead)
        force = force[sent:] - force[sent - 1]
        if relief is None:
            force += remaining_feedforward(
                preview.friction, preview.state, trajectory, sent, samples, self._period,
                self._ahead,
            )  # fmt: skip
        else:
            state = preview.state.copy()
            state.rescale(1.0 + float(relief[sent - 1]))  # it slides, and has followed
            force += varying_feedforward(
                preview.friction, state, relief, trajectory, self._period, self._ahead, sent
            )
        return np.concatenate([offsets[:sent], offsets[sent - 1] + force])

    def stop_offsets(
        self, stop: Trajectory, samples: int, offset: float, acceleration: float
    ) -> F64:
        """Force offsets of a motion to rest out of the middle of a move [N], shape (samples,).

        Friction stays what it is; only the force for the acceleration goes.

        Args:
            stop: the motion to rest.
            samples: how many.
            offset: in force when the stop begins [N].
            acceleration: demanded then [m/s^2].
        """
        force = mass_feedforward(self._mass, stop, samples, self._period, self._ahead)
        return offset - self._mass * acceleration + force

    def _with_mean_force(self, move: MoveData) -> MoveData:
        estimator = self.estimator
        return with_mean_force(
            move, self._kink, estimator.effective(move.time), estimator.state, self._period,
            estimator.settings.peak_force,
        )  # fmt: skip

    def forget_state(self) -> None:
        """The stage has been without power: its friction figures stay, its state is unknown."""
        self.estimator.forget_state()

    def learn(self, move: MoveData) -> Learned | None:
        """Follow a move, and update the model from it where that is the mode.

        Returns the estimate, or None in the modes that do not estimate.

        Raises:
            ValueError: a move that cannot be followed (too short, nothing valid).
        """
        if self.mode is Mode.NONE:
            return None
        begin = time.perf_counter()
        estimate = self.estimator.update(self._with_mean_force(move))
        spent = time.perf_counter() - begin
        return Learned(estimate, spent) if self.mode is Mode.ESTIMATED else None


def make_compensation(
    machine: Machine,
    mode: Mode,
    scale: float = 1.0,
    truth: Machine | None = None,
    known: Mapping[str, Figures] | None = None,
    settled: Mapping[str, Mapping[str, float]] | None = None,
) -> tuple[AxisCompensation, ...]:
    """Compensation of every axis, in the machine's order, compiled and ready.

    Args:
        machine: what the host believes.
        mode: what the offsets are made of.
        scale: of the machine file's friction figures to start from; the truth is not scaled.
        truth: where `mode` is oracle, whose friction figures to use.
        known: axis -> figures that an earlier run has learned, where `mode` is estimated.
        settled: axis -> as of `AxisCompensation`; None: the Coulomb force is the same everywhere.
    """
    source = truth if mode is Mode.ORACLE and truth is not None else machine
    scale = scale if source is machine else 1.0
    made = tuple(
        AxisCompensation(
            axis,
            friction_model(source.axes[name]).scaled(scale),
            mode,
            machine.bus.sync_period,
            None if settled is None else settled.get(name, {}),
        )
        for name, axis in machine.axes.items()
    )
    if mode is Mode.ESTIMATED and known is not None:
        for name, compensation in zip(machine.axes, made, strict=True):
            if name in known:
                compensation.estimator.believe(known[name])
    _warm_up(next(iter(machine.axes.values())), machine.bus.sync_period)
    return made


def _warm_up(axis: Axis, period: float) -> None:
    """Run the compiled kernels once, on a throw-away axis, before anything moves."""
    scratch = AxisCompensation(axis, friction_model(axis), Mode.ESTIMATED, period)
    limits = axis.limits
    motion = plan(
        0.0, 1e-3, Limits(limits.velocity / 10, limits.acceleration / 10, limits.jerk / 10)
    )
    samples = math.ceil(motion.duration / period) + 20
    force = scratch.offsets(motion, samples, 0.0, 0.0, 0.0, 0.0)
    position = motion.sample(np.asarray(np.arange(samples) * period, np.float64))[0]
    for start in (0.0, 1.0):
        scratch.learn(MoveData(position, force, np.ones(samples, dtype=np.bool_), start, 0.0))
