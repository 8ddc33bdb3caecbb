"""What one move showed, read from the outcome of the compiled update where it is asked for."""

from __future__ import annotations

import math

import numpy as np

from estimation.online.belief.belief import COULOMB, FIGURES, LEVEL, MASS, STIFFNESS, model_at
from estimation.online.outcome import (
    ACCEPTED,
    BOUND,
    DISTURBED,
    HOLES,
    JUMP,
    MISFIT,
    MISSED,
    SCALE,
    STILL,
    Outcome,
)
from estimation.online.solver.prepare import (
    HIDDEN_ONSET,
    TOO_LITTLE,
    UNKNOWN_STATE,
    UNUSABLE_FORCE,
)
from stagedata import F64, FrictionFigures

INFORMATIVE = 0.5
"""A move that leaves more than this of the level's variance does not show the level."""
SHOWN = 0.015
"""... nor does one that leaves it uncertain by more than this, relative."""

_WHY_NOT = {
    TOO_LITTLE: "too little motion to learn from",
    UNUSABLE_FORCE: "no usable force while it moves: "
    "saturated, missing, or disturbed by late setpoints",
    UNKNOWN_STATE: "the presliding state before the move is unknown: "
    "a move that slides has to be learned from first",
    HIDDEN_ONSET: "samples of its onset are missing or saturated: "
    "how the elements began to slip is not known",
}
_REFUSED = {
    HOLES: "only {percent:.0f} % of the samples can be used",
    DISTURBED: "late setpoints disturbed the force in all but {percent:.0f} % of the motion",
    MISFIT: "residual {number:.1f} times that expected from noise and wander",
    MISSED: "the model misses {percent:.0f} % of the Coulomb force, something else acts",
    BOUND: "{figure} ran into its bound",
    SCALE: "force per acceleration changes by {percent:+.0f} %: not friction, but the force "
    "constant, the reading of the force (0x6077) or the moved mass",
    JUMP: "{figure} jumps by {percent:+.0f} %",
}


class Estimate:
    """What one move showed.

    Args:
        outcome: of the update.
        facts: model that the figures are relative to, mass that the apparent mass is relative to
            [kg], and period of the samples [s].
        shape: standard deviation of sigma0 by what the shape of the hysteresis leaves open,
            relative (`estimation.friction.shape`).
    """

    __slots__ = ("_facts", "_outcome", "_shape")

    def __init__(
        self, outcome: Outcome, facts: tuple[FrictionFigures, float, float], shape: float = 0.0
    ) -> None:
        self._outcome = outcome
        self._facts = facts
        self._shape = shape

    @property
    def accepted(self) -> bool:
        """Whether the model was updated."""
        return self._outcome.verdict == ACCEPTED

    @property
    def reason(self) -> str | None:
        """Why it was not, else None."""
        verdict, number = self._outcome.verdict, self._outcome.number
        if verdict == ACCEPTED:
            return None
        if verdict == STILL:
            return _WHY_NOT[int(number)]
        reason = _REFUSED.get(verdict, "the problem has no solution")
        figure = FIGURES[self._outcome.figure] if "{figure}" in reason else ""
        return reason.format(number=number, percent=100 * number, figure=figure)

    @property
    def friction(self) -> FrictionFigures:
        """The model in force afterwards."""
        return model_at(self._facts[0], self._outcome.mean)

    @property
    def figures(self) -> dict[str, float]:
        """The figures of `friction` that the law has, by name."""
        return in_own_units(self._outcome.mean, self._facts[0])

    @property
    def sigma(self) -> dict[str, float]:
        """Standard deviations of the figures that the law has, by name, in their units."""
        return in_own_units(np.sqrt(self._widened().diagonal()), self._facts[0])

    @property
    def covariance(self) -> F64:
        """Of the n figures in `sigma` in that order, shape (n, n)."""
        return in_units(self._widened(), self._facts[0])

    def _widened(self) -> F64:
        """Covariance of the state, with what the shape of the hysteresis leaves open of sigma0."""
        covariance = self._outcome.covariance.copy()
        covariance[STIFFNESS, STIFFNESS] += (self._shape * self._outcome.mean[STIFFNESS]) ** 2
        return covariance

    @property
    def expected(self) -> tuple[float, float]:
        """Sliding level Fc (1 + w) at the move's end as expected before it, and its sigma [N]."""
        before, variance = self._outcome.sliding[:2].tolist()
        coulomb = self._facts[0].coulomb
        return before * coulomb, math.sqrt(variance) * coulomb

    @property
    def sliding(self) -> tuple[float, float]:
        """Sliding level Fc (1 + w) in force at the move's end, and its sigma [N]."""
        covariance, mean = self._outcome.covariance, self._outcome.mean
        slope = np.array([1.0 + mean[LEVEL], mean[COULOMB]])
        pair = covariance[np.ix_([COULOMB, LEVEL], [COULOMB, LEVEL])]
        coulomb = self._facts[0].coulomb
        return coulomb * float(slope.prod()), coulomb * math.sqrt(float(slope @ pair @ slope))

    @property
    def shown(self) -> tuple[float, float] | None:
        """Sliding level Fc (1 + w) at the move's end as the move alone shows it, and its sigma [N].

        What was believed before is taken out again. Whether or not the move was accepted; None
        where it says nothing of it.
        """
        found = sliding_shown(self._outcome)
        if found is None or found[1] > (SHOWN * found[0]) ** 2:
            return None
        coulomb = self._facts[0].coulomb
        return found[0] * coulomb, math.sqrt(found[1]) * coulomb

    @property
    def static_ratio(self) -> tuple[float, float]:
        """Alpha and its standard deviation."""
        return self._pair("static_ratio", 1.0)

    @property
    def lag(self) -> tuple[float, float]:
        """By how much the force is later than the position, and its standard deviation [s]."""
        return self._pair("lag", self._facts[2])

    @property
    def mass(self) -> tuple[float, float]:
        """Apparent mass and its standard deviation [kg] (see `belief`)."""
        return self._pair("mass", self._facts[1])

    @property
    def gain(self) -> dict[str, float]:
        """By how much the move narrowed each of `FIGURES`: deviation before over after, or 1."""
        return dict(zip(FIGURES, self._outcome.gain[:LEVEL].tolist(), strict=True))

    @property
    def held(self) -> tuple[str, ...]:
        """Figures that were asked for and stay at their prior: the move says less than it."""
        held = self._outcome.held.tolist()
        return tuple(name for name, flag in zip(FIGURES, held, strict=True) if flag)

    @property
    def level(self) -> float:
        """Factor on the Coulomb force at the end of the move, 1 + w."""
        return 1.0 + float(self._outcome.mean[LEVEL])

    @property
    def zones(self) -> str:
        """Which zones were used: "A", "B", "AB" or ""."""
        slide, stick = self._outcome.slide > 0, self._outcome.stick > 0
        return ("A" if slide else "") + ("B" if stick else "")

    @property
    def misfit(self) -> float:
        """Rms of the whitened residual over all samples used."""
        return self._outcome.misfit

    def _pair(self, name: str, unit: float) -> tuple[float, float]:
        i = FIGURES.index(name)
        variance = float(self._outcome.covariance[i, i])
        return unit * float(self._outcome.mean[i]), unit * math.sqrt(variance)


def sliding_shown(outcome: Outcome, informative: float = INFORMATIVE) -> tuple[float, float] | None:
    """Sliding level as the move alone shows it (`Estimate.shown`), relative, and its variance.

    None where the move leaves more than the share `informative` of the variance before it.
    """
    before, variance_before, after, variance = outcome.sliding.tolist()
    if not 0.0 < variance < informative * variance_before:
        return None
    share = variance_before / (variance_before - variance)
    value = before + (after - before) * share
    return (value, variance * share) if value > 0.0 else None


def in_own_units(relative: F64, start: FrictionFigures) -> dict[str, float]:
    """Values or standard deviations of the law's figures in their units, by name.

    Args:
        relative: to the figures of `start`, in the order of `FIGURES`.
        start: model.
    """
    return {
        name: float(value) * float(getattr(start, name))
        for name, value in zip(FIGURES[:MASS], relative.tolist(), strict=False)
        if start.has(name)
    }


def in_units(relative: F64, start: FrictionFigures) -> F64:
    """Covariance of the law's figures in their units, in the order of `in_own_units`."""
    rows = relative.tolist()
    own = [(i, getattr(start, n)) for i, n in enumerate(FIGURES[:MASS]) if start.has(n)]
    return np.array([[rows[i][j] * other * unit for j, other in own] for i, unit in own])
