"""Friction figures of one axis out of accumulated moves, with sigma, gain and verdict.

First what any move determines (Coulomb force, viscous friction, mass, offset), then all figures
without the shape of the hysteresis, then everything. What the samples say less of
than was believed before stays at its prior. An estimate is refused as a whole where the model does
not explain the samples.

Sigma is the larger of two: what noise explains (inflated where the residual is above it), and how
much the blocks of the record disagree. The second one is honest where model errors are alike over
many neighbouring samples.

The measured acceleration has the encoder's noise, too: taken for exact, it shows too little mass.
So the mass is that of errors in both, all else has its minimum there, and what that changes goes
into sigma. A host that follows its demand well separates the mass from the drive's ripple by hardly
more than that noise, which is in the force as well, through the controller: then the mass stays as
believed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from estimation.friction import F64, breakaway_travel
from estimation.offline.fit import MAX_ITERATIONS, Fit, Noise, NoSolutionError, Problem
from estimation.offline.held_out import BETTER, UNTESTED, Selection, select
from estimation.offline.records import Samples, joined, record
from estimation.offline.unknowns import (
    BASE,
    FIGURES,
    FRICTION,
    MASS,
    RIPPLE,
    Prior,
    Unknowns,
    chosen,
    unknowns,
)
from stagedata import FrictionFigures

ESTIMATED, PRIOR, BOUND = "estimated", "stays at its prior", "refused: on its bound"
TOGETHER = "with its neighbours"
"""Verdict on one k_i or nu_i of a shape that is only determined as a whole."""
LEAST_LEFT = 0.2
"""Of the blocks, at least this share counts as free to disagree, however much they were asked."""
KNOWN_AFTER = 4.0
"""Breakaway travels in one direction after which all elements slip, whatever their state was."""


@dataclass(frozen=True, slots=True)
class OfflineSettings:
    """How an axis is identified.

    Attributes:
        mass: moved mass [kg].
        period: of the samples [s].
        position_noise: rms of a sampled position, encoder increment included [m].
        force_noise: rms of a sampled force, its resolution included [N].
        peak_force: samples at or beyond it are left out [N].
        wander: rms of the level.  correlation_time: of it [s].
        model_error: rms of what the model itself misses, relative to the Coulomb force.
        prior: how far the figures are believed before.
        misfit: largest rms of the whitened residual that is accepted.
        least: fewest samples in motion.
    """

    mass: float
    period: float
    position_noise: float
    force_noise: float
    peak_force: float = math.inf
    wander: float = 0.01
    correlation_time: float = 0.5
    model_error: float = 0.003
    prior: Prior = field(default_factory=Prior)
    misfit: float = 3.0
    least: int = 300


@dataclass(frozen=True, slots=True)
class Figure:
    """One unknown, before and after.

    Attributes:
        name, unit: of it; k_i and nu_i add to one each.
        prior, prior_sigma: before.
        value, sigma: after.
        gain: sigma before over sigma after.
        verdict: `ESTIMATED`, `PRIOR`, `BOUND` or `TOGETHER`.
        held_out: how it predicts moves that were left out, against its prior: `BETTER`,
            `NO_BETTER`, `WORSE` or `UNTESTED`.
    """

    name: str
    unit: str
    prior: float
    prior_sigma: float
    value: float
    sigma: float
    gain: float
    verdict: str
    held_out: str = UNTESTED


@dataclass(frozen=True, slots=True)
class Identification:
    """What all moves of an axis together say.

    Attributes:
        reason: why nothing was estimated, else None; then all figures are at their prior.
        figures: every unknown.
        misfit: rms of the whitened residual; before: with the figures believed before;
            held_out: on the blocks left out, with the figures of the others. nan where unknown.
        samples: in motion, that counted.
        blocks: pieces of the records that counted.
        recommended: friction figures -> values that, with the priors of all others, predict moves
            that were left out better than the priors alone. They are fitted with those.
    """

    reason: str | None
    figures: tuple[Figure, ...]
    misfit: float
    before: float
    held_out: float
    samples: int
    blocks: int
    recommended: Mapping[str, float] = field(default_factory=dict)

    def __getitem__(self, name: str) -> Figure:
        """A figure by its name.

        Raises:
            KeyError: there is none.
        """
        for figure in self.figures:
            if figure.name == name:
                return figure
        raise KeyError(name)


def identify(
    moves: Sequence[Samples], friction: FrictionFigures, settings: OfflineSettings
) -> Identification:
    """Estimate all friction figures of one axis from its moves (long: three fits in a row).

    Args:
        moves: in order of time; moves that follow one another without a gap (or overlap) are
            taken as one record, so that the friction state is carried along.
        friction: what is believed before; its `elements` are those of the answer, whose law is
            always generalized Maxwell slip.
        settings: of the identification.

    Raises:
        ValueError: no move.
    """
    if not moves:
        raise ValueError("no moves")
    friction = replace(friction, law="gms")
    u = unknowns(friction, settings.mass, settings.period, settings.prior)
    travel = KNOWN_AFTER * breakaway_travel(friction)
    records = [
        record(m, settings.period, settings.position_noise, settings.peak_force, travel)
        for m in joined(moves, settings.period)
    ]
    noise = Noise(
        settings.period, settings.position_noise, settings.force_noise,
        settings.model_error * friction.coulomb, settings.wander, settings.correlation_time,
    )  # fmt: skip
    problem = Problem(records, u, noise)
    samples = sum(int(r.used.sum()) for r in records)
    if samples < settings.least:
        reason = f"only {samples} samples in motion after all elements have slipped once"
        return _refused(u, reason, samples, sum(problem.counted))
    free = np.ones(len(u.mean), dtype=np.bool_)
    if any(m.demand is None for m in moves):
        free[[RIPPLE[0], RIPPLE[2]]] = False
    try:
        before = problem.solve(u.mean, free & chosen(len(free), ()))
        fit = problem.solve(u.mean, free & chosen(len(free), BASE), before.levels)
        figures = chosen(len(free), tuple(range(len(FIGURES))))
        fit = problem.solve(fit.q, free & figures, fit.levels)
        fit = problem.solve(fit.q, free, fit.levels)
        spread = _prior_sigma(u)
        noisy = problem.solve(fit.q, free, fit.levels, both=True)
        apart = abs(u.values(noisy.q)[MASS] - u.values(fit.q)[MASS])
        others = free & ~chosen(len(free), (MASS,))
        by_mass = np.zeros(len(free))  # what the mass leaves open in every figure
        if math.hypot(_sigma(u, fit)[MASS], apart) > spread[MASS] / math.sqrt(2.0):
            # Only noise separates mass and ripple: all the ripple, and the mass of the prior.
            free = others
            fit = problem.solve(np.where(free, fit.q, u.mean), free, fit.levels)
            # Their sum is determined; each is as uncertain as the other.
            by_mass[RIPPLE[0]] = u.spread[MASS]
        else:
            by_mass = _leaning(u, fit) * math.hypot(_sigma(u, fit, shared=True)[MASS], apart)
            fit = problem.solve(np.where(others, fit.q, noisy.q), others, fit.levels)
        sigma = np.hypot(_sigma(u, fit), by_mass)
        verdicts = _verdicts(u, fit.q, sigma, spread, free)
        determined = np.array([v in (ESTIMATED, TOGETHER) for v in verdicts])
        sigma = np.where(determined, np.hypot(_sigma(u, fit, shared=True), by_mass), sigma)
        others &= determined
        if not determined.all():
            start = np.where(determined, fit.q, u.mean)
            fit = problem.solve(start, others, fit.levels)
            again = np.hypot(_sigma(u, fit, shared=True), by_mass)
            sigma = np.where(determined, np.maximum(sigma, again), spread)
        if not fit.converged:  # once more from there
            fit = problem.solve(fit.q, others, fit.levels)
        told = Selection(math.nan, {}, UNTESTED)
        use: dict[str, float] = {}
        if fit.converged and fit.misfit <= settings.misfit:
            away = np.abs(u.values(fit.q) - u.values(u.mean)) / np.maximum(sigma, 1e-300)
            tested = sorted((i for i in FRICTION if others[i]), key=lambda i: float(away[i]))
            told = select(problem, fit, others, tested)
            if told.together == BETTER and told.misfit < before.misfit:
                use = _recommended(problem, fit, others, told)
    except NoSolutionError as problem_found:
        return _refused(u, str(problem_found), samples, sum(problem.counted))
    if not fit.converged:
        reason = f"no minimum was reached in {2 * MAX_ITERATIONS} steps"
        return _refused(u, reason, samples, sum(problem.counted), before.misfit, fit.misfit)
    if not fit.misfit <= settings.misfit:
        reason = f"residual {fit.misfit:.1f} times what noise and wander explain"
        return _refused(u, reason, samples, sum(problem.counted), before.misfit, fit.misfit)
    return Identification(
        None, _figures(u, fit.q, sigma, verdicts, told.verdicts), fit.misfit, before.misfit,
        told.misfit, samples, sum(problem.counted), use,
    )  # fmt: skip


def _recommended(
    problem: Problem, fit: Fit, free: NDArray[np.bool_], told: Selection
) -> dict[str, float]:
    """The friction figures that are better than their priors, fitted with the others at those."""
    u = problem.unknowns
    back = chosen(len(free), tuple(i for i, verdict in told.verdicts.items() if verdict != BETTER))
    if back.any():
        fit = problem.solve(np.where(back, u.mean, fit.q), free & ~back, fit.levels)
    values = u.values(fit.q)
    return {u.names[i]: float(values[i]) for i in told.verdicts if not back[i]}


def _leaning(u: Unknowns, fit: Fit) -> F64:
    """By how much every value goes with the mass, where the samples say what they say of both."""
    slopes = u.slopes(fit.q)
    covariance: F64 = slopes @ fit.covariance @ slopes.T
    result: F64 = covariance[:, MASS] / covariance[MASS, MASS]
    return result


def _sigma(u: Unknowns, fit: Fit, shared: bool = False) -> F64:
    """Standard deviations of the values: of the noise, or of the blocks' disagreement.

    `shared`: as large as it is in spite of all that was fitted to the same blocks. A minimum over
    many unknowns has them agree.
    """
    slopes = u.slopes(fit.q)
    covariance = slopes @ fit.covariance @ slopes.T
    noise = np.sqrt(np.maximum(covariance.diagonal(), 0.0)) * max(1.0, fit.misfit)
    scores = fit.scores[np.abs(fit.scores).max(axis=1) > 0]
    count = len(scores)
    if count < 3:
        return noise
    each = (scores - scores.mean(axis=0)) @ fit.covariance @ slopes.T
    left = count - 1.0
    if shared:
        narrowed = 1.0 - (fit.covariance.diagonal() / u.spread**2)[_free(fit)]
        left = max(left - float(narrowed.clip(0.0, 1.0).sum()), LEAST_LEFT * count)
    spread: F64 = np.sqrt((each**2).sum(axis=0) * count / left)
    return np.maximum(noise, spread)


def _free(fit: Fit) -> NDArray[np.bool_]:
    """Which unknowns were solved for."""
    return np.asarray(fit.covariance.diagonal() > 0.0, dtype=np.bool_)


def _prior_sigma(u: Unknowns) -> F64:
    """Standard deviations of the values before; those of k_i and nu_i for a sum of one."""
    slopes = u.slopes(u.mean)
    result: F64 = np.sqrt(slopes**2 @ u.spread**2)
    return result


def _verdicts(u: Unknowns, q: F64, sigma: F64, spread: F64, free: NDArray[np.bool_]) -> list[str]:
    """Verdict on every unknown; the shape of the hysteresis is determined as a whole or not."""
    bound = free & ((q <= u.lower) | (q >= u.upper)) & (u.lower < u.mean)
    weak = (sigma > spread / math.sqrt(2.0)) | ~free
    verdicts = [BOUND if b else PRIOR if w else ESTIMATED for b, w in zip(bound, weak, strict=True)]
    first = len(FIGURES)
    untold = bool(bound[first:].any()) or bool(weak[first:].mean() > 0.5)
    for i in range(first, len(verdicts)):
        if verdicts[i] != BOUND and (untold or weak[i]):
            verdicts[i] = PRIOR if untold else TOGETHER
    return verdicts


def _figures(
    u: Unknowns, q: F64, sigma: F64, verdicts: Sequence[str], told: Mapping[int, str]
) -> tuple[Figure, ...]:
    """All unknowns in their units."""
    values, priors, spread = u.values(q), u.values(u.mean), _prior_sigma(u)
    result = []
    for i, name in enumerate(u.names):
        determined = verdicts[i] in (ESTIMATED, TOGETHER)
        gain = float(spread[i] / sigma[i]) if determined and sigma[i] > 0 else 1.0
        result.append(
            Figure(
                name, u.units[i], float(priors[i]), float(spread[i]), float(values[i]),
                float(min(sigma[i], spread[i])), max(gain, 1.0), verdicts[i],
                told.get(i, UNTESTED),
            )
        )  # fmt: skip
    return tuple(result)


def _refused(
    u: Unknowns, reason: str, samples: int, blocks: int,
    before: float = math.nan, misfit: float = math.nan,
) -> Identification:  # fmt: skip
    figures = _figures(u, u.mean, _prior_sigma(u), [PRIOR] * len(u.mean), {})
    return Identification(reason, figures, misfit, before, math.nan, samples, blocks)
