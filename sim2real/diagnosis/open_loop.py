"""A diagnosis without the controller: the force that the measured motion takes, and why.

For recordings without a demand, machines whose gains nobody knows, and those whose controller is
not that of the machine file. Names and figures come from the search of the free loop, run along the
measured motion (`sim2real.open_loop`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from hil_sim.effects.effect import Effect
from sim2real.axis_units import unit_on
from sim2real.diagnosis.examination import (
    OTHER_CONTROLLER,
    Examination,
    Progress,
    report_without_causes,
)
from sim2real.diagnosis.open_loop_reason import give_reason
from sim2real.diagnosis.plant_figures import FittedFigures, settle_figures
from sim2real.diagnosis.verdict import Diagnosis, describe_far_off, moved_figures
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
    FittedFigure,
    GapFigures,
    GapReport,
    Parameter,
    SelectionStep,
)
from sim2real.fitting import (
    BASE,
    STEP,
    AxisModel,
    Workers,
    compose_stage,
    coordinates,
    implausibility,
    plant_figure,
    reported_values,
    with_base,
)
from sim2real.free_loop import FreeSearch, search_free
from sim2real.gap import NO_GAP_BELOW, Signals
from sim2real.open_loop import (
    FIGURES,
    MotionLoop,
    compare_along,
    describe_residual,
    measure_motion,
)
from sim2real.scoring.constants import DOUBTED, ENOUGH, SHOWN, STRANGE
from sim2real.shrinkage import share_closed, share_given_back

F64 = NDArray[np.float64]

_UNKNOWN = 0.19
"""Relative standard deviation of a figure that the machine file leaves unknown, around the value
that least squares find."""
_MASS = 0.01
"""Smallest tolerance of the mass. A drive reports the force at one instant, and the force varies
within a SYNC period: on the reference stage by 2.4 % of mass times acceleration."""
_SAME_AS = {
    "mass": ("payload_mass", "force_constant"),
    "coulomb": ("coulomb_level",),
    "viscous": ("viscous_damping",),
    "stiffness": ("presliding_stiffness",),
}
"""Figure -> effects that only change it: they are not searched for where the figure is unknown."""
_BEHIND = ("dead_time", "current_bandwidth")
"""Effects that lie between controller and reported force: they do not show along a motion."""


@dataclass(frozen=True, slots=True, eq=False)
class _Axis:
    """The search on one axis, and energies of its moves, float64[moves]."""

    name: str
    loop: MotionLoop
    found: FreeSearch
    before: F64
    after: F64
    samples: F64


def diagnose_open_loop(
    examined: Examination,
    tolerance: Mapping[str, float],
    library: Mapping[str, Effect],
    *,
    jobs: int = 2,
    progress: Progress = lambda *_: None,
) -> Diagnosis:
    """Diagnose examined recordings along their motion; arguments as `diagnosis.diagnose`."""
    names = list(examined.gap or {})
    axes = []
    with Workers(jobs) as workers:
        for number, name in enumerate(names):
            progress("effects", 100 * number, 100 * len(names))
            unknown = examined.unknown.get(name, ())
            loop = MotionLoop(
                name, examined.motions, examined.settings, tolerance.get(name, 0.0), workers
            )
            _widen(loop, unknown)
            own = {n: e for n, e in library.items() if e.searched and n not in _left_out(unknown)}
            advance = partial(_advance, progress, number, len(names))
            axes.append(_searched(name, loop, search_free(loop, own, advance)))
        progress("effects", 100 * len(names), 100 * len(names))
        return _conclude(examined, axes)


def _advance(progress: Progress, number: int, count: int, share: float) -> None:
    progress("effects", round(100 * (number + share)), 100 * count)


def _widen(loop: MotionLoop, unknown: Sequence[str]) -> None:
    """Let base parameters vary as far as the open loop and the machine file leave them open."""
    for at, figure in enumerate(BASE):
        least = _UNKNOWN if figure in unknown else _MASS if figure == "mass" else 1e-4
        loop.spread[at] = max(float(loop.spread[at]), least)


def _left_out(unknown: Sequence[str]) -> set[str]:
    return {*_BEHIND, *(effect for figure in unknown for effect in _SAME_AS.get(figure, ()))}


def _searched(name: str, loop: MotionLoop, found: FreeSearch) -> _Axis:
    # `MotionLoop` counts the force twice, in place of the position: half of that energy is real.
    before = loop.energies(loop.residual(loop.start)) / 2.0
    each = np.array([loop.energies(fold.residual) for fold in found.folds]) / 2.0
    after = each[loop.fold, np.arange(len(loop.fold))]
    return _Axis(name, loop, found, before, np.asarray(after), loop.samples)


def _conclude(examined: Examination, axes: Sequence[_Axis]) -> Diagnosis:
    """The report of all axes."""
    report = report_without_causes(examined)
    causes: list[Cause] = []
    alike: list[Confusable] = []
    candidates: list[Candidate] = []
    for axis in axes:
        own, others = _causes(axis)
        causes += own if axis.found.names_causes() else []
        alike += others if axis.found.names_causes() else []
        candidates += _candidates(axis)
    causes = sorted(
        (c for c in causes if c.probability > 0.5), key=lambda c: -(c.gap_closed or 0.0)
    )
    samples = np.column_stack([a.samples for a in axes])
    before = np.column_stack([a.before for a in axes])
    after = np.column_stack([a.after for a in axes])
    share, interval = share_closed(before, after, samples)
    left = float((after.sum(axis=0) / samples.sum(axis=0)).max())
    opened = float((before.sum(axis=0) / samples.sum(axis=0)).max())
    far_off = describe_far_off(examined)
    if causes:
        whole = all(a.found.is_near_floor() for a in axes)
        enough = whole and share is not None and share >= ENOUGH
        verdict = EXPLAINED if enough else PARTLY_EXPLAINED
    else:
        steps = any(a.found.steps for a in axes)
        small = opened < NO_GAP_BELOW or (left < NO_GAP_BELOW and not steps)
        verdict = NO_GAP if small and not far_off else UNEXPLAINED
        if verdict == NO_GAP and examined.open_loop == OTHER_CONTROLLER:
            verdict = INSUFFICIENT  # the plant agrees, but the controller does not
    models = {a.name: a.found.best.model for a in axes}
    changes: dict[str, tuple[FigureChange, ...]] = {}
    if causes:
        for a in axes:
            models[a.name], changes[a.name] = settle_figures(
                _figures_along(a), examined.unknown.get(a.name, ())
            )
    report = replace(
        report,
        verdict=verdict,
        reason=give_reason(verdict, causes, {a.name: a.found for a in axes}, share, examined),
        where=() if verdict == NO_GAP else report.where,
        candidates=tuple(candidates),
        confusable=tuple(alike),
        steps=_steps(axes),
        fitted=_fitted(examined, axes, models),
    )
    if verdict in (UNEXPLAINED, PARTLY_EXPLAINED):
        report = with_description(report, examined, models, causes)
    if not causes:
        return Diagnosis(report, models, {})
    report = replace(
        report,
        causes=tuple(causes),
        figures=tuple(change for own in changes.values() for change in own),
        gap_closed=share,
        gap_closed_interval=interval,
        gap=_explained_gap(examined, axes),
    )
    return Diagnosis(
        report,
        models,
        {},
        _explained(examined, axes),
        moved_figures(examined.settings, models),
        steps={a.name: tuple(step.model for step in a.found.steps) for a in axes},
    )


def with_description(
    report: GapReport,
    examined: Examination,
    models: Mapping[str, AxisModel],
    causes: Sequence[Cause],
) -> GapReport:
    """The report with a description of what is left of the forces, where one can be had.

    Args:
        report: so far.
        examined: the recordings.
        models: as fitted.
        causes: that are named. What is described is what a twin with these effects leaves; on an
            axis without causes, what the machine file leaves.
    """
    named = {(cause.axis, cause.effect) for cause in causes}
    beside = {
        name: replace(model, terms=tuple(t for t in model.terms if (name, t.name) in named))
        for name, model in models.items()
        if any(axis == name for axis, _ in named)
    }
    settings = compose_stage(examined.settings, beside)
    motions = examined.motions or tuple(
        measure_motion(m.replay.recording, settings) for m in examined.measured
    )
    measured = [compare_along(motion, settings) for motion in motions]
    found = (describe_residual(name, motions, measured, settings) for name in examined.gap or {})
    return replace(report, empirical=tuple(f for f in found if f is not None))


def _causes(axis: _Axis) -> tuple[list[Cause], list[Confusable]]:
    """The effects found on an axis as causes, and what could take their place."""
    loop, found = axis.loop, axis.found
    spread = np.sqrt(np.maximum(np.diag(found.covariance()), 0.0))
    causes, alike = [], []
    at = STEP
    for term in found.best.model.terms:
        entries = coordinates(term.effect, loop.axis)
        values = reported_values(term)
        figures = {
            e.parameter.key: Parameter(
                values[e.parameter.key],
                abs(e.slope(values[e.parameter.key])) * float(sigma),
                unit_on(loop.axis, e.parameter.unit),
            )
            for e, sigma in zip(entries, spread[at : at + len(entries)], strict=True)
        }
        at += len(entries)
        probability, others = found.probability(term.name)
        doubtful = implausibility(term, loop.axis) > STRANGE
        for entry in entries:
            neutral = entry.parameter.neutral_on(loop.axis)
            if entry.parameter.role == "size" and neutral is not None and math.isfinite(neutral):
                figure = figures[entry.parameter.key]
                doubtful |= figure.sigma > abs(figure.value - neutral)
        without = [_without(fold.model, term.name) for fold in found.folds]
        each = np.array([loop.energies(loop.residual(model)) for model in without]) / 2.0
        opened = each[loop.fold, np.arange(len(loop.fold))]
        gives_back, interval = share_given_back(
            axis.before[:, None], opened[:, None], axis.after[:, None], axis.samples[:, None]
        )
        causes.append(
            Cause(
                axis.name,
                term.name,
                min(probability, DOUBTED) if doubtful else probability,
                figures,
                gives_back,
                interval,
                term.effect.remedy,
            )
        )
        if others:
            why = "along this motion one fits nearly as well as the other"
            alike.append(Confusable(axis.name, (term.name, *others), why))
    return causes, alike


def _without(model: AxisModel, name: str) -> AxisModel:
    names = model.names()
    return model.without(names.index(name)) if name in names else model


def _candidates(axis: _Axis) -> list[Candidate]:
    """The effects found, the most probable first, with what each closes alone where known."""
    shares = {s.effects[0]: s.closed for s in axis.found.steps if len(s.effects) == 1}
    names = {n for key in axis.found.scores for n in key}
    listed = [
        Candidate(axis.name, name, axis.found.probability(name)[0], shares.get(name))
        for name in sorted(names)
        if name in axis.found.best.model.names()
    ]
    return sorted(listed, key=lambda c: -c.probability)[:SHOWN]


def _steps(axes: Sequence[_Axis]) -> tuple[SelectionStep, ...]:
    return tuple(
        SelectionStep(a.name, s.added, s.effects, s.closed, s.uncertainty)
        for a in axes
        for s in a.found.steps
    )


def _figures_along(axis: _Axis) -> FittedFigures:
    loop, found = axis.loop, axis.found
    return FittedFigures(loop.axis, found.best.model, found.covariance(), loop.spread[:STEP].copy())


def _fitted(
    examined: Examination, axes: Sequence[_Axis], models: Mapping[str, AxisModel]
) -> tuple[FittedFigure, ...]:
    """What the machine file leaves unknown, as the final model has it."""
    found = []
    for a in axes:
        spread = np.sqrt(np.maximum(np.diag(a.found.covariance()), 0.0))
        moved = with_base(a.loop.axis, models[a.name].base)
        for figure in examined.unknown.get(a.name, ()):
            if figure not in FIGURES:
                continue
            at = BASE.index(figure)
            value = plant_figure(moved, figure)
            relative = spread[at] * a.loop.spread[at] / (1.0 + models[a.name].base[at])
            sigma = float(relative * value)
            unit = unit_on(a.loop.axis, FIGURES[figure])
            found.append(FittedFigure(a.name, figure, value, sigma, unit))
    return tuple(found)


def _explained_gap(
    examined: Examination, axes: Sequence[_Axis]
) -> Mapping[str, Mapping[str, GapFigures]]:
    """The gap's figures with what the causes leave on held-out moves."""
    out: dict[str, dict[str, GapFigures]] = {}
    for a in axes:
        figures = (examined.gap or {})[a.name]["force"]
        left = math.sqrt(float(a.after.sum() / a.samples.sum())) * figures.floor
        out[a.name] = {"force": replace(figures, explained=left)}
    return out


def _explained(examined: Examination, axes: Sequence[_Axis]) -> tuple[Signals, ...]:
    """Signals of the final models, one entry per recording."""
    found: list[Signals] = []
    for number, measured in enumerate(examined.measured):
        signals = {name: dict(own) for name, own in measured.floor.nominal.items()}
        for a in axes:
            own = a.found.best.model.settings(a.loop.axis)
            signals[a.name]["force"] = a.loop.force_of(number, own)
        found.append(signals)
    return tuple(found)
