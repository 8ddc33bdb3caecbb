"""Friction figures of one axis out of accumulated moves, with sigma, gain and verdict.

Fitted in stages: what any move determines (Coulomb force, viscous friction, mass, offset), then all
figures without the shape of the hysteresis, then everything. A figure that the samples determine
less well than its prior stays at its prior. An estimate is refused as a whole where the model does
not explain the samples.

The measured acceleration contains the encoder's noise; taken for exact, it biases the mass low. So
the mass is estimated with errors in variables, all else has its minimum there, and what that
changes goes into sigma. Where the host follows its demand well, hardly more than that noise
separates the mass from the drive's force ripple, and through the controller the noise is in the
force as well: then the mass stays at its prior.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from estimation.friction import breakaway_travel
from estimation.offline.fit import MAX_ITERATIONS, Fit, NoSolutionError, Problem
from estimation.offline.held_out import BETTER, UNTESTED, Selection, select
from estimation.offline.records import OfflineSettings, Samples, joined, record
from estimation.offline.uncertainty import (
    ESTIMATED,
    PRIOR,
    TOGETHER,
    find_prior_sigma,
    find_sigma,
    judge,
    regress_on_mass,
)
from estimation.offline.unknowns import (
    BASE,
    FIGURES,
    FRICTION,
    MASS,
    RIPPLE,
    Unknowns,
    chosen,
    unknowns,
)
from stagedata import F64, FrictionFigures

KNOWN_AFTER = 4.0
"""Breakaway travels in one direction after which all elements slip, whatever their state was."""


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
    """Result of all moves of an axis together.

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


@dataclass(frozen=True, slots=True)
class _Estimate:
    """Estimates from the samples, unknown by unknown.

    Attributes:
        fit: the minimum.
        free: solved for in it, shape (n,); not the mass, which is fixed before.
        sigma: of the values, in their units, shape (n,).
        by_mass: part of it that the uncertainty of the mass explains, shape (n,).
        verdicts: on every unknown.
    """

    fit: Fit
    free: NDArray[np.bool_]
    sigma: F64
    by_mass: F64
    verdicts: Sequence[str]


def identify(
    moves: Sequence[Samples], friction: FrictionFigures, settings: OfflineSettings
) -> Identification:
    """Estimate all friction figures of one axis from its moves.

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
    problem, samples = _pose(moves, friction, settings)
    u, blocks = problem.unknowns, sum(problem.counted)
    if samples < settings.least:
        reason = f"only {samples} samples in motion after all elements have slipped once"
        return _refused(u, reason, samples, blocks)
    free = np.ones(len(u.mean), dtype=np.bool_)
    if any(m.demand is None for m in moves):
        free[[RIPPLE[0], RIPPLE[2]]] = False
    selection = Selection(math.nan, {}, UNTESTED)
    recommended: dict[str, float] = {}
    try:
        before = problem.solve(u.mean, chosen(len(free), ()))
        estimate = _drop_undetermined(problem, _estimate(problem, free, before))
        fit = estimate.fit
        if fit.converged and fit.misfit <= settings.misfit:
            away = np.abs(u.values(fit.q) - u.values(u.mean)) / np.maximum(estimate.sigma, 1e-300)
            tested = [i for i in FRICTION if estimate.free[i]]
            tested.sort(key=lambda i: float(away[i]))
            selection = select(problem, fit, estimate.free, tested)
            if selection.together == BETTER and selection.misfit < before.misfit:
                recommended = _recommend(problem, fit, estimate.free, selection)
    except NoSolutionError as error:
        return _refused(u, str(error), samples, blocks)
    if not fit.converged:
        reason = f"no minimum was reached in {2 * MAX_ITERATIONS} steps"
        return _refused(u, reason, samples, blocks, before.misfit, fit.misfit)
    if not fit.misfit <= settings.misfit:
        reason = f"residual {fit.misfit:.1f} times that expected from noise and wander"
        return _refused(u, reason, samples, blocks, before.misfit, fit.misfit)
    return Identification(
        None, _figures(u, estimate, selection.verdicts), fit.misfit, before.misfit,
        selection.misfit, samples, blocks, recommended,
    )  # fmt: skip


def _pose(
    moves: Sequence[Samples], friction: FrictionFigures, settings: OfflineSettings
) -> tuple[Problem, int]:
    """The least-squares problem, and how many samples count in it."""
    travel = KNOWN_AFTER * breakaway_travel(friction)
    records = [record(m, settings, travel) for m in joined(moves, settings.period)]
    u = unknowns(friction, settings.mass, settings.period)
    return Problem(records, u, settings), sum(int(r.used.sum()) for r in records)


def _estimate(problem: Problem, free: NDArray[np.bool_], before: Fit) -> _Estimate:
    """All free unknowns: in stages, then the mass with errors in variables."""
    u, n = problem.unknowns, len(free)
    fit = problem.solve(u.mean, free & chosen(n, BASE), before.levels)
    fit = problem.solve(fit.q, free & chosen(n, tuple(range(len(FIGURES)))), fit.levels)
    fit = problem.solve(fit.q, free, fit.levels)
    prior_sigma = find_prior_sigma(u)
    noisy = problem.solve(fit.q, free, fit.levels, errors_in_variables=True)
    apart = abs(u.values(noisy.q)[MASS] - u.values(fit.q)[MASS])
    others = free & ~chosen(n, (MASS,))
    by_mass = np.zeros(n)
    if math.hypot(find_sigma(u, fit)[MASS], apart) > prior_sigma[MASS] / math.sqrt(2.0):
        # Only noise separates mass and ripple: all the ripple, and the mass of the prior.
        free = others
        fit = problem.solve(np.where(free, fit.q, u.mean), free, fit.levels)
        # Their sum is determined; each is as uncertain as the other.
        by_mass[RIPPLE[0]] = u.spread[MASS]
    else:
        by_mass = regress_on_mass(u, fit) * math.hypot(find_sigma(u, fit, shared=True)[MASS], apart)
        fit = problem.solve(np.where(others, fit.q, noisy.q), others, fit.levels)
    sigma = np.hypot(find_sigma(u, fit), by_mass)
    return _Estimate(fit, others, sigma, by_mass, judge(u, fit.q, sigma, prior_sigma, free))


def _drop_undetermined(problem: Problem, found: _Estimate) -> _Estimate:
    """Estimate again, with what the samples do not determine held at its prior."""
    u, fit = problem.unknowns, found.fit
    determined = np.array([v in (ESTIMATED, TOGETHER) for v in found.verdicts])
    shared = np.hypot(find_sigma(u, fit, shared=True), found.by_mass)
    sigma = np.where(determined, shared, found.sigma)
    free = found.free & determined
    if not determined.all():
        fit = problem.solve(np.where(determined, fit.q, u.mean), free, fit.levels)
        again = np.hypot(find_sigma(u, fit, shared=True), found.by_mass)
        sigma = np.where(determined, np.maximum(sigma, again), find_prior_sigma(u))
    if not fit.converged:  # once more from there
        fit = problem.solve(fit.q, free, fit.levels)
    return replace(found, fit=fit, free=free, sigma=sigma)


def _recommend(
    problem: Problem, fit: Fit, free: NDArray[np.bool_], selection: Selection
) -> dict[str, float]:
    """The friction figures that are better than their priors, fitted with the others at those."""
    u, verdicts = problem.unknowns, selection.verdicts
    back = chosen(len(free), tuple(i for i, verdict in verdicts.items() if verdict != BETTER))
    if back.any():
        fit = problem.solve(np.where(back, u.mean, fit.q), free & ~back, fit.levels)
    values = u.values(fit.q)
    return {u.names[i]: float(values[i]) for i in verdicts if not back[i]}


def _figures(u: Unknowns, estimate: _Estimate, held_out: Mapping[int, str]) -> tuple[Figure, ...]:
    """All unknowns in their units; `held_out`: verdicts of those that were tested."""
    values, priors, prior_sigma = u.values(estimate.fit.q), u.values(u.mean), find_prior_sigma(u)
    result = []
    for i, name in enumerate(u.names):
        verdict, sigma = estimate.verdicts[i], float(estimate.sigma[i])
        determined = verdict in (ESTIMATED, TOGETHER) and sigma > 0
        gain = float(prior_sigma[i]) / sigma if determined else 1.0
        result.append(
            Figure(
                name, u.units[i], float(priors[i]), float(prior_sigma[i]), float(values[i]),
                min(sigma, float(prior_sigma[i])), max(gain, 1.0), verdict,
                held_out.get(i, UNTESTED),
            )
        )  # fmt: skip
    return tuple(result)


def _refused(
    u: Unknowns, reason: str, samples: int, blocks: int,
    before: float = math.nan, misfit: float = math.nan,
) -> Identification:  # fmt: skip
    """Nothing estimated: all figures at their priors."""
    values, sigma = u.values(u.mean), find_prior_sigma(u)
    figures = tuple(
        Figure(name, unit, float(v), float(s), float(v), float(s), 1.0, PRIOR)
        for name, unit, v, s in zip(u.names, u.units, values, sigma, strict=True)
    )
    return Identification(reason, figures, misfit, before, math.nan, samples, blocks)
