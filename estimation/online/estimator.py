"""The split-horizon estimator: one move in, an updated friction model (or a reason) out.

A moving-horizon estimator whose horizon is one move, split in two. Zone A, where all slides, gives
Coulomb force, viscous coefficient and apparent mass; then all usable samples give the rest, from
zone A's solution. Each is a bounded least-squares problem with an arrival cost (source paper,
equation (4)). What the unknowns are: `belief`; how a move is solved: `solve`; how belief ages:
`arrival_cost`; how an estimate is judged: `judge`.

An estimate is accepted or refused as a whole; a refused one leaves the last good model in force.
Not estimated here: Stribeck velocity and shape, direction asymmetry, shape of the hysteresis; what
the last leaves open of sigma0 is in its sigma.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from estimation.friction.model import FrictionState, breakaway_travel, count_states, make_constants
from estimation.friction.shape import stiffness_doubt
from estimation.move import MoveData
from estimation.online.belief.arrival_cost import copy
from estimation.online.belief.belief import (
    ALPHA,
    COULOMB,
    FIGURES,
    FORCE,
    LEVEL,
    MASS,
    STIFFNESS,
    Belief,
    model_at,
)
from estimation.online.belief.excess import learn_excess
from estimation.online.belief.scatter import learn_scatter
from estimation.online.belief.trend import Trend
from estimation.online.estimate import Estimate, in_own_units, sliding_shown
from estimation.online.judge import SHOWS_SCALE, scale_covariance
from estimation.online.outcome import ACCEPTED, BOUND, JUMP, SCALE, STILL, Outcome
from estimation.online.settings import EstimatorSettings
from estimation.online.solver.prepare import FULL_SLIP, Sampled
from estimation.online.update import State, update_move
from stagedata import F64, FrictionFigures

_NONE = np.zeros(0, np.bool_)
_LEARNED = 0.05
"""Relative sigma of the level below which its changes count as the stage's own, not as learning."""
_LEAST_SHOWN = 0.98
"""A move that leaves more than this share of the level's variance is not used for the trend."""
_FEW, _RECENT = 3, 15
"""Number of accepted moves beyond which the usual misfit is known, and number of the latest ones
whose median it is."""
_PATIENCE = 2
"""This many jumps in a row in the same direction mean that the stage has changed."""
_MOVES = 15
"""Number of moves over which scatter and what acts beside the model are averaged."""
_GUESS = 0.3
"""Weight of the initial guess of such a variance, in moves."""
CERTAIN = 0.3
"""Relative sigma of Fc and sigma0 up to which the friction state is still known behind a move that
was refused or whose onset was not seen: with less certain figures it has been followed with a wrong
model."""


@dataclass(frozen=True, slots=True)
class Preview:
    """What a move shows while it is still in progress; nothing is updated by it.

    Attributes:
        friction: the model with the level it has now.
        state: friction state at the last sample but one.
        change: relative change of the sliding force that it means.
    """

    friction: FrictionFigures
    state: FrictionState
    change: float


class SplitHorizonEstimator:
    """Friction of one axis, tracked from move to move.

    Args:
        friction: the model to start from.
        settings: of the estimation.
        frozen: keep the friction figures; only the friction state and the level are tracked.
        state: friction state before the first move, if it is known, as after a slip; else only the
            sum of the internal forces is known, and the onset of the first move is not used.

    Attributes:
        settings: of the estimation.
        state: friction state at rest after the last move; None until it is known.

    Raises:
        ValueError: settings that name an unknown figure.
    """

    def __init__(
        self,
        friction: FrictionFigures,
        settings: EstimatorSettings,
        frozen: bool = False,
        state: FrictionState | None = None,
    ) -> None:
        if frozen:  # nothing has to be kept out of figures that stay
            settings = replace(
                settings,
                belief=replace(settings.belief, unmodelled=0.0, variation=0.0, scatter=0.0),
            )
        self.settings = settings
        self.state = state
        self._start = friction
        self._belief = Belief.at_start(settings.belief, friction)
        self._local = 1.0  # Coulomb force where the axis is, over the one that is estimated
        self._known = state is not None
        self._moves_to_trust = 0
        self._end: float | None = None
        self._carried: float | None = None  # until when the Coulomb force has followed its trend
        self._rest: float | None = None
        self._trend = Trend(settings.belief)
        self._aged = 0.0
        self._tracked_elsewhere = False
        self._before = (1.0, 1.0)  # Coulomb force before a move and its variance, relative
        self._drift = settings.belief.drift[COULOMB] ** 2
        self._misfits: deque[float] = deque(maxlen=_RECENT)
        self._frozen = frozen
        self._jump: F64 | None = None
        self._jumps = 0
        # How much the factor on each figure's variance weighs, in moves that determine it.
        self._informed = np.full(MASS, _GUESS)
        # The same of what each figure differs by from move to move.
        self._scatter_weights = np.full(MASS, _GUESS)
        # How much each variance of `learn_excess` weighs, in moves that determine it.
        self._weights = np.array([1.0, _GUESS, _GUESS])
        self._other_scale: float | None = None  # change of force per acceleration
        self._right: Belief | None = None  # belief when there was none
        self._axis = settings.axis(friction, frozen)
        self._scatter, self._scale = self._axis["scatter"], self._axis["scale"]  # views of it
        self._drifts = self._axis["drift"]
        self._law = make_constants(friction)
        self._facts = (friction, settings.mass, settings.period)

    @property
    def friction(self) -> FrictionFigures:
        """The model in force."""
        return model_at(self._start, self._belief.mean)

    @property
    def level(self) -> float:
        """The factor 1 + w on the Coulomb force at the end of the last move."""
        return 1.0 + float(self._belief.mean[LEVEL])

    @property
    def unmodelled_force(self) -> tuple[float, float]:
        """What acts at the end of the last move beside friction and m a, and its sigma [N]."""
        variance = float(self._belief.covariance[FORCE, FORCE])
        coulomb = self._start.coulomb
        return coulomb * float(self._belief.mean[FORCE]), coulomb * math.sqrt(variance)

    @property
    def sigma(self) -> dict[str, float]:
        """Standard deviations of the friction figures, by name, in their units.

        As those of the last accepted estimate, they count what the moves disagree by.
        """
        spread = self._spread()
        shape = self._shape_doubt() * float(self._belief.mean[STIFFNESS])
        spread[STIFFNESS] = math.hypot(spread[STIFFNESS], shape)
        return in_own_units(spread, self._start)

    @property
    def sigma_by_moves(self) -> dict[str, float]:
        """As `sigma` (SI), without what no move determines: the shape of the hysteresis."""
        return in_own_units(self._spread(), self._start)

    def _spread(self) -> F64:
        """Standard deviations of the friction figures, relative to those of the start model."""
        factor = np.sqrt(np.maximum(self._axis["scale"][:MASS], 1.0))
        return np.asarray(factor * np.sqrt(self._belief.covariance.diagonal()[:MASS]))

    def _shape_doubt(self) -> float:
        """What the shape of the hysteresis leaves open of sigma0, relative."""
        if not self._start.has("elements"):
            return 0.0
        static = 1.0 + max(float(self._belief.mean[ALPHA]), 0.0)
        return stiffness_doubt(self._start.elements, float(self._axis["model_error"]) / static)

    def believe(self, figures: Mapping[str, tuple[float, float]]) -> None:
        """Begin from figures that were learned before instead of from the start model.

        Bounds stay relative to the start model.

        Args:
            figures: value and standard deviation of coulomb [N], viscous [N s/m], stiffness [N/m]
                and relaxation_rate [1/s], by name; those that are missing stay, those that the law
                does not have are left out.
        """
        for i, name in enumerate(FIGURES[:MASS]):
            if name in figures and self._start.has(name):
                value, sigma = figures[name]
                unit = float(self._axis["unit"][i])
                self._belief.set_apart(i, value / unit, sigma / unit)

    def doubt(self) -> None:
        """The figures count as a start only: what the moves so far showed has another reason."""
        for i, spread in enumerate(self.settings.belief.start_spread[:MASS]):
            value = float(self._belief.mean[i])
            self._belief.set_apart(i, value, spread * value)
        self._other_scale = self._right = None

    def saturates_at(self, force: float) -> None:
        """From now on samples at or beyond this force are saturated and left out [N]."""
        self.settings = replace(self.settings, peak_force=force)
        self._axis["peak_force"] = force

    def expect(
        self, coulomb: float, sigma: float, level: tuple[float, float] | None = None
    ) -> None:
        """The next move ends at another place, whose Coulomb force is known from elsewhere.

        The caller also tracks how it changes in time: no trend is followed here from now on.

        The move's data have to be corrected to that place (`coulomb_variation.level_with_target`).
        The internal forces are scaled with the Coulomb force.

        Args:
            coulomb: Fc there [N].
            sigma: its standard deviation [N].
            level: w at the end of the last move and its standard deviation, where it is known
                better than from the moves of this axis.
        """
        self._trend.calm()
        self._tracked_elsewhere = True
        factor = coulomb / self.friction.coulomb
        unit = self._start.coulomb
        self._belief.set_apart(COULOMB, coulomb / unit, sigma / unit)
        if level is not None:
            self._belief.set_apart(LEVEL, *level)
        if self.state is not None:
            self.state.rescale(factor)

    def scale_coulomb(self, factor: float) -> None:
        """The next move ends where the Coulomb force is known to be `factor` times the figure.

        `friction` stays that of factor 1, estimates state what is there. The internal forces stay;
        where the Coulomb force differs along the move, its data have to be corrected to its end, as
        for `expect`.
        """
        self._local = factor
        coulomb = self._axis["unit"][COULOMB] = self._start.coulomb * factor
        self._facts = (replace(self._start, coulomb=coulomb), *self._facts[1:])

    def forget_state(self) -> None:
        """The axis has moved unobserved: its friction state is unknown, as before the first move.

        The figures stay; the level is forgotten.
        """
        self.state = self._end = self._rest = None
        self._trend.calm()
        self._known = False
        self._moves_to_trust = 0
        self._belief.set_apart(LEVEL, 0.0, float(self._axis["wander"]))
        self._belief.set_apart(FORCE, 0.0, float(self._axis["unmodelled"]))

    def effective(self, time: float) -> FrictionFigures:
        """The model with the level expected at `time` [s]: what feedforward should use."""
        elapsed = 0.0 if self._end is None else max(time - self._end, 0.0)
        keep = math.exp(-elapsed / self.settings.belief.correlation_time)
        level = self._local * (1.0 + keep * float(self._belief.mean[LEVEL]))
        if self._carried is not None:
            level *= math.exp(self._trend.carry(self._carried, time)[0])
        return model_at(self._start, self._belief.mean, level)

    def at_rest(self, position: float, force: float, time: float) -> FrictionState:
        """Take the force measured at rest [N] as the sum of the element forces.

        The first call initialises the state, at `position` [m]; `time` [s] is that of the rest.
        The position is also where the next move begins, should its first samples be lost.
        """
        self._rest = position
        if self.state is None:
            self.state = FrictionState.relaxed(count_states(self._start), position)
        unmodelled = self._start.coulomb * float(self._belief.mean[FORCE])
        self.state.correct(force - unmodelled, self.effective(time))
        return self.state

    def update(self, move: MoveData) -> Estimate:
        """Learn from a move and carry the friction state to its end.

        A move that cannot be used leaves the model as it was, with a reason; the friction state
        follows the measured positions in any case.

        Raises:
            ValueError: shapes that differ, or fewer than three valid samples.
        """
        state = self.state
        if state is None:
            state = self.state = FrictionState.relaxed(count_states(self._start))
        end = move.time + (len(move.position) - 1) * self.settings.period
        outcome = self._run(move, state, self._known, True, end)
        outcome = self._refuse_scale(outcome)
        self._end, self._rest = end, None
        self._observe_innovations(outcome)
        if outcome.verdict != SCALE and outcome.unmodelled[1] > 0.0 and outcome.wander[1] > 0.0:
            # Refused moves count: what is refused again and again is expected in the end.
            learn_excess(
                self._axis, self._weights, outcome.missed, outcome.wander, outcome.unmodelled,
                outcome.mean.item(COULOMB), _MOVES,
            )  # fmt: skip
        if outcome.verdict == ACCEPTED:
            self._jumps = self._moves_to_trust = 0
            self._known = outcome.onset_seen or self._is_state_known(outcome, move)
            misfits = self._misfits
            misfits.append(outcome.misfit)
            if len(misfits) > _FEW:
                self._axis["usual_misfit"] = sorted(misfits)[len(misfits) // 2]
            expected, variance = outcome.sliding.item(0), outcome.sliding.item(1)
            unsure = variance / expected**2
            if not (self._frozen or self._tracked_elsewhere) and unsure - self._aged < _LEARNED**2:
                self._observe_trend(outcome, end)
        else:
            if outcome.verdict == JUMP:
                self._note_jump(outcome)
            self._known = self._is_state_known(outcome, move)
        return Estimate(outcome, self._facts, self._shape_doubt())

    def _is_state_known(self, outcome: Outcome, move: MoveData) -> bool:
        """Whether the friction state is known behind a move that was refused, or begun unseen.

        Followed with wrong figures it ends up wrong, until a move is learned from, or a few that
        reach far enough have been followed.
        """
        if self._frozen or self._is_certain():
            self._moves_to_trust = 0
        elif outcome.verdict != STILL or not outcome.onset_seen:
            self._moves_to_trust = _PATIENCE + 1
        elif np.ptp(move.position[move.valid]) > FULL_SLIP * breakaway_travel(self.friction):
            self._moves_to_trust = max(self._moves_to_trust - 1, 0)
        return self._moves_to_trust == 0

    def _is_certain(self) -> bool:
        """Whether the figures in force are known well enough to follow the elements with."""
        sigma = np.sqrt(self._belief.covariance.diagonal()) / self._belief.mean.clip(1e-9)
        stiff = not self._start.has("stiffness") or sigma[STIFFNESS] < CERTAIN
        return bool(sigma[COULOMB] < CERTAIN and stiff)

    def _observe_trend(self, outcome: Outcome, time: float) -> None:
        """Pass the level that an accepted move showed to the trend."""
        shown = sliding_shown(outcome, _LEAST_SHOWN)
        if shown is not None:
            self._trend.saw(time, shown[0], shown[1] / shown[0] ** 2, self._before)

    def _observe_innovations(self, outcome: Outcome) -> None:
        """Learn what the moves disagree by; the outcome's covariance then allows for it."""
        learn_scatter(outcome.scatter, self._scatter, self._scatter_weights, self._drifts, _MOVES)
        scale_covariance(
            outcome.covariance, outcome.innovations, self._scale, self._informed, _MOVES
        )

    def _refuse_scale(self, outcome: Outcome) -> Outcome:
        """Take back what was learned since the force per acceleration was last seen to be right.

        Until it is so again, moves that do not show it are refused as well.
        """
        shows_scale = self._shows_scale(outcome)
        if outcome.verdict == SCALE:
            self._other_scale = outcome.number
        elif outcome.verdict == ACCEPTED and shows_scale:
            self._other_scale, self._right = None, copy(self._belief)
        right = self._right
        if self._other_scale is None or right is None:
            return outcome
        if outcome.verdict not in (SCALE, ACCEPTED, JUMP, BOUND):
            return outcome
        self._belief.mean[:], self._belief.covariance[:] = right
        return outcome._replace(
            verdict=SCALE, figure=MASS, number=self._other_scale, mean=right.mean,
            covariance=right.covariance.copy(),
        )  # fmt: skip

    @staticmethod
    def _shows_scale(outcome: Outcome) -> bool:
        """Whether a move determines the apparent mass by itself."""
        if outcome.slide == 0:
            return False
        gained = outcome.gain.item(MASS) ** 2 - 1.0
        variance = outcome.before.item(MASS) / max(gained, 1e-9)
        return variance < (SHOWS_SCALE * outcome.mean.item(MASS)) ** 2

    def preview(self, move: MoveData) -> Preview | None:
        """Solve zone A of a move in progress; None where nothing can be concluded yet.

        Args:
            move: from rest up to now.

        Raises:
            ValueError: fewer than three valid samples.
        """
        if self.state is None:
            return None
        state = self.state.copy()
        end = move.time + (len(move.position) - 1) * self.settings.period
        outcome = self._run(move, state, False, False, end)
        if outcome.verdict != ACCEPTED or outcome.slide == 0:
            return None
        level = self._local * (1.0 + float(outcome.mean[LEVEL]))
        model = model_at(self._start, outcome.mean, level)
        speed = float(np.nanmax(np.abs(np.diff(move.position)))) / self.settings.period
        before = self.effective(move.time)
        change = (model.coulomb + model.viscous * speed) / (
            before.coulomb + before.viscous * speed
        ) - 1.0
        return Preview(model, state, change)

    def _run(
        self, move: MoveData, state: FrictionState, known: bool, whole: bool, end: float
    ) -> Outcome:
        """Learn from a move, unless it is not over (`whole`), and carry `state` to its end."""
        size, disturbed = len(move.position), _NONE if move.disturbed is None else move.disturbed
        if not len(move.force) == len(move.valid) == size or len(disturbed) not in (0, size):
            raise ValueError("position, force and valid must have the same length")
        if np.count_nonzero(move.valid & np.isfinite(move.position) & np.isfinite(move.force)) < 3:
            raise ValueError("fewer than three valid samples")
        rest = math.nan if self._rest is None else self._rest
        sampled = Sampled(move.position, move.force, move.valid, disturbed, rest, move.rest_force)
        elapsed = -1.0 if self._end is None else move.time - self._end
        belief = self._belief
        coulomb = belief.mean.item(COULOMB)
        sure = belief.covariance.item(COULOMB, COULOMB) / coulomb**2 + self._drift
        self._before = (coulomb, sure)
        if self._carried is None:
            self._aged = 0.0
        else:
            change, unsure = self._trend.carry(self._carried, end)
            self._aged = max(unsure - sure, 0.0)
            belief.mean[COULOMB] = coulomb * math.exp(change)
        between = State(belief, state.forces, state.slipping, state.memory)
        outcome: Outcome = update_move(
            sampled, self._axis, self._law, between, elapsed, self._aged, known, whole
        )
        if whole and outcome.verdict == ACCEPTED:
            self._carried = end
        elif self._carried is not None:  # what is in force stays; the trend continues from there
            belief.mean[COULOMB] = coulomb
        return outcome

    def _note_jump(self, outcome: Outcome) -> None:
        """Accept that the stage has changed after several jumps in the same direction.

        The covariance is reset to its start, so that the next good move is learned from; the model
        in force stays. Moves refused for another reason do not count.
        """
        change = outcome.found[:MASS] / outcome.mean[:MASS] - 1.0
        same_way = (
            self._jumps > 0
            and self._jump is not None
            and float(change @ self._jump)
            > 0.5 * float(np.linalg.norm(change) * np.linalg.norm(self._jump))
        )
        self._jumps = self._jumps + 1 if same_way else 1
        self._jump = change
        if self._jumps >= _PATIENCE:
            self._jumps = 0
            self._axis["scale"], self._informed[:] = 1.0, _GUESS
            start = Belief.at_start(self.settings.belief, self._start).covariance
            for i in range(MASS):  # the mass does not change with friction
                away = outcome.found[i] - self._belief.mean[i]
                self._belief.set_apart(i, self._belief.mean[i], math.sqrt(start[i, i] + away**2))
