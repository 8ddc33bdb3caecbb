"""Cross-validation of estimates against their priors on moves that were left out.

Each third of the blocks is predicted from the other two thirds. One figure at a time is set to its
prior, all others are fitted again, and the costs of the predictions are compared block by block:
better or worse by more than the standard error of the difference, or no better. A figure that is
not better stays at its prior from there on, so those that remain are better with the priors of the
others, which is how they would be used.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation.offline.fit import Fit, Problem
from estimation.offline.unknowns import chosen
from stagedata import F64

FOLDS = 3
"""Parts of the blocks that are left out in turn."""
BETTER, NO_BETTER, WORSE, UNTESTED = "better", "no better", "worse", "untested"


@dataclass(frozen=True, slots=True)
class Prediction:
    """Prediction of every block from the others.

    Attributes:
        costs: of the blocks, shape (blocks,).
        chi, samples: sum of the squared whitened residuals, and how many they are.
    """

    costs: F64
    chi: float
    samples: int

    @property
    def misfit(self) -> float:
        """Rms of the whitened residual."""
        return math.sqrt(self.chi / max(self.samples, 1))


@dataclass(frozen=True, slots=True)
class Selection:
    """Which estimates predict moves that were left out better than their priors.

    Attributes:
        misfit: of the prediction with all estimates; nan where there are too few blocks.
        verdicts: unknown -> BETTER, NO_BETTER, WORSE or UNTESTED.
        together: verdict on those that are BETTER, together against all priors.
    """

    misfit: float
    verdicts: dict[int, str]
    together: str


def select(problem: Problem, fit: Fit, free: NDArray[np.bool_], tested: Sequence[int]) -> Selection:
    """Compare estimates with their priors on blocks that were left out.

    Args:
        problem: of the axis.
        fit: to all blocks.
        free: what was solved for, shape (n,).
        tested: unknowns among them to set to their priors, in this order; those nearest to their
            priors should come first.

    Raises:
        NoSolutionError: as `Problem.solve`.
    """
    parts = _parts(problem)
    if not parts:
        return Selection(math.nan, dict.fromkeys(tested, UNTESTED), UNTESTED)
    mean = problem.unknowns.mean

    def predict(without: Sequence[int]) -> Prediction:
        back = chosen(len(mean), tuple(without))
        return _predict(problem, np.where(back, mean, fit.q), free & ~back, fit.levels, parts)

    whole = now = predict(())
    verdicts = dict.fromkeys(tested, BETTER)
    dropped: list[int] = []
    for number in tested:
        trial = predict((*dropped, number))
        verdicts[number] = _verdict(trial, now, problem)
        if verdicts[number] != BETTER:
            dropped.append(number)
            now = trial
    together = NO_BETTER
    if len(dropped) < len(tested):
        together = _verdict(predict(tested), now, problem)
    return Selection(whole.misfit, verdicts, together)


def _parts(problem: Problem) -> list[list[bool]]:
    """Blocks of each part, as a mask; none where there are too few."""
    numbers = np.flatnonzero(problem.counted)
    if len(numbers) < 2 * FOLDS:
        return []
    # Dealt out by speed: every part has its share of slow and of fast moves.
    numbers = numbers[np.argsort(np.array(problem.speeds)[numbers])]
    parts = [[False] * problem.blocks for _ in range(FOLDS)]
    for place, number in enumerate(numbers):
        parts[place % FOLDS][number] = True
    return parts


def _predict(
    problem: Problem, start: F64, free: NDArray[np.bool_], levels: tuple[F64, ...],
    parts: Sequence[Sequence[bool]],
) -> Prediction:  # fmt: skip
    costs, chi, samples = np.zeros(problem.blocks), 0.0, 0
    nothing = chosen(len(start), ())
    for theirs in parts:
        mine = [c and not out for c, out in zip(problem.counted, theirs, strict=True)]
        learned = problem.solve(start, free, levels, mine)
        seen = problem.solve(learned.q, nothing, levels, theirs)
        costs += seen.costs
        chi, samples = chi + seen.chi, samples + seen.samples
    return Prediction(costs, chi, samples)


def _verdict(prior: Prediction, estimate: Prediction, problem: Problem) -> str:
    apart = (prior.costs - estimate.costs)[np.array(problem.counted)]
    gain, error = apart.sum(), np.std(apart, ddof=1) * math.sqrt(len(apart))
    return BETTER if gain > error else WORSE if gain < -error else NO_BETTER
