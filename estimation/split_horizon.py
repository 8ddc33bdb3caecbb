"""The split-horizon estimator: one move in, an updated friction model (or a reason) out.

Zone A (all elements slip) gives Coulomb force and viscous coefficient; then the stick zones (the
onset and what follows the first reversal) give presliding stiffness and relaxation rate, from zone
A's result. Each is a bounded least-squares problem with an arrival cost (source paper, equation
(4)); what the unknowns are and how belief ages: `belief`, how a move is solved: `window`.

An estimate is accepted or refused as a whole; a refused one leaves the last good model in force.
Not here: Stribeck figures, direction asymmetry, shape of the hysteresis.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
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
from estimation.gms import COULOMB as MODEL_COULOMB
from estimation.gms import F64, Friction, FrictionState, element_shares
from estimation.restlessness import Restlessness
from estimation.window import (
    R_BOUND,
    R_CHI_A,
    R_CHI_B,
    R_FAILED,
    R_SLIDE,
    R_STICK,
    REPORT_SIZE,
    estimate_move,
    final_state,
)

_LEARNED = 0.05
"""A level believed to this is not being learned any more: what it does then, the stage does."""
_TELLING = 0.5
"""A move that leaves more than this of the level's variance does not show the level."""
_ZONE_A = (COULOMB, VISCOUS, MASS)
_ZONE_B = (COULOMB, VISCOUS, STIFFNESS, RATE, MASS)
_ZONE_AB = (COULOMB, VISCOUS, STIFFNESS, MASS)  # a fast move hardly tells C; slow ones do


@dataclass(frozen=True, slots=True)
class EstimatorSettings:
    """How an axis is estimated.

    Attributes:
        mass: moved mass [kg].
        period: of the samples [s].
        position_noise: rms of a sampled position, encoder increment included [m].
        force_noise: rms of a sampled force, its resolution included [N].
        peak_force: samples at or beyond it are saturated and left out [N].
        model_error: rms of what the model itself misses, relative to the Coulomb force.
        belief: start and ageing of what is believed.
        bounds: lowest and highest value of each figure, relative to the start model.
        misfit: largest rms of the whitened residual that is accepted.
        jump: a change beyond so many predicted standard deviations, and beyond `jump_share`
            of the figure, is refused.
        complete: a move of which less than this share of the samples is valid is followed, but
            not learned from.
        patience: so many jumps in a row, the same way, mean that the stage has changed.
        fixed: figures that are never estimated, of `FIGURES`.
    """

    mass: float
    period: float
    position_noise: float
    force_noise: float
    peak_force: float = math.inf
    model_error: float = 0.01
    belief: BeliefSettings = field(default_factory=BeliefSettings)
    bounds: tuple[float, float] = (0.05, 20.0)
    misfit: float = 4.5
    jump: float = 6.0
    jump_share: float = 0.15
    complete: float = 0.8
    patience: int = 2
    fixed: tuple[str, ...] = ()

    def vector(self) -> F64:
        """The constants as `window.estimate_move` takes them."""
        return np.array(
            [
                self.period, self.mass, self.position_noise, self.force_noise, self.model_error,
                self.belief.wander, self.belief.correlation_time, *self.bounds, self.peak_force,
            ]
        )  # fmt: skip


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
        covariance: of those four in that order, shape (4, 4).
        gain: by how much the move narrowed each figure: standard deviation before over after,
            1 where it said nothing; by name, apparent mass included.
        mass: apparent mass and its standard deviation [kg] (see `belief`).
        level: factor on the Coulomb force at the end of the move, 1 + w.
        zones: which zones were used: "A", "B", "AB" or "".
        misfit: rms of the whitened residual over all samples used.
        shown: sliding level Fc (1 + w) at the move's end as the move alone shows it, what was
            believed before taken out again, and its standard deviation [N]; whether or not it was
            accepted. None where the move says nothing of it.
    """

    accepted: bool
    reason: str | None
    friction: Friction
    sigma: Mapping[str, float]
    covariance: F64
    gain: Mapping[str, float]
    mass: tuple[float, float]
    level: float
    zones: str
    misfit: float
    shown: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class Preview:
    """What a move says while it still goes on; nothing is updated by it.

    Attributes:
        friction: the model with the level it has now.
        state: friction state at the last sample but one.
        change: relative change of the sliding force that it means.
    """

    friction: Friction
    state: FrictionState
    change: float


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
        self._belief = Belief.at_start(settings.belief)
        self._time: float | None = None
        self._rest: float | None = None
        self._restless = Restlessness()
        self._frozen = frozen
        self._jump: F64 | None = None
        self._jumps = 0
        # What the kernel takes, made once.
        self._constants = settings.vector()
        self._figures = np.array(
            [
                friction.coulomb, friction.viscous, friction.stiffness, friction.relaxation_rate,
                settings.mass,
            ]
        )  # fmt: skip
        self._shape = friction.vector()
        self._shares = element_shares(friction.elements)
        self._report = np.zeros(REPORT_SIZE)
        fixed = {FIGURES.index(name) for name in settings.fixed}
        if frozen:
            fixed |= {COULOMB, VISCOUS, STIFFNESS, RATE}
        self._zone_a, self._zone_b, self._zone_ab = (
            np.array([i in zone and i not in fixed for i in range(LEVEL)])
            for zone in (_ZONE_A, _ZONE_B, _ZONE_AB)
        )

    @property
    def level(self) -> float:
        """Factor on the Coulomb force at the end of the last move, 1 + w."""
        return 1.0 + float(self._belief.mean[LEVEL])

    @property
    def sigma(self) -> dict[str, float]:
        """Standard deviations of the friction figures, by name, in their units."""
        spread = np.sqrt(self._belief.covariance.diagonal()[:MASS]) * self._figures[:MASS]
        return dict(zip(FIGURES, spread.tolist(), strict=False))

    @property
    def covariance(self) -> F64:
        """Of the four friction figures, in their units, shape (4, 4)."""
        scale = self._figures[:MASS]
        covariance: F64 = self._belief.covariance[:MASS, :MASS] * np.outer(scale, scale)
        return covariance

    def _mass(self) -> tuple[float, float]:
        mass = float(self._figures[MASS])
        return mass * float(self._belief.mean[MASS]), mass * self._belief.spread(MASS)

    def believe(self, figures: Mapping[str, tuple[float, float]]) -> None:
        """Begin from figures that were learned before instead of from the start model.

        Bounds stay relative to the start model.

        Args:
            figures: value and standard deviation of coulomb [N], viscous [N s/m], stiffness [N/m]
                and relaxation_rate [1/s], by name; those that are missing stay.
        """
        for i, name in enumerate(FIGURES[:MASS]):
            if name in figures:
                value, sigma = figures[name]
                self._belief.mean[i] = value / self._figures[i]
                self._belief.covariance[i, i] = (sigma / self._figures[i]) ** 2
        self.friction = self._belief.friction(self._start)

    def expect(
        self, coulomb: float, sigma: float, level: tuple[float, float] | None = None
    ) -> None:
        """The next move ends at another place, whose Coulomb force is known from elsewhere.

        The move's data have to be made level with that place (see `stagectl.compensation`). The
        element forces are carried over as a change of Coulomb force is: they scale with it.

        Args:
            coulomb: Fc there [N].
            sigma: its standard deviation [N].
            level: w at the end of the last move and its standard deviation, where it is known
                better than from the moves of this axis.
        """
        self._restless.calm()
        mean, covariance = self._belief.mean, self._belief.covariance
        factor = coulomb / self.friction.coulomb
        figure = float(self._figures[COULOMB])
        for i, entry in ((COULOMB, (coulomb / figure, sigma / figure)), (LEVEL, level)):
            if entry is not None:
                covariance[i, :] = 0.0
                covariance[:, i] = 0.0
                mean[i] = entry[0]
                covariance[i, i] = entry[1] ** 2 + 1e-12
        self.friction = self._belief.friction(self._start)
        if self.state is not None:
            self.state.rescale(factor)

    def forget_state(self) -> None:
        """The axis has moved unobserved: its friction state is unknown, as before the first move.

        The figures stay; the level is forgotten.
        """
        self.state = self._time = self._rest = None
        self._restless.calm()
        self._belief = self._belief.predicted(math.inf, self.settings.belief)

    def effective(self, time: float) -> Friction:
        """The model with the level expected at `time` [s]: what feedforward should use."""
        elapsed = 0.0 if self._time is None else time - self._time
        keep, _ = self.settings.belief.wander_variance(elapsed)
        level = 1.0 + keep * float(self._belief.mean[LEVEL])
        return replace(self.friction, coulomb=self.friction.coulomb * level)

    def at_rest(self, position: float, force: float, time: float) -> FrictionState:
        """Take the force measured at rest [N] as the sum of the element forces.

        The first call initialises the state, at `position` [m]; `time` [s] is that of the rest.
        The position is also where the next move begins, should its first samples be lost.
        """
        self._rest = position
        return self._corrected(position, force, time)

    def _corrected(self, position: float, force: float, time: float) -> FrictionState:
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
        position, force, valid = _cleaned(move, self._rest)
        self._rest = None
        first_move = self._time is None
        state = self._corrected(float(position[0]), move.rest_force, move.time)
        elapsed = 0.0 if self._time is None else move.time - self._time
        prior = self._aged(elapsed)
        found = Belief(prior.mean.copy(), prior.covariance.copy())
        known, report = self.friction.coulomb, self._report
        # The first state after enabling is only known by its sum: its onset says nothing.
        estimate_move(
            position, force, valid, self._constants, self._figures, self._shape, self._shares,
            known, state.forces, state.slipping, state.memory[0], move.rest_force, found.mean,
            found.covariance, self._zone_a, self._zone_b, self._zone_ab, not first_move, report,
        )  # fmt: skip
        share = float(valid.mean())
        slide, stick = report[R_SLIDE] > 0, report[R_STICK] > 0
        used = ("A" if slide else "") + ("B" if stick else "")
        # Zone A alone still has the old stiffness in its beginning: the whole move judges.
        misfit = math.sqrt(report[R_CHI_B] if stick else report[R_CHI_A])
        if share < self.settings.complete:
            reason: str | None = f"only {share:.0%} of the samples can be used"
        elif used:
            reason = self._doubt(found, misfit)
        else:
            reason = "too little motion to learn from"
        shown = Belief(found.mean.copy(), found.covariance.copy())
        jumped = None if reason is not None else self._jumped(prior, found)
        reason = reason or jumped
        if reason is None:
            self._jump, self._jumps = None, 0
            self._belief = found = _tempered(prior, found, misfit)
            self.friction = found.friction(self._start)
        else:
            self._belief = self._after_refusal(prior, found, jumped is not None)
        model = self.friction.vector()
        model[MODEL_COULOMB] *= self.level
        final_state(
            position, valid, self.settings.period, model, self._shares, known, state.forces,
            state.slipping, state.memory, move.rest_force,
        )  # fmt: skip
        self._time = move.time + (count - 1) * self.settings.period
        alone = self._shown(prior, shown)
        if reason is None:
            self._watch(prior, alone, (count - 1) * self.settings.period)
        narrowed = np.sqrt(prior.covariance.diagonal() / self._belief.covariance.diagonal())
        return Estimate(
            reason is None, reason, self.friction, self.sigma, self.covariance,
            dict(zip(FIGURES, narrowed.tolist(), strict=False)), self._mass(), self.level, used,
            misfit, alone,
        )  # fmt: skip

    def _aged(self, elapsed: float) -> Belief:
        """The belief one move later."""
        prior = self._belief.predicted(elapsed, self.settings.belief)
        prior.covariance[COULOMB, COULOMB] += (
            self._restless.variance * float(prior.mean[COULOMB]) ** 2
        )
        return prior

    def _watch(self, prior: Belief, shown: tuple[float, float] | None, duration: float) -> None:
        """Compare the level that a sound move showed with the one expected."""
        if shown is None or self._frozen:
            return
        before, variance = _sliding(prior)
        value = shown[0] / float(self._figures[COULOMB]) / before
        _, wandered = self.settings.belief.wander_variance(duration)
        believed = variance / before**2 - self._restless.variance
        if believed < _LEARNED**2:
            sigma = shown[1] / float(self._figures[COULOMB]) / before
            self._restless.saw(value - 1.0, believed + wandered + sigma**2)

    def _shown(self, prior: Belief, found: Belief) -> tuple[float, float] | None:
        """The sliding level that the move alone shows [N]: belief after minus belief before."""
        if self._report[R_FAILED] or not np.isfinite(found.mean).all():
            return None
        before, variance_before = _sliding(prior)
        after, variance = _sliding(found)
        if not 0.0 < variance < _TELLING * variance_before:
            return None
        figure = float(self._figures[COULOMB])
        share = variance_before / (variance_before - variance)
        value = before + (after - before) * share
        return (value * figure, math.sqrt(variance * share) * figure) if value > 0.0 else None

    def preview(self, move: MoveData) -> Preview | None:
        """Solve zone A of a move that is not over; None where it says nothing sound yet.

        Args:
            move: from rest up to now.

        Raises:
            ValueError: fewer than three valid samples.
        """
        if self.state is None:
            return None
        position, force, valid = _cleaned(move, self._rest)
        elapsed = 0.0 if self._time is None else move.time - self._time
        prior = self._aged(elapsed)
        found = Belief(prior.mean.copy(), prior.covariance.copy())
        known, report, state = self.friction.coulomb, self._report, self.state.copy()
        estimate_move(
            position, force, valid, self._constants, self._figures, self._shape, self._shares,
            known, state.forces, state.slipping, state.memory[0], move.rest_force, found.mean,
            found.covariance, self._zone_a, self._zone_b, self._zone_ab, False, report,
        )  # fmt: skip
        misfit = math.sqrt(report[R_CHI_A])
        if report[R_SLIDE] <= 0 or self._doubt(found, misfit) is not None:
            return None
        model = found.friction(self._start)
        model = replace(model, coulomb=model.coulomb * (1.0 + float(found.mean[LEVEL])))
        final_state(
            position, valid, self.settings.period, model.vector(), self._shares, known,
            state.forces, state.slipping, state.memory, move.rest_force,
        )  # fmt: skip
        speed = float(np.abs(np.diff(position)).max()) / self.settings.period
        before = self.effective(move.time)
        change = (model.coulomb + model.viscous * speed) / (
            before.coulomb + before.viscous * speed
        ) - 1.0
        return Preview(model, state, change)

    def _doubt(self, found: Belief, misfit: float) -> str | None:
        """Why a fit cannot be trusted, or None."""
        report = self._report
        if report[R_FAILED] or not (
            np.isfinite(found.mean).all() and np.isfinite(found.covariance).all()
        ):
            return "the problem has no solution"
        if not misfit <= self.settings.misfit:
            return f"residual {misfit:.1f} times what noise and wander explain"
        if report[R_BOUND] >= 0:
            return f"{FIGURES[int(report[R_BOUND])]} ran into its bound"
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


def _sliding(belief: Belief) -> tuple[float, float]:
    """Fc (1 + w), relative, and its variance."""
    coulomb, level = float(belief.mean[COULOMB]), 1.0 + float(belief.mean[LEVEL])
    c = belief.covariance
    variance = (
        level**2 * c[COULOMB, COULOMB]
        + 2.0 * level * coulomb * c[COULOMB, LEVEL]
        + coulomb**2 * c[LEVEL, LEVEL]
    )
    return coulomb * level, float(variance)


def _cleaned(move: MoveData, rest: float | None) -> tuple[F64, F64, NDArray[np.bool_]]:
    """Position, force and valid without anything that is not finite; holes in position bridged.

    Where the first sample is lost, the bridge begins at `rest`, where the axis was before [m]: all
    that it moved stretched its elements, seen or not.

    Raises:
        ValueError: fewer than three valid samples.
    """
    position, force, valid = move.position, move.force, move.valid
    if not (valid.all() and math.isfinite(float(position.sum() + force.sum()))):
        valid = valid & np.isfinite(position) & np.isfinite(force)
        index, known = np.arange(len(position)), valid
        if valid.sum() >= 3:
            if rest is not None and not valid[0]:
                known, position = valid.copy(), position.copy()
                known[0], position[0] = True, rest
            position = np.interp(index, index[known], position[known])
        force = np.where(valid, force, 0.0)
    if valid.sum() < 3:
        raise ValueError("fewer than three valid samples")
    return position, force, valid


def _tempered(prior: Belief, found: Belief, misfit: float) -> Belief:
    """What is believed where the residual is `misfit` times what noise explains.

    The move's information counts by 1/misfit^2, as if its noise had been that much larger. A
    figure of which nothing is free keeps what was found.
    """
    if misfit <= 1.0:
        return found
    free = found.covariance.diagonal() < prior.covariance.diagonal() * (1.0 - 1e-9)
    if not free.any():
        return found
    chosen = np.ix_(free, free)
    before = np.linalg.inv(prior.covariance[chosen])
    after = np.linalg.inv(found.covariance[chosen])
    share = 1.0 / misfit**2
    information = before + share * (after - before)
    covariance = np.linalg.inv(information)
    pull = (1.0 - share) * before @ prior.mean[free] + share * after @ found.mean[free]
    mean, whole = found.mean.copy(), found.covariance.copy()
    mean[free] = covariance @ pull
    whole[chosen] = covariance
    return Belief(mean, whole)
