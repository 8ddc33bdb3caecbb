"""The causes of a gap on one axis: parameters, sigmas, probabilities, and confusable effects."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from hil_sim.effects.effect import Effect
from hil_sim.settings import AxisSettings
from sim2real.attribution.alternatives import of_size, score_alternative
from sim2real.attribution.search import AxisSearch
from sim2real.axis_units import unit_on
from sim2real.findings import Candidate, Cause, Confusable, Parameter
from sim2real.fitting import (
    NUISANCES,
    STEP,
    Coordinate,
    Term,
    coordinates,
    implausibility,
    is_coulomb_drift,
    reported_values,
)
from sim2real.scoring import weigh_effect
from sim2real.scoring.constants import (
    DAMPED,
    DOUBTED,
    ENOUGH,
    LEAST_GAIN,
    RELATIVE,
    SCATTER,
    SHOWN,
    STEP_SHARE,
    STRANGE,
    SURE,
    SURE_FAMILY,
    TEMPER,
    TUNED,
    WANDER_SHARE,
)
from sim2real.shrinkage import HeldOut, share_given_back

F64 = NDArray[np.float64]


def find_causes(
    name: str,
    found: AxisSearch,
    held_out: HeldOut,
    before: F64,
    after: F64,
    samples: F64,
) -> tuple[list[Cause], list[Confusable]]:
    """The causes found on an axis, and the effects that could take their place.

    Args:
        name: of the axis.
        found: its search, after the closed-loop check.
        held_out: residuals on held-out moves.
        before: their energies by the machine file, float64[moves, signals].
        after: by the final model.
        samples: of the moves, float64[moves, signals].
    """
    problem, best = found.problem, found.best
    causes, alike = [], []
    at = STEP if found.folds else NUISANCES  # the free loop knows no integration step
    for index, term in enumerate(best.model.terms):
        entries = coordinates(term.effect, problem.axis)
        spread = (
            np.full(len(entries), np.nan)
            if best.covariance is None
            else np.sqrt(np.diag(best.covariance))[at : at + len(entries)]
        )
        at += len(entries)
        left_out = held_out.energies(held_out.without[name, index])
        gives_back, interval = share_given_back(before, left_out, after, samples)
        figures = _figures(term, spread, problem.axis)
        if found.free is None:
            probability, alternatives = name_probability(found, term.name)
        else:
            probability, alternatives = found.free.probability(term.name)
        probability = min(probability, _largest_probability(found, term, figures))
        causes.append(
            Cause(
                name,
                term.name,
                probability,
                figures,
                gives_back,
                interval,
                term.effect.remedy,
            )
        )
        if alternatives:
            alike.append(Confusable(name, (term.name, *alternatives), _why_alike(found, term)))
    return causes, alike


def _why_alike(found: AxisSearch, term: Term) -> str:
    """Why an effect is confusable with others."""
    axis = found.problem.axis
    models = [r.model for r in found.alternatives] if term.name in found.levels else []
    swaps = {t.name: t for m in models for t in m.terms if t.name in found.levels[term.name]}
    later = any(is_coulomb_drift(t, axis) for t in (term, *swaps.values()) if swaps)
    return "on these moves one fits nearly as well as the other" + (
        "; a recording minutes later tells them apart" if later else ""
    )


def _figures(term: Term, spread: F64, axis: AxisSettings) -> dict[str, Parameter]:
    """Key -> value and sigma of a term; `spread` are sigmas of its coordinates, float64[n]."""
    values = reported_values(term)
    return {
        entry.parameter.key: Parameter(
            values[entry.parameter.key],
            _sigma(term.effect, entry, values, float(s), axis),
            unit_on(axis, entry.parameter.unit),
        )
        for entry, s in zip(coordinates(term.effect, axis), spread, strict=True)
    }


def _largest_probability(found: AxisSearch, term: Term, figures: Mapping[str, Parameter]) -> float:
    """Largest probability that a term's figures allow: `DOUBTED`, or 1 where they raise no doubt.

    Doubt arises from a size that may be zero by its sigma (unless the effect has another shape than
    the library's), and from implausible values (unless the effect stands for a free form, or alone
    explains the axis completely). What the fit needs is doubted for both only.
    """
    axis = found.problem.axis
    repeat = found.repeats.get(term.name)
    departs = repeat is not None and repeat.departs
    is_free = repeat is not None and repeat.is_free
    alone = found.is_complete and len(found.best.model.terms) == 1
    entries = coordinates(term.effect, axis)
    uncertain = not departs and any(_is_size_uncertain(entry, figures, axis) for entry in entries)
    implausible = not (is_free or alone) and implausibility(term, axis) > STRANGE
    doubts = uncertain + implausible
    return DOUBTED if doubts > _is_needed(found, term) else 1.0


def _is_needed(found: AxisSearch, term: Term) -> bool:
    """Whether the model is complete with an effect and scores clearly worse without it.

    Such an effect is present even if its size is uncertain: of a bell beyond the end of the travel
    only the flank is seen, which bells of many heights share.
    """
    rest = {name for name in found.best.model.names() if name != term.name}
    score = {
        frozenset(a.model.names()): score_alternative(found.problem, a) for a in found.alternatives
    }
    own, without = score.get(frozenset({*rest, term.name})), score.get(frozenset(rest))
    if not found.is_complete or own is None or without is None:
        return False
    return without - own > LEAST_GAIN


def _is_size_uncertain(
    entry: Coordinate, figures: Mapping[str, Parameter], axis: AxisSettings
) -> bool:
    """Whether a size may as well be zero."""
    neutral = entry.parameter.neutral_on(axis)
    if entry.parameter.role != "size" or neutral is None or not math.isfinite(neutral):
        return False
    figure = figures[entry.parameter.key]
    return figure.sigma > abs(figure.value - neutral)


def _sigma(
    effect: Effect,
    entry: Coordinate,
    values: Mapping[str, float],
    fitted: float,
    axis: AxisSettings,
) -> float:
    """One sigma of a parameter: of the fit, the model's inaccuracy, and the friction's wander.

    Parameters scatter over simulated stages by about twice the sigma of the fit. Sizes are known to
    0.3 % at best, factors on Coulomb friction to two fifths of its wander, and delays to a
    twentieth of the control period, by which integrators differ. Integration also changes the
    damping and the frequency of oscillators a little.
    """
    parameter = entry.parameter
    value = values[parameter.key]
    own = SCATTER * fitted * abs(entry.slope(value))
    if parameter.key == "damping" and "frequency" in values:
        turned = 2.0 * math.pi * values["frequency"] * axis.control.period
        return math.hypot(own, DAMPED * turned)
    if parameter.key == "frequency" and effect.group == "dynamics":
        return math.hypot(own, TUNED * value)
    neutral = parameter.neutral_on(axis)
    if parameter.role != "size" or neutral is None:
        return own
    if not math.isfinite(neutral):
        return math.hypot(own, RELATIVE * abs(value))
    wander = WANDER_SHARE * axis.wander
    if effect.group != "friction":  # a force shows in the mean over both directions
        slow = not any(p.role == "phase" for p in effect.parameters)
        wander *= axis.friction.coulomb if slow and parameter.unit == "N" else 0.0
    step = STEP_SHARE * axis.control.period if parameter.unit == "s" else 0.0
    return math.hypot(own, RELATIVE * abs(value - neutral), wander, step)


def name_probability(found: AxisSearch, effect: str) -> tuple[float, list[str]]:
    """Probability that an effect is present, and the effects that could take its place.

    Scores of innovations count a fifth (`TEMPER`). Between effects on the Coulomb level the odds
    are those that `settle_levels` gave.
    """
    problem, names = found.problem, found.best.model.names()
    # Among models that all leave structure the closed loop decides, not the innovations.
    departs = effect in found.repeats and found.repeats[effect].departs
    widest = math.inf
    if departs:
        own_gaps = (a.gap for a in found.alternatives if set(a.model.names()) == set(names))
        widest = min(own_gaps, default=math.inf)
    scores = {
        tuple(sorted(a.model.names())): score_alternative(problem, a) / TEMPER
        for a in reversed(found.alternatives)
        if a.gap <= widest
    }
    own = scores.setdefault(tuple(sorted(names)), min(scores.values(), default=0.0))
    for other, odds in found.levels.get(effect, {}).items():
        swapped = tuple(sorted({*names, other} - {effect}))
        scores[swapped] = own - 2.0 * math.log(odds) if odds > 0.0 else math.inf
    probability, others = weigh_effect(scores, names, effect)
    return probability * _confidence(found, effect), others


def _confidence(found: AxisSearch, effect: str) -> float:
    """Confidence in a name: nearly 1 where nothing is left, or the share of the gap closed.

    An effect of the right family in another shape closes most of the gap, and the same effect
    once more takes up the rest.
    """
    if effect in found.repeats and found.repeats[effect].departs:
        return SURE_FAMILY
    return SURE if found.closes > ENOUGH else max(found.closes, 0.0)


def list_candidates(
    name: str, found: AxisSearch, causes: Sequence[Cause], gap: float
) -> list[Candidate]:
    """The most promising effects of an axis, causes or not.

    Args:
        name: of the axis.
        found: its search.
        causes: found on it.
        gap: combined squared gap less its floor, of all axes.
    """
    probabilities = {cause.effect: cause.probability for cause in causes}
    closes = {
        alternative.model.names()[0]: (found.open_gap - alternative.gap) / max(gap, 1e-9)
        for alternative in of_size(found.alternatives, 1)
    }
    closes |= {cause.effect: cause.gap_closed or 0.0 for cause in causes}
    ranked = sorted(found.scanned.items(), key=lambda item: -item[1])[:SHOWN]
    left = max(0.0, 1.0 - sum(probabilities.values()))
    total = sum(math.log1p(max(gain, 0.0)) for n, gain in ranked if n not in probabilities) + 1e-9
    return [
        Candidate(
            name,
            effect,
            probabilities.get(effect, left * 0.1 * math.log1p(max(gain, 0.0)) / total),
            closes.get(effect),
        )
        for effect, gain in ranked
    ]
