"""Alternatives with similar scores, refined until it is clear which is best."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hil_sim.effects.ports import EffectPorts
from hil_sim.settings import AxisSettings
from sim2real.attribution.alternatives import Alternative, Ranking
from sim2real.dictionary import shift_only_place
from sim2real.fitting import AxisModel, AxisProblem, Fitted, coordinates, fit
from sim2real.scoring.constants import (
    CLOSE,
    CLOSE_SHARE,
    CONTENDERS,
    LEAST_GAIN,
    LEAST_PROGRESS,
    OUTLIER_SHRINKAGE,
    ROUNDS,
    SHORT,
)

F64 = NDArray[np.float64]

_SHIFT, _PERIOD = 0.1, 1e-3
"""Distance over which a constant force is compared [m]; any period will do for that [s]."""


def fit_alternatives(
    problem: AxisProblem,
    ranking: Ranking,
    models: Sequence[AxisModel],
    iterations: int,
    columns: F64 | None = None,
) -> list[Alternative]:
    """Fit several models at once, with common derivatives by the base parameters if given."""

    def one(model: AxisModel) -> Fitted:
        return fit(problem, model, iterations, columns, thorough=False)

    return [ranking.enter(found) for found in problem.workers.map(one, models)]


def refine_contenders(
    problem: AxisProblem, ranking: Ranking, trials: Sequence[Alternative]
) -> Alternative:
    """The best of the trials, after all that come close have been fitted to convergence.

    The first fits stop early and use the filter gains of the model without the effect, so their
    scores do not yet tell which effect is better.
    """
    ranking.reweigh(min(trials, key=ranking.score).model)
    names = {tuple(sorted(trial.model.names())) for trial in trials}

    def ranked() -> list[Alternative]:
        return sorted((ranking.best(each) for each in names), key=ranking.score)

    for _ in range(ROUNDS):
        order = ranked()[:CONTENDERS]
        before, wide = ranking.score(order[0]), problem.outlier
        left = max(before - problem.expected_cost(), 0.0)
        last = before + max(CLOSE, CLOSE_SHARE * before, left)
        # And those that would come close if their cost kept falling at its last rate.
        near = [r for r in order if _next_score(ranking, r) <= last]
        starts = [alternative.model for alternative in near]
        # The derivatives by base parameters hardly depend on which effect is beside them.
        columns = problem.base_columns(near[0].model, near[0].fitted.residual)
        fit_alternatives(problem, ranking, starts, SHORT, columns)
        best, *others = ranked()[:CONTENDERS]
        gained = before - ranking.score(best)
        overtaken = any(_next_score(ranking, r) < ranking.score(best) for r in others)
        problem.rescale(best.fitted.residual)
        if (
            gained < max(LEAST_GAIN, LEAST_PROGRESS * left)
            and problem.outlier > OUTLIER_SHRINKAGE * wide
            and not overtaken
        ):
            break
    return best


def without_effect(model: AxisModel, index: int, axis: AxisSettings) -> AxisModel:
    """The model with one effect fewer; a spring's center takes over what was a constant force.

    A spring and a constant force are a spring elsewhere, too far away for a fit that takes steps.
    """
    fewer = model.without(index)
    missing = _constant_force(model, axis) - _constant_force(fewer, axis)
    for i, term in enumerate(fewer.terms):
        at = shift_only_place(term.effect)
        if at is None or not missing:
            continue
        key = term.effect.parameters[at].key
        moved = fewer.with_value(i, key, term.values[at] + _SHIFT)
        slope = (_constant_force(moved, axis) - _constant_force(fewer, axis)) / _SHIFT
        entry = coordinates(term.effect, axis)[at]
        if slope:
            return fewer.with_value(i, key, entry.clipped(term.values[at] + missing / slope))
    return fewer


def _constant_force(model: AxisModel, axis: AxisSettings) -> float:
    ports = EffectPorts(axis, _PERIOD, _PERIOD)
    for effect in model.settings(axis).effects:
        effect.apply(ports)
    return ports.force


def _next_score(ranking: Ranking, alternative: Alternative) -> float:
    """Score after another fit, if the cost keeps falling at its last rate."""
    return ranking.score(alternative) - SHORT * alternative.fitted.last_gain
