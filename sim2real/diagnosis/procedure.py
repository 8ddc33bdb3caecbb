"""Which effects cause the gap, how surely, and how far it shrinks once they are added.

The search runs on tracked innovations (`sim2real.tracking`), where the friction's wander is
filtered out; what it finds is then judged by what the reader cares for, the free closed-loop gap,
on moves that took no part in fitting.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from hil_sim.effects.effect import Effect
from hil_sim.settings import StageSettings
from sim2real.attribution import (
    AxisSearch,
    FrictionOverPosition,
    InMotion,
    beside,
    candidates_of,
    causes_of,
    gate,
    in_free_form,
    is_one_profile,
    nearest,
    repeats,
    search,
    sets_of,
)
from sim2real.diagnosis.examination import Examination, Progress, without_causes
from sim2real.experiment import next_experiment
from sim2real.fitting import BASE, AxisModel, AxisProblem, Workers, composed, coordinate, with_base
from sim2real.gap import Signals
from sim2real.report import (
    EXPLAINED,
    NO_GAP,
    PARTLY_EXPLAINED,
    UNEXPLAINED,
    Cause,
    GapFigures,
    GapReport,
    NextExperiment,
)
from sim2real.shrinkage import FOLDS, HeldOut, axis_gap, closed, combined
from sim2real.tracking import Tracker, needs_other_axes

F64 = NDArray[np.float64]

_ENOUGH = 0.9
"""Gap closed from which a gap counts as explained."""
_SMALL, _SMALLER = 3.0, 2.0
"""Combined gap over floor, squared, of what base parameters leave, up to which there is no gap:
where the innovations are white, and where they are not quite."""

_POOR, _DOUBT = 0.15, 3.0
"""A figure is poorly known whose sigma is this share of it; sigmas that an experiment must tell."""

_FREE = 0.5
"""Share of the force left in motion from which an effect is of a kind, whatever its shape: other
effects come to 0.35 at most (`benchmarks/free_forms.py`)."""


@dataclass(frozen=True, slots=True, eq=False)
class Diagnosis:
    """A diagnosis and what it rests on.

    Attributes:
        report: what it says.
        models: axis -> base parameters and effects, fitted to all moves.
        searches: axis -> the search.
        explained: signals of the model with the causes found, each move by a fit to other moves,
            one entry per recording; empty where no cause was found.
        plant: axis -> figure -> value moved within tolerance, for the twin.
        profiles: friction over position, where it was named as a cause.
    """

    report: GapReport
    models: Mapping[str, AxisModel]
    searches: Mapping[str, AxisSearch]
    explained: tuple[Signals, ...] = ()
    plant: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    profiles: tuple[FrictionOverPosition, ...] = ()


def diagnose(
    examined: Examination,
    tolerance: Mapping[str, float],
    library: Mapping[str, Effect],
    *,
    jobs: int = 2,
    progress: Progress = lambda *_: None,
) -> Diagnosis:
    """The whole diagnosis of examined recordings.

    Args:
        examined: channels, floor, gap and where.
        tolerance: axis -> relative standard deviation of the plant's figures.
        library: effects to consider, those that are searched for.
        jobs: threads: of axes, and of the fits that they wait for.
        progress: called with what is being done, steps done, all steps.
    """
    plain = without_causes(examined)
    if examined.insufficient is not None or examined.gap is None:
        return Diagnosis(plain, {}, {})
    settings = examined.settings
    names = [axis.name for axis in settings.axes]
    shares = dict.fromkeys(names, 0.0)

    def searched(name: str) -> AxisSearch:
        problem = AxisProblem(
            [Tracker(m.replay, settings, name) for m in examined.measured],
            max(tolerance.get(name, 0.0), 1e-4),
            workers,
        )

        def told(share: float) -> None:
            shares[name] = share
            progress("effects", round(100 * sum(shares.values())), 100 * len(names))

        return search(problem, library, partial(looped, name), told)

    def looped(name: str, model: AxisModel) -> float:
        workers.check()
        return axis_gap(name, {name: model}, examined.measured, settings)

    def repeated(name: str, model: AxisModel) -> None:
        found = searches[name]
        if tuple(found.repeats) == model.names():
            return
        models = {name: other.best.model for name, other in searches.items()}

        def share(effect: Effect, model: AxisModel) -> float:
            return in_motion[name].share(effect, {**models, name: model})

        found.repeats = repeats(found.problem, model, library, partial(looped, name), share)

    def suspected(name: str) -> None:
        found, loop = searches[name], partial(looped, name)
        problem = found.problem
        pair = found.best.model
        if is_one_profile(pair, found.open_gap, problem.axis, loop):
            found.without(pair.names())
        if found.whole:
            return
        single = sets_of(found.rivals, 1)[:1]
        if single:
            repeated(name, single[0].model)
        form = in_motion[name].likeliest(library.values())
        if form is not None and form.share > _FREE:
            kind = form.effect
            starts = [problem.start.added(term) for term in form.starts]
            starts += [r.model for r in found.rivals if r.model.names() == (kind.name,)]
            model = nearest(starts, problem.axis, loop)
            shares = (form.share, in_motion[name].share(kind, {name: model}))
            repeat = in_free_form(model, shares, (found.open_gap, loop(model)))
            if repeat.before < found.open_gap:
                found.reshaped(model, repeat.before)
                found.repeats = {kind.name: repeat}
                return
        for effect, repeat in found.repeats.items():
            if repeat.departs:
                model = nearest([single[0].model, *repeat.alone(effect)], problem.axis, loop)
                found.reshaped(model, loop(model))

    library = {name: effect for name, effect in library.items() if effect.searched}
    in_motion = {name: InMotion(name, examined.measured, settings) for name in names}
    # The workers are left first: on Ctrl-C they stop the searches that the pool waits for.
    with ThreadPoolExecutor(max_workers=max(1, jobs)) as pool, Workers(jobs) as workers:
        progress("effects", 0, 100 * len(names))
        searches = dict(zip(names, pool.map(searched, names), strict=True))
        progress("shapes", 0, 3)
        _coupled(searches, settings)
        progress("shapes", 1, 3)
        list(pool.map(suspected, names))
        progress("shapes", 2, 3)
        gate(searches, examined.measured, settings)
        list(pool.map(lambda name: repeated(name, searches[name].best.model), names))
        progress("held-out moves", 0, FOLDS)
        held_out = HeldOut(examined.measured, settings, searches, pool)
    return _concluded(examined, plain, searches, held_out, settings)


def _coupled(searches: Mapping[str, AxisSearch], settings: StageSettings) -> None:
    """Axes with an effect that feels the others, fitted again beside what was found there."""
    models = {name: found.best.model for name, found in searches.items()}
    for axis in settings.axes:
        beyond = any(model.terms for name, model in models.items() if name != axis.name)
        own = models[axis.name].settings(axis)
        if beyond and needs_other_axes(own, settings.sync_period):
            beside(searches[axis.name], composed(settings, models).axes)


def _concluded(
    examined: Examination,
    plain: GapReport,
    searches: Mapping[str, AxisSearch],
    held_out: HeldOut,
    settings: StageSettings,
) -> Diagnosis:
    """Verdict, causes and figures."""
    samples = held_out.samples()
    before = held_out.energies(held_out.before)
    after = held_out.energies(held_out.after)
    signals = before.shape[1]
    total = combined(before, samples)
    share, interval = closed(before, after, samples)
    in_sample, _ = closed(before, held_out.energies(held_out.fitted), samples)
    causes, candidates, confusable = [], [], []
    whole = True
    for name, found in searches.items():
        own, alike = causes_of(name, found, held_out, before, after, samples)
        causes += own
        confusable += alike
        candidates += candidates_of(name, found, own, total - signals)
        whole &= found.whole and not any(r.departs for r in found.repeats.values())
    causes.sort(key=lambda cause: -(cause.gap_closed or 0.0))
    models = {name: found.best.model for name, found in searches.items()}
    confident = [cause for cause in causes if cause.probability > 0.5]
    remaining = combined(after, samples) / signals
    if not confident:
        small = not causes and remaining < (_SMALL if whole else _SMALLER)
        verdict = NO_GAP if small else UNEXPLAINED
        causes = [] if small else causes
    elif whole and share is not None and share >= _ENOUGH:
        verdict = EXPLAINED
    else:
        verdict = PARTLY_EXPLAINED
    reason = _reason(verdict, confident, share, total / signals, whole)
    report = replace(
        plain,
        verdict=verdict,
        reason=reason + _departed(searches) if confident else reason,
        gap=_figures(examined, held_out, bool(confident)),
        gap_closed=share if confident else None,
        gap_closed_interval=interval if confident else None,
        gap_closed_in_sample=in_sample if confident else None,
        where=() if verdict == NO_GAP else plain.where,
        causes=tuple(confident),
        candidates=tuple(candidates),
        confusable=tuple(confusable),
    )
    report = replace(report, next_experiment=_next(report, searches, models, examined, settings))
    if not confident:
        return Diagnosis(report, models, searches)
    in_motion = (InMotion(name, examined.measured, settings) for name in models)
    profiles = [profile for each in in_motion for profile in each.seen(models)]
    plant = _plant(settings, models)
    return Diagnosis(report, models, searches, held_out.explained(), plant, tuple(profiles))


def _next(
    report: GapReport,
    searches: Mapping[str, AxisSearch],
    models: Mapping[str, AxisModel],
    examined: Examination,
    settings: StageSettings,
) -> NextExperiment | None:
    """Moves that would tell apart what these recordings leave open; None where nothing is."""

    def between(why: str, axis: str, one: AxisModel, other: AxisModel) -> NextExperiment | None:
        return next_experiment(
            why, {**models, axis: one}, {**models, axis: other}, axis, examined.measured, settings
        )

    for alike in report.confusable:
        found = searches[alike.axis]
        effect, kin = alike.effects[:2]
        swapped = {*found.best.model.names(), kin} - {effect}
        for rival in found.rivals:
            if set(rival.model.names()) == swapped:
                why = f"{effect} and {kin} on {alike.axis} fit nearly as well"
                return between(why, alike.axis, found.best.model, rival.model)
    if report.verdict == UNEXPLAINED:
        axis = max(searches, key=lambda name: searches[name].open_gap)
        nearest = [rival.model for rival in sets_of(searches[axis].rivals, 1)[:2]]
        if len(nearest) == 2:
            names = " nor ".join(model.names()[0] for model in nearest)
            return between(f"neither {names} explains {axis}", axis, *nearest)
    for cause in report.causes:
        model = models[cause.axis]
        index = model.names().index(cause.effect)
        for key, poor in cause.parameters.items():
            if poor.sigma > _POOR * abs(poor.value) and model.terms[index].is_size_or_shape(key):
                why = f"{key} of {cause.effect} on {cause.axis} is known to {poor.sigma:.2g} only"
                within = coordinate(
                    model.terms[index].effect, key, searches[cause.axis].problem.axis
                )
                farther = within.clipped(poor.value + _DOUBT * poor.sigma)
                other = model.with_value(index, key, farther)
                return between(why, cause.axis, model, other)
    return None


def _plant(settings: StageSettings, models: Mapping[str, AxisModel]) -> dict[str, dict[str, float]]:
    """Plant figures of the fitted models, axis -> figure -> value."""
    out = {}
    for axis in settings.axes:
        moved = with_base(axis, models[axis.name].base)
        out[axis.name] = {
            name: float(moved.mass if name == "mass" else getattr(moved.friction, name))
            for name in BASE
        }
    return out


def _departed(searches: Mapping[str, AxisSearch]) -> str:
    """Which effects have another shape than the library's, for the reason."""
    names = [
        f"{effect} on {axis}"
        for axis, found in searches.items()
        for effect, repeat in found.repeats.items()
        if repeat.departs
    ]
    return f"; {' and '.join(names)} in another shape than the library's" if names else ""


def _figures(
    examined: Examination, held_out: HeldOut, explained: bool
) -> Mapping[str, Mapping[str, GapFigures]]:
    gap = examined.gap or {}
    if not explained:
        return gap
    out: dict[str, dict[str, GapFigures]] = {}
    for axis, signals in gap.items():
        out[axis] = {}
        for signal, figures in signals.items():
            energy = count = 0.0
            for m, left in zip(held_out.measured, held_out.after, strict=True):
                valid = m.replay.valid(axis)
                energy += float(np.square(left[axis][signal][valid]).sum())
                count += float(valid.sum())
            out[axis][signal] = replace(figures, explained=math.sqrt(energy / count))
    return out


def _reason(
    verdict: str, causes: Sequence[Cause], share: float | None, gap: float, whole: bool
) -> str:
    size = f"the combined gap is {math.sqrt(gap):.3g} times the floor"
    if verdict == NO_GAP:
        return f"{size}: no more than the machine file's tolerance and repeatability give"
    if verdict == UNEXPLAINED:
        return f"{size}, and no effect of the library explains it"
    named = ", ".join(f"{cause.effect} on {cause.axis}" for cause in causes)
    closed = "" if share is None else f" closes {100 * share:.0f} % of it on held-out moves"
    rest = "" if whole else "; what is left still has structure"
    return f"{size}; {named}{closed}{rest}"
