"""The causes of a gap on one axis: parameters with their sigmas, probabilities, what is alike."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hil_sim.effects.effect import Effect
from hil_sim.settings import AxisSettings
from sim2real.axis_model import BASE, Coordinate, coordinates, parameters
from sim2real.held_out import HeldOut, given_back
from sim2real.report import Candidate, Cause, Confusable, Parameter
from sim2real.search import AxisSearch

F64 = NDArray[np.float64]

_TEMPER = 40.0
"""The log likelihood counts for so much less than it says: innovations of the true model are white,
those of a model that is right but for details are not."""
_SCATTER, _LIKENESS, _WANDERS, _STEP = 1.5, 0.003, 0.25, 0.05
"""What a fit's own sigma leaves out: see `_sigma`."""
_STEEP = 1.6
"""How fast trust in a name falls with the share of the gap that is left."""
_SHOWN = 8
"""Candidates shown per axis."""


def causes_of(
    name: str,
    found: AxisSearch,
    held_out: HeldOut,
    before: F64,
    after: F64,
    samples: F64,
) -> tuple[list[Cause], list[Confusable]]:
    """What was found on an axis, and what could stand in its place.

    Args:
        name: of the axis.
        found: its search, after the gate.
        held_out: residuals on held-out moves.
        before: their energies by the machine file, float64[moves, signals].
        after: by the final model.
        samples: of the moves.
    """
    problem, best = found.problem, found.best
    causes, alike = [], []
    at = len(BASE)
    for index, term in enumerate(best.model.terms):
        entries = coordinates(term.effect, problem.axis)
        spread = (
            np.full(len(entries), np.nan)
            if best.covariance is None
            else np.sqrt(np.diag(best.covariance))[at : at + len(entries)]
        )
        at += len(entries)
        left_out = held_out.energies(held_out.without[name, index])
        gives_back, interval = given_back(before, left_out, after, samples)
        probability, rivals = _probability(found, term.name)
        values = parameters(term)
        causes.append(
            Cause(
                name,
                term.name,
                probability,
                {
                    entry.parameter.key: Parameter(
                        values[entry.parameter.key],
                        _sigma(
                            term.effect, entry, values[entry.parameter.key], float(s), problem.axis
                        ),
                        entry.parameter.unit,
                    )
                    for entry, s in zip(entries, spread, strict=True)
                },
                gives_back,
                interval,
                term.effect.remedy,
            )
        )
        if rivals:
            alike.append(
                Confusable(
                    name,
                    (term.name, *rivals),
                    "on these moves either fits nearly as well in the other's place",
                )
            )
    return causes, alike


def _sigma(
    effect: Effect, entry: Coordinate, value: float, fitted: float, axis: AxisSettings
) -> float:
    """One sigma of a parameter: of the fit, of the models' likeness, and of the friction's wander.

    Trials on simulated stages scatter half as much again as the fit says; sizes are known to a few
    parts in a thousand at best, what scales Coulomb friction to a quarter of its wander, and
    delays to a twentieth of the control period, by which integrators differ.
    """
    own = _SCATTER * fitted * abs(entry.slope(value))
    parameter = entry.parameter
    neutral = parameter.neutral_on(axis)
    if parameter.role != "size" or neutral is None or not math.isfinite(neutral):
        return own
    wander = _WANDERS * axis.friction.wander if effect.group == "friction" else 0.0
    step = _STEP * axis.control.period if parameter.unit == "s" else 0.0
    return math.hypot(own, _LIKENESS * abs(value - neutral), wander, step)


def _probability(found: AxisSearch, effect: str) -> tuple[float, list[str]]:
    """Probability that an effect is present, and the effects that could stand in its place."""
    problem = found.problem
    best = found.best
    names = best.model.names()
    rest = tuple(sorted(n for n in names if n != effect))
    cost = problem.cost(best.model, best.residual)
    weight, rivals = 0.0, []
    for rival in found.rivals:
        others = tuple(sorted(rival.model.names()))
        if effect in others:
            continue
        worse = problem.cost(rival.model, problem.residual(rival.model)) - cost
        odds = math.exp(-max(worse, 0.0) / (2.0 * _TEMPER))
        weight += odds
        swapped = [n for n in others if n not in rest]
        if odds > 0.05 and len(others) == len(names) and len(swapped) == 1:
            rivals.append(swapped[0])
    told = 1.0 / (1.0 + weight)
    return told * _trust(found), rivals


def _trust(found: AxisSearch) -> float:
    """How far a name can be trusted: nearly whole, or as much of the gap as it closes tells.

    An effect of the right family in another shape closes most of the gap, a stranger's nearest kin
    less (docs/blind.md).
    """
    if found.whole:
        return 0.99
    return float(np.clip(_STEEP * found.closes + 1.0 - _STEEP, 0.05, 0.95))


def candidates_of(name: str, found: AxisSearch, causes: Sequence[Cause]) -> list[Candidate]:
    """The effects that looked most promising on an axis, causes or not."""
    probabilities = {cause.effect: cause.probability for cause in causes}
    ranked = sorted(found.scanned.items(), key=lambda item: -item[1])[:_SHOWN]
    left = max(0.0, 1.0 - sum(probabilities.values()))
    total = sum(math.log1p(max(gain, 0.0)) for n, gain in ranked if n not in probabilities) + 1e-9
    return [
        Candidate(
            name,
            effect,
            probabilities.get(effect, left * 0.1 * math.log1p(max(gain, 0.0)) / total),
            None,
        )
        for effect, gain in ranked
    ]
