"""Validates a diagnosis on recordings that took no part in it.

The effects found are simulated there, or compared along their motion where the diagnosis was, with
the figures that they have. Phases alone are fitted again where others close clearly more: those of
waves over position change when an axis is homed anew, those of vibrations with every start.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from hil_sim.settings import StageSettings
from sim2real.diagnosis.clock import Clock
from sim2real.diagnosis.examination import Examination, examine
from sim2real.diagnosis.verdict import Diagnosis
from sim2real.findings import EXPLAINED, PARTLY_EXPLAINED, GapReport
from sim2real.fitting import AxisModel
from sim2real.gap import NO_GAP_BELOW
from sim2real.held_out import FLOOR_LEVEL, axis_gap
from sim2real.open_loop import MotionLoop
from sim2real.scoring.constants import ENOUGH, VISIBLE
from stagedata import Recording


def examine_others(
    examined: Examination,
    others: Sequence[Recording],
    settings: StageSettings,
    *,
    correct: bool,
    clock: Clock,
) -> Examination:
    """Examine other recordings of the stage as those of a diagnosis were.

    Args:
        examined: recordings that are diagnosed. Figures that the machine file leaves unknown are
            those found there.
        others: at least one.
        settings: of the machine file.
        correct: continue with corrected channels.
        clock: of the others.

    Raises:
        ValueError: a recording does not fit the machine file; with the recording's name.
    """
    if examined.open_loop is not None:
        settings = examined.settings
    return examine(others, settings, correct=correct, clock=clock, open_loop=examined.open_loop)


def judge_elsewhere(diagnosis: Diagnosis, others: Examination) -> GapReport:
    """The report with what all causes, and each step of the selection, close on other recordings.

    What does not close enough of the gap there explains it partly.

    Args:
        diagnosis: judged by its causes; without any, by the twin that describes the gap. Without
            either its report is returned as it is.
        others: recordings of the same stage that it knows nothing of, with their gaps.
    """
    report = diagnosis.report
    models = diagnosis.named() or diagnosis.twin()
    if not models or not others.measured:
        return report
    names = [axis.name for axis in others.settings.axes]

    def opened(models: Mapping[str, AxisModel], axis: str) -> float:
        if others.open_loop is None:
            return axis_gap(axis, models, others.measured, others.settings)
        loop = MotionLoop(axis, others.motions, others.settings, 0.0)
        return loop.gap(loop.residual(models.get(axis, loop.start)))

    before = {name: opened({}, name) for name in names}
    phases = {name: _own_phases(models, name, opened) for name in names if name in models}
    models = {name: _with_phases(model, phases.get(name, {})) for name, model in models.items()}
    after = {name: opened(models, name) for name in names}
    steps = []
    fitted = {axis: iter(of_axis) for axis, of_axis in diagnosis.steps.items()}
    for step in report.steps:
        model = _with_phases(next(fitted[step.axis]), phases.get(step.axis, {}))
        remaining = opened({**models, step.axis: model}, step.axis)
        steps.append(replace(step, elsewhere=_closed(before[step.axis], remaining, 1)))
    share = _closed(sum(before.values()), sum(after.values()), len(names))
    verdict, reason = report.verdict, report.reason
    if share is not None:
        reason += f"; on the recordings of --check {100 * share:.0f} %"
        anew = [f"{effect} on {axis}" for axis, own in phases.items() for effect, _ in own]
        reason += f", with the phase of {' and '.join(anew)} fitted anew there" if anew else ""
        if verdict == EXPLAINED and share < ENOUGH:
            verdict = PARTLY_EXPLAINED
    return replace(
        report, verdict=verdict, reason=reason, steps=tuple(steps), gap_closed_elsewhere=share
    )


def _own_phases(
    models: Mapping[str, AxisModel],
    axis: str,
    opened: Callable[[Mapping[str, AxisModel], str], float],
) -> dict[tuple[str, str], float]:
    """(effect, key) -> phase of an axis' model that clearly closes more than the one it has.

    The squared gap is nearly a sine over a phase, so three values of it show where it is least.
    """
    found, third = {}, 2.0 * math.pi / 3.0
    waves = [
        (index, parameter.key)
        for index, term in enumerate(models[axis].terms)
        for parameter in term.effect.parameters
        if parameter.role == "phase"
    ]
    for index, key in waves:
        model = models[axis]
        term = model.terms[index]
        phase = term.mapping()[key]
        here, ahead, behind = (
            opened({**models, axis: model.with_value(index, key, phase + turn)}, axis)
            for turn in (0.0, third, -third)
        )
        phase += math.atan2(math.sqrt(3.0) * (behind - ahead), ahead + behind - 2.0 * here)
        turned = {**models, axis: model.with_value(index, key, phase)}
        if opened(turned, axis) < here - VISIBLE:
            models, found[term.name, key] = turned, phase
    return found


def _with_phases(model: AxisModel, phases: Mapping[tuple[str, str], float]) -> AxisModel:
    """The model with these phases, by effect and key, where it has such effects."""
    for (effect, key), phase in phases.items():
        if effect in model.names():
            model = model.with_value(model.names().index(effect), key, phase)
    return model


def _closed(before: float, after: float, axes: int) -> float | None:
    """Share of squared gaps over floor that is closed; None where there is hardly a gap.

    Args:
        before: by the machine file, summed over axes and signals.
        after: by the model, likewise.
        axes: how many.
    """
    floor = FLOOR_LEVEL * axes
    if before < NO_GAP_BELOW * floor:
        return None
    return min(1.0, 1.0 - (after - floor) / (before - floor))
