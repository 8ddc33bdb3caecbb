"""The causes of a gap on one axis: parameters, sigmas, probabilities, and confusable effects."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from hil_sim.effects import Effect
from hil_sim.settings import AxisSettings
from sim2real.attribution.alternatives import of_size
from sim2real.attribution.axis_search import AxisResult
from sim2real.findings import Candidate, Cause, Confusable, Parameter
from sim2real.fitting import (
    STEP,
    Coordinate,
    Term,
    coordinates,
    implausibility,
    is_coulomb_drift,
    reported_values,
)
from sim2real.held_out import HeldOut
from sim2real.scoring.constants import (
    CLOSED,
    DAMPED,
    DOUBTED,
    LITTLE,
    RELATIVE,
    SHOWN,
    SIGNIFICANT,
    STEP_SHARE,
    STRANGE,
    TUNED,
    UNCERTAIN,
    WANDER_SHARE,
)


def find_causes(
    result: AxisResult, held_out: HeldOut, *, along_motion: bool
) -> tuple[list[Cause], list[Confusable]]:
    """The causes found on an axis, and the effects that could take their place.

    Args:
        result: its search, after the closed-loop check.
        held_out: what models leave on held-out moves.
        along_motion: whether they are those of the force along the measured motion.
    """
    axis, terms = result.axis, result.best.model.terms
    causes: list[Cause] = []
    limits: list[float] = []
    alike: list[Confusable] = []
    variances = np.diag(result.covariance())[STEP:] if terms else np.empty(0)
    sigmas = iter(np.sqrt(np.maximum(variances, 0.0)).tolist())
    for index, term in enumerate(terms):
        values = reported_values(term)
        figures = {}
        for entry, fitted in zip(coordinates(term.effect, axis), sigmas, strict=False):
            key, per_coordinate = entry.parameter.key, abs(entry.slope(values[entry.parameter.key]))
            sigma = result.scatter * fitted * per_coordinate
            if not along_motion:
                sigma = math.hypot(sigma, _inaccuracy(term.effect, entry, values, axis))
            figures[key] = Parameter(values[key], sigma, axis.unit_of(entry.parameter.unit))
        probability, others = result.probability(term.name)
        gives_back, interval = held_out.given_back(axis.name, index)
        limits.append(_largest_probability(result, term, figures, interval))
        causes.append(
            Cause(
                axis.name,
                term.name,
                min(probability, limits[-1]),
                figures,
                gives_back,
                interval,
                term.effect.remedy,
            )
        )
        if others:
            where = "along this motion" if along_motion else "on these moves"
            why = f"{where} one fits nearly as well as the other{_later(result, term)}"
            alike.append(Confusable(axis.name, (term.name, *others), why))
    if DOUBTED in limits:  # without what is doubted the others are not complete
        result = replace(result, is_complete=False)
        causes = [_limited(result, term, c) for term, c in zip(terms, causes, strict=True)]
    return causes, alike


def _limited(result: AxisResult, term: Term, cause: Cause) -> Cause:
    """A cause with no more than its largest probability in a result."""
    interval = cause.gap_closed_interval or (0.0, 0.0)
    limit = _largest_probability(result, term, cause.parameters, interval)
    return replace(cause, probability=min(cause.probability, limit))


def _later(result: AxisResult, term: Term) -> str:
    """What to do about an effect that only time tells from another level of friction."""
    models = [a.model for a in result.alternatives] if term.name in result.levels else []
    swaps = {t.name: t for m in models for t in m.terms if t.name in result.levels[term.name]}
    later = any(is_coulomb_drift(t, result.axis) for t in (term, *swaps.values()) if swaps)
    return "; a recording minutes later tells them apart" if later else ""


def _largest_probability(
    result: AxisResult,
    term: Term,
    figures: Mapping[str, Parameter],
    given_back: tuple[float, float],
) -> float:
    """Largest probability that a term's figures allow: `DOUBTED` where they raise a doubt.

    Without doubts it is 1, or `UNCERTAIN` where the model leaves structure, where the recordings do
    not show the effect's shape, and of a constant level of friction, which a slow drift resembles
    within seconds. Doubt arises from a size that may be zero by two sigmas, and from implausible
    values, unless the effect alone explains the axis completely. What the fit needs is doubted for
    both only. What gives back nothing of the gap when it is removed, by the interval over moves, is
    always doubted, and so is what gives back next to nothing where structure is left, and what is
    not needed beside a curve.
    """
    is_little = given_back[1] < LITTLE and not result.is_complete
    if given_back[0] <= 0.0 or is_little or term.name in result.doubted:
        return DOUBTED
    axis = result.axis
    alone = result.is_complete and len(result.best.model.terms) == 1
    entries = coordinates(term.effect, axis)
    # The figures of one that is needed may be known together only.
    is_needed = alone and len(entries) > 1 and given_back[0] >= CLOSED
    uncertain = not is_needed and any(_is_size_uncertain(e, figures, axis) for e in entries)
    implausible = not alone and implausibility(term, axis) > STRANGE
    doubts = uncertain + implausible
    shown = not any(_is_shape_unknown(entry, figures) for entry in entries)
    is_sure = result.is_complete and shown and term.ports(axis).coulomb == 1.0
    most = 1.0 if is_sure else UNCERTAIN
    return DOUBTED if doubts > result.is_needed(term) else most


def _is_size_uncertain(
    entry: Coordinate, figures: Mapping[str, Parameter], axis: AxisSettings
) -> bool:
    """Whether a size may as well be zero."""
    neutral = entry.parameter.neutral_on(axis)
    if entry.parameter.role != "size" or neutral is None or not math.isfinite(neutral):
        return False
    figure = figures[entry.parameter.key]
    return SIGNIFICANT * figure.sigma > abs(figure.value - neutral)


def _is_shape_unknown(entry: Coordinate, figures: Mapping[str, Parameter]) -> bool:
    """Whether a shape may as well be any other: a time constant far beyond the recording."""
    figure = figures[entry.parameter.key]
    return entry.parameter.role == "shape" and figure.sigma > abs(figure.value)


def _inaccuracy(
    effect: Effect, entry: Coordinate, values: Mapping[str, float], axis: AxisSettings
) -> float:
    """What the model's inaccuracy and the friction's wander add to the sigma of a parameter.

    Sizes are known to 0.3 % at best, factors on Coulomb friction to two fifths of its wander, and
    delays to a twentieth of the control period, by which integrators differ. Integration also
    changes the damping and the frequency of oscillators a little.
    """
    parameter = entry.parameter
    value = values[parameter.key]
    if parameter.key == "damping" and "frequency" in values:
        return DAMPED * 2.0 * math.pi * values["frequency"] * axis.control.period
    if parameter.key == "frequency" and effect.group == "dynamics":
        return TUNED * value
    neutral = parameter.neutral_on(axis)
    if parameter.role != "size" or neutral is None:
        return 0.0
    if not math.isfinite(neutral):
        return RELATIVE * abs(value)
    wander = WANDER_SHARE * axis.wander
    if effect.group != "friction":  # a force shows in the mean over both directions
        slow = not any(p.role == "phase" for p in effect.parameters)
        wander *= axis.friction.coulomb if slow and parameter.unit == "N" else 0.0
    step = STEP_SHARE * axis.control.period if parameter.unit == "s" else 0.0
    return math.hypot(RELATIVE * abs(value - neutral), wander, step)


def list_candidates(result: AxisResult, causes: Sequence[Cause], gap: float) -> list[Candidate]:
    """The most promising effects of an axis, causes or not.

    Args:
        result: its search.
        causes: found on it.
        gap: combined squared gap over the floor, less that of a perfect model, of all axes.
    """
    name = result.axis.name
    if not result.scanned and result.free is not None:
        steps = () if result.free.of_rest else result.free.steps
        alone = {s.effects[0]: s.closed for s in steps if len(s.effects) == 1}
        names = sorted(result.best.model.names())
        listed = [Candidate(name, n, result.probability(n)[0], alone.get(n)) for n in names]
        return sorted(listed, key=lambda candidate: -candidate.probability)[:SHOWN]
    probabilities = {cause.effect: cause.probability for cause in causes}
    closes = {
        alternative.model.names()[0]: (result.open_gap - alternative.gap) / max(gap, 1e-9)
        for alternative in of_size(result.alternatives, 1)
    }
    closes |= {cause.effect: cause.gap_closed or 0.0 for cause in causes}
    gains = {effect: candidate.gain for effect, candidate in result.scanned.items()}
    ranked = sorted(gains.items(), key=lambda item: -item[1])[:SHOWN]
    remaining = max(0.0, 1.0 - sum(probabilities.values()))
    total = sum(math.log1p(max(gain, 0.0)) for n, gain in ranked if n not in probabilities) + 1e-9
    return [
        Candidate(
            name,
            effect,
            probabilities.get(effect, remaining * 0.1 * math.log1p(max(gain, 0.0)) / total),
            closes.get(effect),
        )
        for effect, gain in ranked
    ]
