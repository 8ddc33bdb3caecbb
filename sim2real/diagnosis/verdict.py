"""The conclusions of a diagnosis: verdict, reason, causes, figures, next experiment."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from hil_sim.settings import StageSettings
from sim2real.attribution import (
    AxisSearch,
    FreeFormTest,
    FrictionOverPosition,
    find_causes,
    list_candidates,
    of_size,
)
from sim2real.diagnosis.examination import Examination
from sim2real.diagnosis.plant_figures import figures_of_search, settle_figures
from sim2real.experiment import propose_experiment
from sim2real.findings import (
    EXPLAINED,
    NO_GAP,
    PARTLY_EXPLAINED,
    SHOWN_AS,
    UNEXPLAINED,
    Candidate,
    Cause,
    Confusable,
    GapFigures,
    GapReport,
    NextExperiment,
    SelectionStep,
)
from sim2real.fitting import (
    BASE,
    AxisModel,
    coordinate,
    plant_figure,
    with_base,
)
from sim2real.gap import NO_GAP_BELOW, Signals, combined_floors
from sim2real.scoring.constants import ENOUGH, NEAR
from sim2real.shrinkage import HeldOut, combined_energy, share_closed

F64 = NDArray[np.float64]

_SMALLER = 2.0
"""Largest squared gap over floor per signal that counts as no gap where no cause was found and an
axis is not complete; with all axes complete it is `NEAR`."""
_FAR_OFF = {"position": 0.1, "force": 0.5}
"""Ratio of a signal's gap to its own standard deviation from which the gap is large, however large
the floor is: the floor of a model that is far off is not reliable."""
_TRAVELLED = 1e-4
"""Smallest standard deviation of an axis' demand at which this ratio is examined [m]."""
_POOR, _DOUBT = 0.15, 3.0
"""A figure is poorly known when sigma exceeds this share of it; and the sigmas by which an
experiment must be able to tell it from another value."""


@dataclass(frozen=True, slots=True, eq=False)
class Diagnosis:
    """A diagnosis and what it is based on.

    Attributes:
        report: its results.
        models: axis -> base parameters and effects, fitted to all moves; where causes are named,
            with the figures that the twin gets.
        searches: axis -> the search.
        explained: signals of the model with the causes found, each move by a fit to other moves,
            one entry per recording; empty where no cause was found.
        plant: axis -> figure of the plant -> value, for the twin: what the recordings do not know
            is as the machine file has it (`plant_figures`).
        profiles: friction over position, where it was named as a cause.
        steps: axis -> the model of each of its steps in the report.
    """

    report: GapReport
    models: Mapping[str, AxisModel]
    searches: Mapping[str, AxisSearch]
    explained: tuple[Signals, ...] = ()
    plant: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    profiles: tuple[FrictionOverPosition, ...] = ()
    steps: Mapping[str, Sequence[AxisModel]] = field(default_factory=dict)


def conclude(
    examined: Examination,
    plain: GapReport,
    searches: Mapping[str, AxisSearch],
    held_out: HeldOut,
) -> Diagnosis:
    """Draw the conclusions of all searches (long: one verdict after another).

    Args:
        examined: the recordings.
        plain: report without causes.
        searches: axis -> its search.
        held_out: residuals on held-out moves.
    """
    samples = held_out.samples()
    before, after = held_out.energies(held_out.before), held_out.energies(held_out.after)
    signals = before.shape[1]
    total = combined_energy(before, samples)
    share, interval = share_closed(before, after, samples)
    in_sample, _ = share_closed(before, held_out.energies(held_out.fitted), samples)
    causes, candidates, confusable = _gather(searches, held_out, (before, after, samples))
    whole = all(
        found.is_complete and not any(r.departs for r in found.repeats.values())
        for found in searches.values()
    )
    models = {name: found.best.model for name, found in searches.items()}
    confident = [cause for cause in causes if cause.probability > 0.5]
    left, left_out = held_out.after, _left_out(searches, confident)
    if confident and left_out:  # the twin has only the probable causes, so only they are promised
        whole, in_sample = False, None
        left = max(
            (held_out.without[key] for key in left_out),
            key=lambda residual: combined_energy(held_out.energies(residual), samples),
        )
        share, interval = share_closed(before, held_out.energies(left), samples)
    if confident:
        enough = whole and share is not None and share >= ENOUGH
        verdict = EXPLAINED if enough else PARTLY_EXPLAINED
    else:
        # Without causes the better of file and fit counts: figures fitted to a coarse log may be
        # worse than the file's. With improbable causes the file's gap counts, whatever they close.
        fitted = total if causes else combined_energy(after, samples)
        remaining = min(fitted, total) / signals
        verdict = _verdict_without_causes(causes, remaining, whole)
    far_off = describe_far_off(examined)
    if verdict == NO_GAP and far_off:
        verdict = UNEXPLAINED
    reason = _reason(verdict, confident, share, combined_floors(examined.gap or {}), whole)
    if verdict == UNEXPLAINED and far_off:
        reason += f"; {far_off}"
    report = replace(
        plain,
        verdict=verdict,
        reason=reason,
        where=() if verdict == NO_GAP else plain.where,
        candidates=tuple(candidates),
        confusable=tuple(confusable),
    )
    if confident:
        report = replace(
            report,
            reason=reason + _departed(searches),
            gap=_explained_gap(examined, held_out, left),
            gap_closed=share,
            gap_closed_interval=interval,
            gap_closed_in_sample=in_sample,
            causes=tuple(confident),
            steps=_steps(searches),
        )
    report = replace(report, next_experiment=_next(report, searches, models, examined))
    if not confident:
        return Diagnosis(report, models, searches)
    tests = (FreeFormTest(name, examined.measured, examined.settings) for name in models)
    profiles = tuple(profile for test in tests for profile in test.profiles(models))
    settled = {name: settle_figures(figures_of_search(found)) for name, found in searches.items()}
    models = {name: model for name, (model, _) in settled.items()}
    report = replace(report, figures=tuple(c for _, own in settled.values() for c in own))
    plant = moved_figures(examined.settings, models)
    steps = {
        name: tuple(step.model for step in found.free.steps)
        for name, found in searches.items()
        if found.free is not None
    }
    return Diagnosis(report, models, searches, held_out.explained(), plant, profiles, steps)


def _left_out(
    searches: Mapping[str, AxisSearch], confident: Sequence[Cause]
) -> list[tuple[str, int]]:
    """Axis and index of the effects of the models that are not among the probable causes."""
    named = {(cause.axis, cause.effect) for cause in confident}
    return [
        (axis, index)
        for axis, found in searches.items()
        for index, name in enumerate(found.best.model.names())
        if (axis, name) not in named
    ]


def _steps(searches: Mapping[str, AxisSearch]) -> tuple[SelectionStep, ...]:
    """Steps of the axes where the free loop took over."""
    return tuple(
        SelectionStep(axis, step.added, step.effects, step.closed, step.uncertainty)
        for axis, found in searches.items()
        if found.free is not None and found.best.model.terms
        for step in found.free.steps
    )


def _verdict_without_causes(causes: Sequence[Cause], remaining: float, whole: bool) -> str:
    """Verdict where no cause is probable: `no_gap` if little remains, else `unexplained`.

    Args:
        causes: improbable ones.
        remaining: squared combined gap over floor, per signal: of the machine file, or of fitted
            base parameters alone where these leave less.
        whole: whether all axes are complete and no effect departs from its equation.
    """
    small = not causes and remaining < (NEAR if whole else _SMALLER)
    return NO_GAP if small or remaining < NO_GAP_BELOW else UNEXPLAINED


def describe_far_off(examined: Examination) -> str:
    """In words, the signals whose gap is a large part of the recorded signal; "" if there are none.

    A model that far off makes other motions than the stage, and its floor, which is taken from
    them, may be as large as the gap.
    """
    found = []
    for axis, signals in (examined.gap or {}).items():
        demands = [m.replay.recording.axes[axis].position_demand for m in examined.measured]
        if max(float(np.std(demand)) for demand in demands) < _TRAVELLED:
            continue
        measured = [m.replay.measured()[axis] for m in examined.measured]
        valid = [m.replay.valid(axis) for m in examined.measured]
        for signal, figures in signals.items():
            logged = [m[signal][v] for m, v in zip(measured, valid, strict=True)]
            own = float(np.sqrt(np.mean([np.var(values) for values in logged])))
            if figures.nominal > _FAR_OFF[signal] * own:
                scale, unit = SHOWN_AS[figures.unit]
                found.append(
                    f"the {signal} of {axis} is simulated {figures.nominal * scale:.3g} {unit} rms "
                    f"off, and varies by {own * scale:.3g} {unit}"
                )
    return ", and ".join(found)


def _gather(
    searches: Mapping[str, AxisSearch], held_out: HeldOut, energies: tuple[F64, F64, F64]
) -> tuple[list[Cause], list[Candidate], list[Confusable]]:
    """Causes, largest share of the gap first, candidates and confusable effects of all axes.

    Args:
        searches: axis -> its search.
        held_out: residuals on held-out moves.
        energies: of the moves by the machine file and by the final model, and their samples,
            float64[moves, signals] each.
    """
    before, after, samples = energies
    above_floor = combined_energy(before, samples) - before.shape[1]
    causes, candidates, confusable = [], [], []
    for name, found in searches.items():
        own, alike = find_causes(name, found, held_out, before, after, samples)
        causes += own
        confusable += alike
        candidates += list_candidates(name, found, own, above_floor)
    causes.sort(key=lambda cause: -(cause.gap_closed or 0.0))
    return causes, candidates, confusable


def _next(
    report: GapReport,
    searches: Mapping[str, AxisSearch],
    models: Mapping[str, AxisModel],
    examined: Examination,
) -> NextExperiment | None:
    """Moves that would decide what these recordings leave open; None where nothing is open."""

    def between(why: str, axis: str, one: AxisModel, other: AxisModel) -> NextExperiment | None:
        return propose_experiment(
            why,
            {**models, axis: one},
            {**models, axis: other},
            axis,
            examined.measured,
            examined.settings,
        )

    for alike in report.confusable:
        found = searches[alike.axis]
        effect, substitute = alike.effects[:2]
        swapped = {*found.best.model.names(), substitute} - {effect}
        for alternative in found.alternatives:
            if set(alternative.model.names()) == swapped:
                why = f"{effect} and {substitute} on {alike.axis} fit nearly as well"
                return between(why, alike.axis, found.best.model, alternative.model)
    if report.verdict == UNEXPLAINED:
        axis = max(searches, key=lambda name: searches[name].open_gap)
        nearer = [
            alternative
            for alternative in of_size(searches[axis].alternatives, 1)
            if alternative.gap < searches[axis].open_gap
        ]
        nearest = [alternative.model for alternative in nearer[:2]]
        if len(nearest) == 2:
            names = " nor ".join(model.names()[0] for model in nearest)
            return between(f"neither {names} explains {axis}", axis, *nearest)
    for cause in report.causes:
        model = models[cause.axis]
        index = model.names().index(cause.effect)
        for key, poor in cause.parameters.items():
            if poor.sigma > _POOR * abs(poor.value) and model.terms[index].is_size_or_shape(key):
                why = f"{key} of {cause.effect} on {cause.axis} is known only to {poor.sigma:.2g}"
                within = coordinate(
                    model.terms[index].effect, key, searches[cause.axis].problem.axis
                )
                farther = within.clipped(poor.value + _DOUBT * poor.sigma)
                other = model.with_value(index, key, farther)
                return between(why, cause.axis, model, other)
    return None


def moved_figures(
    settings: StageSettings, models: Mapping[str, AxisModel]
) -> dict[str, dict[str, float]]:
    """Plant figures that models change, axis -> figure -> value."""
    out = {}
    for axis in settings.axes:
        if axis.name not in models:
            continue
        base = models[axis.name].base
        moved = with_base(axis, base)
        changed = {f: plant_figure(moved, f) for j, f in enumerate(BASE) if base[j] != 0.0}
        if changed:
            out[axis.name] = changed
    return out


def _departed(searches: Mapping[str, AxisSearch]) -> str:
    """For the reason: effects whose shape is not the library's."""
    names = [
        f"{effect} on {axis}"
        for axis, found in searches.items()
        for effect, repeat in found.repeats.items()
        if repeat.departs
    ]
    return f"; the shape of {' and '.join(names)} is not the library's" if names else ""


def _explained_gap(
    examined: Examination, held_out: HeldOut, residuals: Sequence[Signals]
) -> Mapping[str, Mapping[str, GapFigures]]:
    """The gap's figures with what the causes leave on held-out moves: `residuals` of each."""
    out: dict[str, dict[str, GapFigures]] = {}
    for axis, signals in (examined.gap or {}).items():
        out[axis] = {}
        for signal, figures in signals.items():
            energy = count = 0.0
            for m, left in zip(held_out.measured, residuals, strict=True):
                valid = m.replay.valid(axis)
                energy += float(np.square(left[axis][signal][valid]).sum())
                count += float(valid.sum())
            out[axis][signal] = replace(figures, explained=math.sqrt(energy / count))
    return out


def _reason(
    verdict: str, causes: Sequence[Cause], share: float | None, floors: float, whole: bool
) -> str:
    """The reason for a verdict, in one sentence."""
    size = f"the combined gap is {floors:.3g} times the floor"
    if verdict == NO_GAP:
        return f"{size}: within the machine file's tolerance and repeatability"
    if verdict == UNEXPLAINED:
        return f"{size}, and no effect of the library explains it"
    verb = "closes" if len(causes) == 1 else "close"
    closed = "" if share is None else f" {verb} {100 * share:.0f} % of it on held-out moves"
    rest = "" if whole else "; the residual still has structure"
    return f"{size}; {name_causes(causes)}{closed}{rest}"


def name_causes(causes: Sequence[Cause]) -> str:
    """Causes in a sentence: a on x, b on y and c on y."""
    *others, last = (f"{cause.effect} on {cause.axis}" for cause in causes)
    return f"{', '.join(others)} and {last}" if others else last
