"""The split-horizon estimator: one move in, an updated friction model (or a reason) out.

Zone A (all elements slip) gives Coulomb force and viscous coefficient; then the stick zones (the
onset and what follows the first reversal) give presliding stiffness and relaxation rate, with zone
A's result as prior. Each is a bounded least-squares problem with an arrival cost (source paper,
equation (4)); what the unknowns are and how belief ages: `belief`, `window`.

An estimate is accepted or refused as a whole; a refused one leaves the last good model in force.
Not here: Stribeck figures, direction asymmetry, shape of the hysteresis.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from estimation.belief import (
    COULOMB,
    FIGURES,
    LEVEL,
    MASS,
    RATE,
    STIFFNESS,
    VISCOUS,
    Belief,
    BeliefSettings,
)
from estimation.gms import F64, Friction, FrictionState
from estimation.kinematics import differentiate
from estimation.window import Fit, MoveWindow
from estimation.zones import split

MIN_SLIDE, MIN_STICK = 12, 6
"""Fewest samples of a zone that is worth solving."""
_ZONE_A = (COULOMB, VISCOUS, MASS)
_ZONE_B = (COULOMB, VISCOUS, STIFFNESS, RATE, MASS)


@dataclass(frozen=True, slots=True)
class EstimatorSettings:
    """How an axis is estimated.

    Attributes:
        mass: moved mass [kg].
        period: of the samples [s].
        noise: rms of measured force minus mass times acceleration, from the sensors [N].
        peak_force: samples at or beyond it are saturated and left out [N].
        model_error: rms of what the model itself misses, relative to the Coulomb force.
        belief: start and ageing of what is believed.
        bounds: lowest and highest value of each figure, relative to the start model.
        misfit: largest rms of the whitened residual that is accepted.
        jump: a change beyond so many predicted standard deviations, and beyond `jump_share`
            of the figure, is refused.
        patience: so many jumps in a row, the same way, mean that the stage has changed.
    """

    mass: float
    period: float
    noise: float
    peak_force: float = math.inf
    model_error: float = 0.01
    belief: BeliefSettings = field(default_factory=BeliefSettings)
    bounds: tuple[float, float] = (0.05, 20.0)
    misfit: float = 6.0
    jump: float = 6.0
    jump_share: float = 0.15
    patience: int = 2


@dataclass(frozen=True, slots=True)
class MoveData:
    """One axis over one move, from rest to rest (or to the last sample).

    Attributes:
        position: sampled [m], shape (K,); the first samples at rest.
        force: measured at the same instants [N], shape (K,).
        valid: samples to be used, shape (K,).
        time: of position[0] on the axis' clock [s].
        rest_force: force measured at rest before the move [N].
    """

    position: F64
    force: F64
    valid: NDArray[np.bool_]
    time: float
    rest_force: float


@dataclass(frozen=True, slots=True)
class Estimate:
    """What one move said.

    Attributes:
        accepted: whether the model was updated.
        reason: why not, else None.
        friction: the model in force afterwards.
        sigma: standard deviation of its coulomb [N], viscous [N s/m], stiffness [N/m] and
            relaxation_rate [1/s], by name.
        level: factor on the Coulomb force at the end of the move, 1 + w.
        zones: which zones were used: "A", "B", "AB" or "".
        misfit: rms of the whitened residual, the larger of both zones.
    """

    accepted: bool
    reason: str | None
    friction: Friction
    sigma: dict[str, float]
    level: float
    zones: str
    misfit: float


class SplitHorizonEstimator:
    """Friction of one axis, tracked from move to move.

    Args:
        friction: the model to start from.
        settings: of the estimation.
        frozen: keep the friction figures; only the friction state and the level are tracked.

    Attributes:
        friction: the model in force.
        state: friction state at rest after the last move; None until `at_rest` was called.
    """

    def __init__(
        self, friction: Friction, settings: EstimatorSettings, frozen: bool = False
    ) -> None:
        self.settings = settings
        self.friction = friction
        self.state: FrictionState | None = None
        self._start = friction
        self._frozen = frozen
        self._belief = Belief.at_start(settings.belief)
        self._time: float | None = None
        self._jump: F64 | None = None
        self._jumps = 0

    @property
    def level(self) -> float:
        """Factor on the Coulomb force at the end of the last move, 1 + w."""
        return 1.0 + float(self._belief.mean[LEVEL])

    @property
    def sigma(self) -> dict[str, float]:
        """Standard deviations of the friction figures, by name, in their units."""
        return {
            name: self._belief.spread(i) * float(getattr(self._start, name))
            for i, name in enumerate(FIGURES[:MASS])
        }

    def effective(self, time: float) -> Friction:
        """The model with the level expected at `time` [s]: what feedforward should use."""
        elapsed = 0.0 if self._time is None else time - self._time
        keep, _ = self.settings.belief.wander_variance(elapsed)
        level = 1.0 + keep * float(self._belief.mean[LEVEL])
        return replace(self.friction, coulomb=self.friction.coulomb * level)

    def at_rest(self, position: float, force: float, time: float) -> FrictionState:
        """Take the force measured at rest [N] as the sum of the element forces.

        The first call initialises the state, at `position` [m]; `time` [s] is that of the rest.
        """
        if self.state is None:
            self.state = FrictionState.relaxed(self.friction.elements, position)
        self.state.correct(force, self.effective(time))
        return self.state

    def update(self, move: MoveData) -> Estimate:
        """Learn from a move and carry the friction state to its end.

        A move that cannot be used leaves the model as it was and says why; the friction state
        follows the measured positions in any case.

        Raises:
            ValueError: shapes that differ, or fewer than three samples.
        """
        count = len(move.position)
        if len(move.force) != count or len(move.valid) != count:
            raise ValueError("position, force and valid must have the same length")
        first_move = self._time is None
        before = self.at_rest(float(move.position[0]), move.rest_force, move.time)
        usable = move.valid & np.isfinite(move.position) & np.isfinite(move.force)
        if usable.sum() < 3:
            raise ValueError("fewer than three valid samples")
        position = _bridged(move.position, usable)
        motion = differentiate(position, self.settings.period)
        # The first state after enabling is only known by its sum: its onset says nothing.
        zones = split(motion, float(position[0]), self.friction)
        usable &= np.abs(move.force) < self.settings.peak_force
        usable = usable[:-2] & usable[1:-1] & usable[2:]
        elapsed = 0.0 if self._time is None else move.time - self._time
        prior = self._belief.predicted(elapsed, self.settings.belief)
        window = MoveWindow(
            self._start, before, self.friction, motion, move.force[1:-1], float(position[0]),
            move.rest_force, self.settings.mass, self.settings.noise, self.settings.model_error,
            self.settings.period, self.settings.belief,
        )  # fmt: skip
        slide = zones.slide & usable
        moving = zones.moving & usable
        stick_counts = not first_move and int((zones.stick & usable).sum()) >= MIN_STICK
        belief, used, misfit, reason = self._solve(
            window, prior, slide if slide.sum() >= MIN_SLIDE else None,
            moving if stick_counts else None,
        )  # fmt: skip
        jumped = None if reason is not None else self._jumped(prior, belief)
        reason = reason or jumped
        if reason is None:
            self._jump, self._jumps = None, 0
            self._belief = belief
            self.friction = belief.friction(self._start)
        else:
            self._belief = self._after_refusal(prior, belief, jumped is not None)
        level_model = replace(self.friction, coulomb=self.friction.coulomb * self.level)
        self.state = window.final_state(level_model)
        self._time = move.time + (count - 1) * self.settings.period
        return Estimate(reason is None, reason, self.friction, self.sigma, self.level, used, misfit)

    def _solve(
        self,
        window: MoveWindow,
        prior: Belief,
        slide: NDArray[np.bool_] | None,
        moving: NDArray[np.bool_] | None,
    ) -> tuple[Belief, str, float, str | None]:
        """Zone A alone, then all that moved, stick zones included, from zone A's result.

        Zone A's samples count once: the second problem starts at its solution, but keeps the
        arrival cost from before the move.
        """
        belief, used, misfit = prior, "", 0.0
        for zone, mask, free in (("A", slide, _ZONE_A), ("B", moving, _ZONE_B)):
            if mask is None:
                continue
            if self._frozen:
                figures: tuple[int, ...] = (MASS,)
            elif used:  # a fast move hardly tells C; slow ones do
                figures = tuple(i for i in free if i != RATE)
            else:
                figures = free
            try:
                fit = window.fit(prior, mask, figures, self.settings.bounds, belief.mean)
            except (ValueError, np.linalg.LinAlgError) as error:
                return belief, used + zone, misfit, f"no solution in zone {zone}: {error}"
            doubt = self._doubt(fit)
            if doubt is not None:
                return belief, used + zone, fit.misfit, f"zone {zone}: {doubt}"
            belief, used, misfit = fit.belief, used + zone, max(misfit, fit.misfit)
        return belief, used, misfit, None if used else "too little motion to learn from"

    def _doubt(self, fit: Fit) -> str | None:
        """Why a fit cannot be trusted, or None."""
        if not (np.isfinite(fit.belief.mean).all() and np.isfinite(fit.belief.covariance).all()):
            return "the result is not finite"
        if fit.misfit > self.settings.misfit:
            return f"residual {fit.misfit:.1f} times what noise and wander explain"
        if fit.at_bound:
            return f"{FIGURES[fit.at_bound[0]]} ran into its bound"
        return None

    def _after_refusal(self, prior: Belief, found: Belief, jumped: bool) -> Belief:
        """What is believed after a refused move.

        Sound moves in a row that jump the same way: the stage has changed. Belief opens up to
        where it began, so that the next sound move is learned from; the model in force stays.
        Moves that could not be trusted say nothing.
        """
        if not jumped:
            return prior
        change = found.mean[:MASS] / prior.mean[:MASS] - 1.0
        same_way = self._jump is not None and float(change @ self._jump) > 0.5 * float(
            np.linalg.norm(change) * np.linalg.norm(self._jump)
        )
        self._jumps = self._jumps + 1 if same_way else 1
        self._jump = change
        if self._jumps < self.settings.patience:
            return prior
        self._jump, self._jumps = None, 0
        return Belief(prior.mean, Belief.at_start(self.settings.belief).covariance)

    def _jumped(self, prior: Belief, belief: Belief) -> str | None:
        """A change that drift cannot explain."""
        for i, name in enumerate(FIGURES[:MASS]):
            change = float(belief.mean[i] / prior.mean[i] - 1.0)
            allowed = max(
                self.settings.jump * prior.spread(i) / float(prior.mean[i]),
                self.settings.jump_share,
            )
            if abs(change) > allowed:
                return f"{name} jumps by {change:+.0%}"
        return None


def _bridged(position: F64, usable: NDArray[np.bool_]) -> F64:
    """Positions with the unusable samples bridged by straight lines."""
    if usable.all():
        return position
    index = np.arange(len(position))
    return np.interp(index, index[usable], position[usable])
