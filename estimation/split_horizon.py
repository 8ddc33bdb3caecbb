"""The split-horizon estimator: one move in, an updated friction model (or a reason) out.

Zone A (all elements slip) gives Coulomb force, viscous coefficient and apparent mass; then all that
is usable gives the rest, from zone A's result. Each is a bounded least-squares problem with an
arrival cost (source paper, equation (4)). What the unknowns are: `belief`; how a move is solved:
`window`; how belief ages and an estimate is judged: `update`.

An estimate is accepted or refused as a whole; a refused one leaves the last good model in force.
Not here: Stribeck velocity and shape, direction asymmetry, shape of the hysteresis.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from estimation.belief import (
    ALPHA,
    COULOMB,
    FIGURES,
    LAG,
    LEVEL,
    MASS,
    RATE,
    STIFFNESS,
    VISCOUS,
    Belief,
    BeliefSettings,
    model_at,
)
from estimation.elements import ELEMENT_ROWS, FORCE, SHARES, SLIPS
from estimation.estimate import Estimate, in_units, spreads
from estimation.gms import F64, Friction, FrictionState, element_shares
from estimation.restlessness import Restlessness
from estimation.rows import KNOTS, T_POSITION, TABLES, fill_rows
from estimation.update import (
    ACCEPTED,
    F_DRIFT,
    JUMP,
    STILL,
    U_FOUND,
    U_LEVEL,
    U_MEAN,
    U_NUMBER,
    U_VERDICT,
    UPDATE_SIZE,
    begin_update,
    end_update,
)
from estimation.window import (
    F_UNIT,
    R_BOUND,
    R_CHI_A,
    R_CHI_B,
    R_FAILED,
    R_KNOWN,
    R_SLIDE,
    R_STICK,
    fit,
    knots_of,
)
from estimation.zones import SLIDE, STICK

__all__ = ["Estimate", "EstimatorSettings", "MoveData", "Preview", "SplitHorizonEstimator"]

_LEARNED = 0.05
"""A level believed to this is not being learned any more: what it does then, the stage does."""
FULL_SLIP = 2.0
"""C/Fc is learned from moves of so many breakaway travels and more: shorter ones end among elements
of which only the sum was known at rest, and what that leaves open would go into it."""
SURE = 0.15
"""A move that was refused leaves the elements' forces known where Fc and sigma0 are known to this,
relative: else they have been followed with a wrong model."""
_BYTE = np.int8
_ZONE_A = (COULOMB, VISCOUS, MASS)
_ZONE_B = (COULOMB, VISCOUS, STIFFNESS, RATE, MASS)
_ZONE_AB = (COULOMB, VISCOUS, STIFFNESS, MASS)  # a fast move hardly tells C; slow ones do
_REQUESTS = ("relaxation_rate", "static_ratio", "lag")


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
        request: figures to estimate in every move beside the usual ones: relaxation_rate (that is
            C; else from moves without zone A only), static_ratio (alpha), lag.
        least_gain: a figure of which a move says less than this times its prior's information
            stays at its prior; 0 updates whatever it says.
        slip_spread: deviation of the element forces where zone A begins from what a fresh slip
            leaves, relative to the Coulomb force; 0 takes them from the onset.
        force_step: resolution of the force [N]; None: found out where rounding is all its noise.
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
    request: tuple[str, ...] = ()
    least_gain: float = 0.05
    slip_spread: float = 0.0
    force_step: float | None = None

    def constants(self, friction: Friction) -> F64:
        """The constants as `update_move` takes them, shape (ALL_CONSTANTS,)."""
        return np.array(
            [
                self.period, self.position_noise, self.force_noise, self.model_error,
                self.belief.wander, self.belief.correlation_time, self.peak_force,
                self.slip_spread, -1.0 if self.force_step is None else self.force_step,
                friction.stribeck_velocity, friction.stribeck_shape, self.complete, self.misfit,
                self.jump, self.jump_share, self.least_gain,
            ]
        )  # fmt: skip

    def units(self, friction: Friction) -> F64:
        """The table of figures as `update_move` takes it, shape (4, LEVEL)."""
        unit = [
            friction.coulomb, friction.viscous, friction.stiffness, friction.relaxation_rate,
            self.mass, 1.0, 1.0,
        ]  # fmt: skip
        low, high = self.bounds
        return np.array(
            [
                unit, [low] * 5 + [-0.9, -1.5], [high] * 5 + [5.0, 1.5], self.belief.drift,
            ]
        )  # fmt: skip

    def masks(self, frozen: bool) -> NDArray[np.bool_]:
        """Figures to solve for in zone A, without it, and with both, shape (3, LEVEL).

        Raises:
            ValueError: a name that there is not.
        """
        for name in (*self.fixed, *self.request):
            if name not in FIGURES:
                raise ValueError(f"{name}: no such figure; there are {', '.join(FIGURES)}")
        fixed = {FIGURES.index(name) for name in self.fixed}
        if frozen:
            fixed |= {COULOMB, VISCOUS, STIFFNESS, RATE, ALPHA, LAG}
        wanted = {FIGURES.index(name) for name in self.request if name in _REQUESTS}
        masks = np.zeros((3, LEVEL), dtype=np.bool_)
        zones = (
            {*_ZONE_A, *(wanted & {LAG})}, {*_ZONE_B, *wanted}, {*_ZONE_AB, *wanted},
        )  # fmt: skip
        for row, zone in enumerate(zones):
            masks[row, sorted(zone - fixed)] = True
        return masks


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
        state: friction state before the first move where it is known, as after a slip; else only
            the sum of the element forces is, and the onset of the first move says nothing.

    Attributes:
        settings: of the estimation.
        state: friction state at rest after the last move; None until it is known.

    Raises:
        ValueError: settings that name a figure that there is not.
    """

    def __init__(
        self,
        friction: Friction,
        settings: EstimatorSettings,
        frozen: bool = False,
        state: FrictionState | None = None,
    ) -> None:
        self.settings = settings
        self.state = state
        self._start = friction
        self._belief = Belief.at_start(settings.belief, friction)
        self._known = state is not None
        self._end: float | None = None
        self._rest: float | None = None
        self._restless = Restlessness()
        self._frozen = frozen
        self._jump: F64 | None = None
        self._jumps = 0
        # What the kernel takes, made once.
        self._constants = settings.constants(friction)
        self._units = settings.units(friction)
        self._figures = np.ascontiguousarray(self._units[F_UNIT])
        self._shape = np.array([friction.stribeck_velocity, friction.stribeck_shape])
        self._masks = settings.masks(frozen)
        self._masks_short = self._masks.copy()
        self._masks_short[:, RATE] = False
        self._shares = element_shares(friction.elements).copy()  # as the kernels take it

    @property
    def friction(self) -> Friction:
        """The model in force."""
        return model_at(self._start, self._belief.mean)

    @property
    def level(self) -> float:
        """Factor on the Coulomb force at the end of the last move, 1 + w."""
        return 1.0 + float(self._belief.mean[LEVEL])

    @property
    def sigma(self) -> dict[str, float]:
        """Standard deviations of the friction figures, by name, in their units."""
        return spreads(np.sqrt(self._belief.covariance.diagonal()), self._start)

    @property
    def covariance(self) -> F64:
        """Of the four friction figures, in their units, shape (4, 4)."""
        return in_units(self._belief.covariance, self._start)

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
                unit = float(self._units[F_UNIT, i])
                self._belief.set_apart(i, value / unit, sigma / unit)

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
        factor = coulomb / self.friction.coulomb
        unit = self._start.coulomb
        self._belief.set_apart(COULOMB, coulomb / unit, sigma / unit)
        if level is not None:
            self._belief.set_apart(LEVEL, *level)
        if self.state is not None:
            self.state.rescale(factor)

    def forget_state(self) -> None:
        """The axis has moved unobserved: its friction state is unknown, as before the first move.

        The figures stay; the level is forgotten.
        """
        self.state = self._end = self._rest = None
        self._restless.calm()
        self._known = False
        self._belief.set_apart(LEVEL, 0.0, self.settings.belief.wander)

    def effective(self, time: float) -> Friction:
        """The model with the level expected at `time` [s]: what feedforward should use."""
        elapsed = 0.0 if self._end is None else max(time - self._end, 0.0)
        keep = math.exp(-elapsed / self.settings.belief.correlation_time)
        friction = self.friction
        level = 1.0 + keep * float(self._belief.mean[LEVEL])
        return replace(friction, coulomb=friction.coulomb * level)

    def at_rest(self, position: float, force: float, time: float) -> FrictionState:
        """Take the force measured at rest [N] as the sum of the element forces.

        The first call initialises the state, at `position` [m]; `time` [s] is that of the rest.
        The position is also where the next move begins, should its first samples be lost.
        """
        self._rest = position
        if self.state is None:
            self.state = FrictionState.relaxed(self._start.elements, position)
        self.state.correct(force, self.effective(time))
        return self.state

    def update(self, move: MoveData) -> Estimate:
        """Learn from a move and carry the friction state to its end.

        A move that cannot be used leaves the model as it was and says why; the friction state
        follows the measured positions in any case.

        Raises:
            ValueError: shapes that differ, or fewer than three valid samples.
        """
        state = self.state
        if state is None:
            state = self.state = FrictionState.relaxed(self._start.elements)
        # An onset of which the beginning is not known says nothing.
        begun = self._rest is not None or (len(move.valid) > 0 and bool(move.valid[0]))
        result = self._run(move, state, self._known and begun, True)
        if result[U_VERDICT] == ACCEPTED:
            self._jumps = 0
        elif result[U_VERDICT] == JUMP:
            self._open_up(result)
        self._end = move.time + (len(move.position) - 1) * self.settings.period
        # Followed with figures that are wrong, elements end up with the wrong forces.
        self._known = (
            self._frozen
            or result[U_VERDICT] == ACCEPTED
            or (result[U_VERDICT] == STILL and self._known)
            or self._sure()
        )
        self._rest = None
        estimate = Estimate(result, self._start, self.settings.mass, self.settings.period)
        if estimate.accepted and not self._frozen:
            self._watch(estimate, self._end - move.time)
        return estimate

    def _sure(self) -> bool:
        """Whether the figures in force are known well enough to follow the elements with."""
        sigma = np.sqrt(self._belief.covariance.diagonal()) / self._belief.mean.clip(1e-9)
        return bool(sigma[COULOMB] < SURE and sigma[STIFFNESS] < SURE)

    def _watch(self, estimate: Estimate, duration: float) -> None:
        """Compare the level that a sound move showed with the one expected."""
        shown = estimate.shown
        if shown is None:
            return
        expected, sigma = estimate.expected
        believed = (sigma / expected) ** 2 - self._restless.variance
        _, wandered = self.settings.belief.wander_variance(duration)
        if believed < _LEARNED**2:
            variance = believed + wandered + (shown[1] / expected) ** 2
            self._restless.saw(shown[0] / expected - 1.0, variance)

    def preview(self, move: MoveData) -> Preview | None:
        """Solve zone A of a move that is not over; None where it says nothing sound yet.

        Args:
            move: from rest up to now.

        Raises:
            ValueError: fewer than three valid samples.
        """
        if self.state is None:
            return None
        state = self.state.copy()
        result = self._run(move, state, False, False)
        if result[U_VERDICT] != ACCEPTED or result[R_SLIDE] <= 0.0:
            return None
        model = model_at(self._start, result[U_MEAN : U_MEAN + LEVEL])
        model = replace(model, coulomb=model.coulomb * float(result[U_LEVEL]))
        speed = float(np.nanmax(np.abs(np.diff(move.position)))) / self.settings.period
        before = self.effective(move.time)
        change = (model.coulomb + model.viscous * speed) / (
            before.coulomb + before.viscous * speed
        ) - 1.0
        return Preview(model, state, change)

    def _run(self, move: MoveData, state: FrictionState, known: bool, whole: bool) -> F64:
        """Learn from a move, unless it is not over (`whole`), and carry `state` to its end."""
        samples = len(move.position)
        if len(move.force) != samples or len(move.valid) != samples:
            raise ValueError("position, force and valid must have the same length")
        rows = max(samples - 2, 0)
        result = np.empty(UPDATE_SIZE)
        tables, heading, zone = (
            np.empty((TABLES, samples)),
            np.empty(rows, _BYTE),
            np.empty(rows, _BYTE),
        )
        usable, ready = np.empty(rows, np.bool_), np.zeros(rows, np.bool_)
        size = LEVEL + 1
        before, found = np.empty(size), np.empty(size)
        spread, uncertain = np.empty((size, size)), np.empty((size, size))
        mean, covariance = self._belief.mean, self._belief.covariance
        constants, units, shares = self._constants, self._units, self._shares
        elapsed = -1.0 if self._end is None else move.time - self._end
        restless = self._restless.variance * float(mean[COULOMB]) ** 2
        units[F_DRIFT, COULOMB] = math.hypot(
            self.settings.belief.drift[COULOMB], math.sqrt(restless)
        )
        begin_update(
            move.position, move.force, move.valid, math.nan if self._rest is None else self._rest,
            move.rest_force, elapsed, constants, units,
            shares, mean, covariance, state.forces, known, whole, tables, heading, zone, usable,
            before, spread, result,
        )  # fmt: skip
        if result[U_NUMBER] < 3:
            raise ValueError("fewer than three valid samples")
        wander = self.settings.belief.wander
        p = np.zeros(KNOTS + knots_of(rows, self.settings.period, wander))
        p[:LEVEL] = before[:LEVEL]
        found[:], uncertain[:] = before, spread
        slide, stick = result[R_SLIDE] > 0.0, result[R_STICK] > 0.0
        travel = abs(float(tables[T_POSITION, -1] - tables[T_POSITION, 0]))
        masks = self._masks if travel > FULL_SLIP * self._breakaway(before) else self._masks_short
        for zone_from, mask in ((SLIDE, masks[0]), (STICK, masks[2 if slide else 1])):
            if not (stick if zone_from == STICK else slide):
                continue
            if result[R_FAILED] == 0.0 and result[R_BOUND] < 0.0:
                fit(
                    zone_from, tables, heading, zone, usable, ready, constants, units, shares,
                    state.forces, before, spread, found, uncertain, mask, p, result,
                )  # fmt: skip
        misfit = math.sqrt(result[R_CHI_B] if stick else result[R_CHI_A])
        if whole and result[R_FAILED] == 0.0 and 1.0 < misfit <= self.settings.misfit:
            belief = _tempered(Belief(before, spread), Belief(found, uncertain), misfit)
            if not self._jumps_away(before, spread, found):  # that is for `end_update` to see
                found[:], uncertain[:] = belief.mean, belief.covariance
        at_end = np.empty(KNOTS)
        end_update(
            samples, constants, self._masks, before, spread, found, uncertain, whole, mean,
            covariance, at_end, result,
        )  # fmt: skip
        ready[:] = False
        elements = np.empty((ELEMENT_ROWS, len(shares) + 1))
        elements[SHARES, :-1] = shares
        fill_rows(
            at_end, 0, self._figures, self._shape, self.settings.position_noise,
            self.settings.period, state.forces, result[R_KNOWN], move.rest_force, tables, heading,
            ready, False, np.empty((KNOTS, rows)), elements,
        )  # fmt: skip
        state.forces[:] = elements[FORCE, :-1]
        state.slipping[:] = elements[SLIPS, :-1] > 0.0
        state.memory[1] = tables[T_POSITION, -2]
        going = heading[heading != 0]
        if len(going):
            state.memory[0] = going[-1]
        return result

    def _jumps_away(self, before: F64, spread: F64, found: F64) -> bool:
        """Whether a figure changes by more than drift can explain."""
        change = np.abs(found[:MASS] / before[:MASS] - 1.0)
        sigma = np.sqrt(spread.diagonal()[:MASS]) / before[:MASS]
        allowed = np.maximum(self.settings.jump * sigma, self.settings.jump_share)
        return bool((change > allowed).any())

    def _breakaway(self, mean: F64) -> float:
        """Travel from rest to where all elements slip, at most [m]."""
        shares, alpha = self._shares, float(mean[ALPHA])
        stiffness = float(self._figures[STIFFNESS] * mean[STIFFNESS])
        coulomb = float(self._figures[COULOMB] * mean[COULOMB])
        return float(shares[-1]) * (1.0 + alpha) * coulomb * len(shares) / stiffness

    def _open_up(self, result: F64) -> None:
        """Sound moves in a row that jump the same way: the stage has changed.

        Belief opens up to where it began, so that the next sound move is learned from; the model in
        force stays. Moves that could not be trusted say nothing.
        """
        change = result[U_FOUND : U_FOUND + MASS] / result[U_MEAN : U_MEAN + MASS] - 1.0
        same_way = (
            self._jumps > 0
            and self._jump is not None
            and float(change @ self._jump)
            > 0.5 * float(np.linalg.norm(change) * np.linalg.norm(self._jump))
        )
        self._jumps = self._jumps + 1 if same_way else 1
        self._jump = change
        if self._jumps >= self.settings.patience:
            self._jumps = 0
            start = Belief.at_start(self.settings.belief, self._start)
            self._belief.covariance[:] = start.covariance


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
