"""The conclusions of a diagnosis: verdict, reason, causes, figures, next experiment."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

from hil_sim.settings import StageSettings
from sim2real.attribution import (
    AxisResult,
    AxisSearch,
    find_causes,
    list_candidates,
    of_size,
)
from sim2real.diagnosis.along_motion import fitted_figures
from sim2real.diagnosis.examination import OTHER_CONTROLLER, Examination, report_without_causes
from sim2real.diagnosis.plant_figures import settle_figures
from sim2real.diagnosis.promises import (
    are_alike,
    describe_rest,
    have_one_speed,
    less_certain,
    only_causes,
    promise,
    share_promised,
    widened,
    with_force,
)
from sim2real.diagnosis.reason import describe_far_off, give_reason
from sim2real.experiment import propose_experiment
from sim2real.findings import (
    EXPLAINED,
    INSUFFICIENT,
    NO_GAP,
    PARTLY_EXPLAINED,
    UNEXPLAINED,
    Candidate,
    Cause,
    Confusable,
    FigureChange,
    GapReport,
    NextExperiment,
    SelectionStep,
    Unlisted,
)
from sim2real.fitting import (
    BASE,
    AxisModel,
    coordinate,
    plant_figure,
    with_base,
)
from sim2real.gap import NO_GAP_BELOW, Signals
from sim2real.held_out import HeldOut, combined_energy, share_closed
from sim2real.scoring.constants import DOUBTED, ENOUGH, NEAR

_SMALLER = 2.0
"""Largest squared gap over floor per signal that counts as no gap where no cause was found and an
axis is not complete; with all axes complete it is `NEAR`."""
_ALIKE = "; all moves are alike, so that less is known of others"
_ONE_SPEED = "; all strokes of {} reach the same speed, so that less is known of other speeds"
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
        steps: axis -> the model of each of its steps in the report.
    """

    report: GapReport
    models: Mapping[str, AxisModel]
    searches: Mapping[str, AxisSearch]
    explained: tuple[Signals, ...] = ()
    plant: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    steps: Mapping[str, Sequence[AxisModel]] = field(default_factory=dict)

    def named(self) -> dict[str, AxisModel]:
        """Axis -> its model with the causes alone; empty without causes."""
        return only_causes(self.models, self.report.causes) if self.report.causes else {}

    def twin(self) -> dict[str, AxisModel]:
        """Axis -> its model as a twin has it: causes, and what no effect explains as described."""
        models = self.named()
        for force in self.report.empirical:
            models = with_force(models, force)
        return models


def conclude(
    examined: Examination,
    results: Mapping[str, AxisResult],
    held_out: HeldOut,
    curves: Callable[[str], Sequence[Unlisted]] = lambda _: (),
) -> Diagnosis:
    """Draw the conclusions of all searches.

    Args:
        examined: the recordings.
        results: axis -> what its search found.
        held_out: what models leave on held-out moves.
        curves: the coordinates of an axis; asked for where all its effects are doubted.
    """
    considered, candidates, confusable = _gather(examined, results, held_out)
    causes = [cause for cause in considered if cause.probability > 0.5]
    named = {(cause.axis, cause.effect) for cause in causes}
    is_whole_model = all(
        (axis, name) in named
        for axis, result in results.items()
        for name in result.best.model.names()
    )
    whole = is_whole_model and all(result.is_complete for result in results.values())
    models, changes = _twin_models(examined, results, causes)
    doubted = {cause.axis for cause in considered} - {cause.axis for cause in causes}
    results = {
        name: replace(result, unlisted=result.unlisted or curves(name))
        if name in doubted
        else result
        for name, result in results.items()
    }
    alike = are_alike(examined)
    unlisted = tuple(map(less_certain, _unlisted(results))) if alike else _unlisted(results)
    promised = promise(held_out, models, causes)
    share, interval = share_promised(held_out, promised.named)
    verdict = _verdict(examined, results, held_out, (considered, causes), share, whole)
    if verdict in (UNEXPLAINED, PARTLY_EXPLAINED):
        promised = describe_rest(promised, examined, held_out, unlisted)
    answered = {cause.axis for cause in causes} | {each.axis for each in unlisted}
    answered |= {force.axis for force in promised.forces}
    limits = _ALIKE if alike and answered else _say_one_speed(examined, answered)
    plain = report_without_causes(examined)
    report = replace(
        plain,
        verdict=verdict,
        reason=give_reason(verdict, causes, results, share, examined, whole=whole) + limits,
        where=() if verdict == NO_GAP else plain.where,
        candidates=tuple(candidates),
        unlisted=unlisted,
        confusable=tuple(confusable),
        steps=_steps(results) if causes or examined.open_loop is not None else (),
    )
    if causes or promised.forces:
        by_twin, of_twin = share_promised(held_out, promised.twin)
        report = replace(
            report,
            empirical=promised.forces,
            gap_closed_by_twin=by_twin,
            gap_closed_by_twin_interval=widened(of_twin) if limits else of_twin,
        )
    if causes:
        in_sample = None
        if held_out.fitted is not None and is_whole_model:
            in_sample, _ = share_closed(held_out.before, held_out.fitted, held_out.samples)
        report = replace(
            report,
            causes=tuple(causes),
            gap={
                axis: {
                    s: replace(f, explained=promised.named.rms[axis][s]) for s, f in signals.items()
                }
                for axis, signals in (examined.gap or {}).items()
            },
            gap_closed=share,
            gap_closed_interval=widened(interval) if limits else interval,
            gap_closed_in_sample=in_sample,
            figures=changes,
        )
    if examined.open_loop is None:
        report = replace(report, next_experiment=_next(report, results, examined))
    report = replace(report, fitted=fitted_figures(examined, results, models))
    steps = {
        name: tuple(step.model for step in result.free.steps)
        for name, result in results.items()
        if result.free is not None
    }
    diagnosis = Diagnosis(report, models, _searches(results), steps=steps)
    return _with_twin(diagnosis, examined, held_out) if causes else diagnosis


def _say_one_speed(examined: Examination, axes: Collection[str]) -> str:
    """What to say of axes with an answer whose strokes all have one speed."""
    slow = [axis for axis in sorted(axes) if have_one_speed(examined, axis)]
    return _ONE_SPEED.format(" and ".join(slow)) if slow else ""


def _twin_models(
    examined: Examination, results: Mapping[str, AxisResult], causes: Sequence[Cause]
) -> tuple[dict[str, AxisModel], tuple[FigureChange, ...]]:
    """All models, where causes are named with the figures of a twin, and what these change."""
    if not causes:
        return {name: result.best.model for name, result in results.items()}, ()
    settled = {
        name: settle_figures(result, examined.unknown.get(name, ()))
        for name, result in results.items()
    }
    changes = tuple(change for _, changed in settled.values() for change in changed)
    return {name: model for name, (model, _) in settled.items()}, changes


def _unlisted(results: Mapping[str, AxisResult]) -> tuple[Unlisted, ...]:
    """Coordinates of all axes, most probable first."""
    found = [each for result in results.values() for each in result.unlisted]
    return tuple(sorted(found, key=lambda each: -each.probability))


def _searches(results: Mapping[str, AxisResult]) -> dict[str, AxisSearch]:
    return {name: result for name, result in results.items() if isinstance(result, AxisSearch)}


def _with_twin(diagnosis: Diagnosis, examined: Examination, held_out: HeldOut) -> Diagnosis:
    """A diagnosis that names causes, with what shows its effects."""
    return replace(
        diagnosis,
        explained=held_out.explained,
        plant=moved_figures(examined.settings, diagnosis.models),
    )


def _gather(
    examined: Examination, results: Mapping[str, AxisResult], held_out: HeldOut
) -> tuple[list[Cause], list[Candidate], list[Confusable]]:
    """Causes, largest share of the gap first, candidates and confusable effects of all axes."""
    above_floor = combined_energy(held_out.before, held_out.samples) - held_out.before.shape[1]
    causes, candidates, confusable = [], [], []
    for result in results.values():
        causes_here: list[Cause] = []
        if result.free is None or result.free.names_causes():
            causes_here, alike = find_causes(
                result, held_out, along_motion=examined.open_loop is not None
            )
            causes_here = doubt_rest(causes_here, held_out)
            causes += causes_here
            confusable += alike
        candidates += list_candidates(result, causes_here, above_floor)
    causes.sort(key=lambda cause: -(cause.gap_closed or 0.0))
    return causes, candidates, confusable


def doubt_rest(causes: list[Cause], held_out: HeldOut) -> list[Cause]:
    """Causes on one axis, all doubted where the others close nothing without the doubted ones."""
    named = [cause for cause in causes if cause.probability > 0.5]
    if len(named) in (0, len(causes)):
        return causes
    left = held_out.leaves([only_causes(models, named) for models in held_out.folds])
    own = held_out.columns[named[0].axis]
    parts = (held_out.before, left.energies, held_out.samples)
    _, interval = share_closed(*(part[:, own] for part in parts))
    if interval is not None and interval[0] > 0.0:
        return causes
    return [replace(each, probability=min(each.probability, DOUBTED)) for each in causes]


def _verdict(
    examined: Examination,
    results: Mapping[str, AxisResult],
    held_out: HeldOut,
    causes: tuple[Sequence[Cause], Sequence[Cause]],
    share: float | None,
    whole: bool,
) -> str:
    """The verdict.

    Args:
        examined: the recordings.
        results: axis -> what its search found.
        held_out: what models leave on held-out moves.
        causes: all, and those that are named.
        share: of the gap that these close.
        whole: whether all axes are complete.
    """
    considered, named = causes
    if named:
        enough = whole and share is not None and share >= ENOUGH
        return EXPLAINED if enough else PARTLY_EXPLAINED
    samples = held_out.samples.sum(axis=0)
    opened, remaining = (
        energies.sum(axis=0) / samples for energies in (held_out.before, held_out.after.energies)
    )
    if examined.open_loop is not None:
        steps = any(result.free is not None and result.free.steps for result in results.values())
        small = opened.max() < NO_GAP_BELOW or (remaining.max() < NO_GAP_BELOW and not steps)
    else:
        # The better of file and fit counts: figures fitted to a coarse log may be worse than the
        # file's. With improbable causes the file's gap counts, whatever they close.
        least = float(opened.mean() if considered else min(opened.mean(), remaining.mean()))
        near = not considered and least < (NEAR if whole else _SMALLER)
        small = near or least < NO_GAP_BELOW
    if not small or describe_far_off(examined) or _unlisted(results):
        return UNEXPLAINED
    # Where the plant agrees, and the controller does not, there is a gap.
    return INSUFFICIENT if examined.open_loop == OTHER_CONTROLLER else NO_GAP


def _steps(results: Mapping[str, AxisResult]) -> tuple[SelectionStep, ...]:
    """Steps of the axes where the free loop found the effects."""
    return tuple(
        SelectionStep(axis, step.added, step.effects, step.closed, step.uncertainty)
        for axis, result in results.items()
        if result.free is not None and result.best.model.terms and not result.free.of_rest
        for step in result.free.steps
    )


def _next(
    report: GapReport,
    searches: Mapping[str, AxisResult],
    examined: Examination,
) -> NextExperiment | None:
    """Moves that would decide what these recordings leave open; None where nothing is open."""
    models = {name: result.best.model for name, result in searches.items()}

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
        result = searches[alike.axis]
        effect, substitute = alike.effects[:2]
        swapped = {*result.best.model.names(), substitute} - {effect}
        for alternative in result.alternatives:
            if set(alternative.model.names()) == swapped:
                why = f"{effect} and {substitute} on {alike.axis} fit nearly as well"
                return between(why, alike.axis, result.best.model, alternative.model)
    if report.verdict == UNEXPLAINED and not report.unlisted:
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
                within = coordinate(model.terms[index].effect, key, searches[cause.axis].axis)
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
