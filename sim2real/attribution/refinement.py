"""Sets of effects that come near one another, fitted to the end side by side."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sim2real.attribution.alternatives import Book, Rival
from sim2real.fitting import AxisModel, AxisProblem, Fitted, fit

F64 = NDArray[np.float64]

LEAST_GAIN = 100.0
"""Score that an effect must save: nominal stages show accidental ones of 12."""
_ROUNDS, _ITERATIONS, _NARROWER = 5, 4, 0.9
"""Fits that a set of effects may take that is fitted to the end, iterations of each; what counts as
an outlier must not have come down below this share of what it was, or another one follows."""
_LITTLE = 0.01
"""Share of what the best of them leaves beside noise that another fit has to gain."""
_CONTENDERS, _CONTEST, _CONTEST_SHARE = 4, 1000.0, 0.1
"""Sets that are fitted to the end, and the score (or its share, or all that the best of them leaves
beside noise) within which they contend."""


def side_by_side(
    problem: AxisProblem,
    book: Book,
    models: Sequence[AxisModel],
    iterations: int,
    columns: F64 | None = None,
) -> list[Rival]:
    """Models fitted side by side, with the same derivatives by the base parameters if given."""

    def one(model: AxisModel) -> Fitted:
        return fit(problem, model, iterations, columns, thorough=False)

    return [book.entered(found) for found in problem.workers.map(one, models)]


def contended(problem: AxisProblem, book: Book, trials: Sequence[Rival]) -> Rival:
    """The best of the trials, after those that come near it were fitted to the end as well.

    First fits stop early, by the gains of a model without the effect: what is the better name is
    not yet told.
    """
    book.regained(min(trials, key=book.score).model)
    names = {tuple(sorted(trial.model.names())) for trial in trials}

    def ranked() -> list[Rival]:
        return sorted((book.best(each) for each in names), key=book.score)

    for _ in range(_ROUNDS):
        order = ranked()[:_CONTENDERS]
        before, wide = book.score(order[0]), problem.outlier
        left = max(before - problem.expected(), 0.0)
        last = before + max(_CONTEST, _CONTEST_SHARE * before, left)
        # And those that would come near if they went on falling as they did in the end.
        near = [r for r in order if book.score(r) - _ITERATIONS * r.fitted.falling <= last]
        starts = [_lent(problem, book, rival, near[0]).model for rival in near]
        # Beside one effect or another the base parameters do much the same.
        columns = problem.base_columns(near[0].model, near[0].fitted.residual)
        side_by_side(problem, book, starts, _ITERATIONS, columns)
        best = ranked()[0]
        gained = before - book.score(best)
        problem.rescale(best.fitted.residual)
        if gained < max(LEAST_GAIN, _LITTLE * left) and problem.outlier > _NARROWER * wide:
            break
    return best


def _lent(problem: AxisProblem, book: Book, rival: Rival, best: Rival) -> Rival:
    """The rival, or with the best one's figures for all that they share, whichever does better.

    Fits of different names stop at different figures of the same plant.
    """
    if rival.model.names() == best.model.names():
        return rival
    shared = {term.name: term for term in best.model.terms}
    terms = tuple(shared.get(term.name, term) for term in rival.model.terms)
    model = AxisModel(best.model.base, terms)
    residual = problem.attempted(model)
    book.entered(Fitted(model, problem.cost(model, residual), residual, None))
    return book.best(rival.model.names())
