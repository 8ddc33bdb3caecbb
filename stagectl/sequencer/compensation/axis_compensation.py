"""Where the force offsets of a move come from (0x60B2), and how the model behind them learns.

Per axis, `force_offsets` is mass times demanded acceleration, plus friction predicted from the
current friction state, evaluated ahead by the drive's lag. Two rules keep the offset continuous:
at rest it stays at the last move's final value, with the drive's integrator holding the difference;
and over a long move it takes over what the integrator holds.

The friction state is carried from move to move and corrected by the force at rest. `learn` gives
the samples of a move to the estimator (`estimation.online`), whose figures the next move uses.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from estimation.acceleration_feedforward import against_lag, chord_force
from estimation.friction import (
    F64,
    FrictionState,
    count_states,
    friction_feedforward,
    level_with_target,
    state_after,
)
from estimation.low_speed_friction import LowSpeedFriction
from estimation.move import MoveData
from estimation.observer import Design
from estimation.online import Estimate, EstimatorSettings, SplitHorizonEstimator
from estimation.sampled_force import kink_share, modelled_friction, with_mean_force
from estimation.trajectory import Trajectory
from stagectl.config.machine import Axis
from stagectl.config.settings.host_model import current_lag, drive_loop, kink_delay
from stagectl.sequencer.compensation.acceleration_force import AccelerationForce
from stagectl.sequencer.compensation.known_axis import KnownAxis
from stagectl.sequencer.compensation.mode import Mode
from stagectl.sequencer.compensation.places import Expectation
from stagectl.sequencer.compensation.sticking import Sticking
from stagedata import FrictionFigures

TAKE_OVER = 0.1
"""Moves from this duration on take over what the integrator holds, and may be revised [s]."""
REVISE_AT = 0.65
"""Share of a move's duration after which its offsets may be revised; it decelerates then."""
REVISE_FROM = 0.03
"""Offsets are revised if the sliding force is off by at least this share."""


@dataclass(frozen=True, slots=True)
class Learned:
    """An estimate and its cost.

    Attributes:
        estimate: of one axis from one move.
        compute_time: of the estimator [s].
        local: factor of the known effects on the Coulomb force at the end of the move.
    """

    estimate: Estimate
    compute_time: float
    local: float = 1.0


@dataclass(frozen=True, slots=True)
class AxisMotion:
    """The demand of a move for one axis.

    Attributes:
        trajectory: of the axis; setpoint k = 1..samples is its point at k Ts.
        across: of the other axis; None where there is none.
        samples: number of setpoints.
        variation: Coulomb force at each setpoint relative to that at the target, minus 1; None
            where it is the same everywhere.
    """

    trajectory: Trajectory
    across: Trajectory | None
    samples: int
    variation: F64 | None = None


@dataclass(frozen=True, slots=True)
class AtRest:
    """An axis at rest before a move: time [s], position [m], force measured and offset sent [N]."""

    time: float
    position: float
    force: float
    offset: float


class AxisCompensation:
    """Force offsets and friction model of one axis.

    For every move, in this order: `expect_at_target` and `begin_known` where the Coulomb force
    differs at its target or along it (they keep the friction state of the starting place as the
    departure, and rescale the estimator's to the target), `force_offsets`, perhaps
    `revise_offsets`, then `learn` with samples from `level_with_target`, and `carry_state`, which
    moves the departure along the measured path and ends it.

    Args:
        axis: the host's model of it, with what is known of it.
        friction: model to start from, with what is known of its figures.
        mode: what the offsets consist of.
        period: Ts [s].
        settings: of the estimator.
        known: known effects along the moves; None for none.

    Attributes:
        mode: what the offsets consist of.
        estimator: of the friction figures, with the friction state.
        known: as above.
        observed: whether an observer moves the offsets towards what the integrator holds.
        sticking: whether friction has turned out to have no presliding.
    """

    def __init__(
        self,
        axis: Axis,
        friction: FrictionFigures,
        mode: Mode,
        period: float,
        settings: EstimatorSettings,
        known: KnownAxis | None = None,
    ) -> None:
        self.mode, self.known = mode, known
        self.observed = False
        self.sticking = Sticking()
        self.estimator = SplitHorizonEstimator(friction, settings, mode is not Mode.ESTIMATED)
        self._period = period
        drive = axis.drive
        self._loop = drive_loop(drive)
        self._lag = current_lag(drive)
        delay = drive.control_period / 2.0 + (0.0 if known is None else known.terms.delay)
        self.acceleration = AccelerationForce(axis.plant.mass, delay, period)
        self.low_speed = LowSpeedFriction(friction.coulomb, period)
        self._kink = kink_share(period, kink_delay(drive))
        # Friction state before a move to another Coulomb force, with forces as they are there.
        self._departure: FrictionState | None = None

    def observe(self, design: Design, redesign: Callable[[Design], object]) -> None:
        """From now on an observer corrects the offsets.

        Args:
            design: of the observer.
            redesign: called with another one where friction turns out to stick.
        """
        self.observed = True
        self._observe_by(design)

        def observe_otherwise(other: Design) -> None:
            redesign(other)
            self._observe_by(other)

        self.sticking.watch(design, observe_otherwise)

    def unobserve(self) -> None:
        """The observer is out: forget what moves have shown with it."""
        self.observed = False
        self.acceleration.forget()
        self.sticking.stop()

    def _observe_by(self, design: Design) -> None:
        if self.mode is Mode.ESTIMATED:
            self.acceleration.learn_with(design)

    def force_offsets(self, motion: AxisMotion, rest: AtRest) -> F64:
        """Force offsets of a move, one per setpoint [N], shape (samples,)."""
        force = self._learned_force(motion)
        if self.mode is not Mode.NONE:
            force = self._with_friction(force, motion, rest)
        force = self._as_sent(force, motion)
        duration = motion.trajectory.duration
        if self.mode is not Mode.NONE and duration >= TAKE_OVER and not self.observed:
            share = np.arange(1, motion.samples + 1) * (self._period / duration)
            share = np.clip(share, 0.0, 1.0)
            force += (rest.force - rest.offset) * share**2 * (3.0 - 2.0 * share)
        return rest.offset + force

    def _with_friction(self, force: F64, motion: AxisMotion, rest: AtRest) -> F64:
        """Force for the acceleration with friction and known effects, from the state at rest."""
        known, ahead = self.known, self.acceleration.ahead
        trajectory, variation = motion.trajectory, motion.variation
        held = rest.force if known is None else known.friction_at_rest(rest.force, rest.position)
        state = self.estimator.at_rest(rest.position, held, rest.time)
        friction = self.estimator.effective(rest.time + trajectory.duration / 2.0)
        departure = None if variation is None else self._state_at_departure(held)
        force += friction_feedforward(
            friction, departure or state, trajectory, motion.samples, self._period, ahead,
            variation=None if departure is None else variation,
        )  # fmt: skip
        return force if known is None else known.offsets(held, force)

    def revision_time(self, trajectory: Trajectory) -> float:
        """When to call `revise_offsets`, from the start of the move [s]; infinite for never."""
        revisable = self.mode is Mode.ESTIMATED and trajectory.duration >= TAKE_OVER
        return REVISE_AT * trajectory.duration if revisable else math.inf

    def revise_offsets(
        self, motion: AxisMotion, offsets: F64, sent: int, move: MoveData
    ) -> F64 | None:
        """Recompute the rest of a move's offsets where its samples contradict the model.

        Solves zone A during the move (the paper's first aim), so that this move
        already settles with the better model. The offset continues from the last one sent.

        Args:
            motion: the demand of the move.
            offsets: of the whole move as planned, shape (samples,) [N].
            sent: how many of them have been sent.
            move: samples so far, leveled with the target.

        Returns:
            Offsets of the whole move, shape (samples,) [N]; None where the model holds.
        """
        friction = self._modelled_friction(move, self.estimator.effective(move.time))
        preview = self.estimator.preview(
            self.low_speed.without(self._with_mean_force(move, friction))
        )
        if preview is None or abs(preview.change) < REVISE_FROM:
            return None
        trajectory, variation, samples = motion.trajectory, motion.variation, motion.samples
        force, ahead = self._learned_force(motion), self.acceleration.ahead
        force = force[sent:] - force[sent - 1]
        state = preview.state.copy()
        if variation is not None:
            state.rescale(1.0 + float(variation[sent - 1]))  # sliding elements follow Fc
        force += friction_feedforward(
            preview.friction, state, trajectory, samples, self._period, ahead, sent, variation
        )
        if self.known is not None:
            now = self.acceleration.mass * trajectory.sample(np.array([sent * self._period]))[2]
            force = self.known.offsets(float(now[0]) + preview.state.total, force, sent)
        force = self._as_sent(force, motion, sent)
        return np.concatenate([offsets[:sent], offsets[sent - 1] + force])

    def stop_offsets(
        self, stop: Trajectory, samples: int, offset: float, acceleration: float
    ) -> F64:
        """Force offsets of a deceleration from mid-move to rest [N], shape (samples,).

        Friction is taken to stay as it is; only the force for the acceleration changes.

        Args:
            stop: trajectory to rest.
            samples: number of setpoints.
            offset: in effect when it begins [N].
            acceleration: demanded at that moment [m/s^2].
        """
        ahead = self.acceleration.ahead + self._lag
        time = np.asarray(np.arange(1, samples + 1) * self._period + ahead)
        _, velocity, planned = stop.sample(time)
        change = self.acceleration.mass * (planned - acceleration)
        return np.asarray(offset + change + self.low_speed.force(velocity))

    def learn(self, move: MoveData) -> Learned | None:
        """Carry the friction state through a move and, in mode ESTIMATED, learn from it.

        Args:
            move: as sampled, leveled with the target where the Coulomb force varies.

        Returns:
            The estimate; None in the other modes.

        Raises:
            ValueError: the move is too short, or has no valid samples.
        """
        if self.mode is Mode.NONE:
            return None
        begin = time.perf_counter()
        model = self.estimator.effective(move.time)
        friction = self._modelled_friction(move, model)
        move = self._with_mean_force(move, friction)
        if self.mode is Mode.ESTIMATED and friction is not None:
            if self.low_speed.learn_from(move, friction, model.coulomb):
                self.estimator.doubt()  # what was learned before did not know of it
        estimate = self.estimator.update(self.low_speed.without(move))
        spent = time.perf_counter() - begin
        if self.mode is not Mode.ESTIMATED:
            return None
        return Learned(estimate, spent, 1.0 if self.known is None else self.known.local)

    def saturates_at(self, force: float) -> None:
        """From now on the drive's largest force is this [N]."""
        self.estimator.saturates_at(force)
        if self.known is not None:
            self.known.peak = force

    def forget_state(self) -> None:
        """Forget the friction state, unknown after a loss of power; the figures are kept."""
        self.estimator.forget_state()
        if self.known is not None:
            self.known.forget()

    def begin_known(self, motion: AxisMotion, demand: F64, moment: float) -> None:
        """Predict known effects along the coming move, if there are any.

        Args:
            motion: demand of the move.
            demand: setpoints of all axes [m], shape (K, n).
            moment: time of the rest before the move [s].
        """
        known = self.known
        if known is None:
            return
        known.plan(motion.trajectory, motion.across, motion.samples, self.acceleration.ahead)
        if known.terms.has_coulomb_factor:
            before, local = known.local, known.meet_coulomb(demand, moment)
            if known.varies and self._departure is None:
                self._departure = self._state_now()
            if known.varies and self.estimator.state is not None:
                self.estimator.state.rescale(local / before)
            self.estimator.scale_coulomb(local)

    def _state_now(self) -> FrictionState:
        """A copy of the friction state; relaxed where it is unknown."""
        state = self.estimator.state
        if state is None:
            return FrictionState.relaxed(count_states(self.estimator.friction))
        return state.copy()

    def expect_at_target(self, friction: Expectation) -> None:
        """Expect another Coulomb force at the next move's target."""
        self._departure = self._state_now()
        self.estimator.expect(friction.coulomb, friction.sigma, friction.level)

    def correct_at_place(self, friction: Expectation) -> None:
        """Correct the Coulomb force at the present position; the elements keep their forces."""
        state = self.estimator.state
        kept = None if state is None else state.copy()
        self.estimator.expect(friction.coulomb, friction.sigma, friction.level)
        self.estimator.state = kept

    def level_with_target(self, move: MoveData, variation: F64) -> MoveData:
        """A move's samples as if the Coulomb force were that of the target all the way.

        Args:
            move: as sampled.
            variation: float64[K], Fc at each sample relative to that at the target, minus 1.
        """
        scaled = self.estimator.state
        if scaled is None or self._departure is None:
            return move
        friction = self.estimator.effective(move.time)
        return level_with_target(friction, self._departure, scaled, variation, move, self._period)

    def carry_state(self, move: MoveData, variation: F64) -> None:
        """After `learn`: carry the friction state through a move with varying Coulomb force.

        Arguments as in `level_with_target`: `variation` is float64[K], relative.
        """
        departure, self._departure = self._departure, None
        if departure is None or self.mode is Mode.NONE:
            return
        end = move.time + (len(move.position) - 1) * self._period
        friction = self.estimator.effective(end)
        self.estimator.state = state_after(friction, departure, variation, move, self._period)

    def _state_at_departure(self, rest_force: float) -> FrictionState | None:
        """The friction state where a move to another place begins; None where it is unknown."""
        if self._departure is not None:
            # Elements at rest keep their forces whatever Fc does; only their sum is measured.
            forces = self._departure.forces
            forces += (rest_force - self._departure.total) / len(forces)
        return self._departure

    def _learned_force(self, motion: AxisMotion) -> F64:
        """Force for the acceleration, and for friction at low speed, at each setpoint [N]."""
        samples, ahead = motion.samples, self.acceleration.ahead
        force = self.acceleration.along(motion.trajectory, motion.across, samples)
        if self.low_speed.level:
            time = np.asarray(np.arange(1, samples + 1) * self._period + ahead, np.float64)
            force = force + self.low_speed.force(motion.trajectory.sample(time)[1])
        return force

    def _as_sent(self, force: F64, motion: AxisMotion, sent: int = 0) -> F64:
        """Change of the force offset since setpoint `sent` that brings about that of a force [N].

        Against the current loop's lag, and without what the position loop adds by itself.
        """
        force = against_lag(force, self._lag, self._period, moving=sent > 0)
        if self._loop is None:
            return force
        added = chord_force(self._loop, motion.trajectory, sent + len(force), self._period)
        force -= added[sent:]
        if sent:
            force += added[sent - 1]
        return force

    def _modelled_friction(self, move: MoveData, model: FrictionFigures) -> F64 | None:
        """Friction force of a model at a move's samples; None where the state is not known."""
        state = self.estimator.state
        return None if state is None else modelled_friction(move, model, state, self._period)

    def _with_mean_force(self, move: MoveData, friction: F64 | None) -> MoveData:
        return with_mean_force(move, self._kink, friction, self.estimator.settings.peak_force)
