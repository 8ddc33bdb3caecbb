"""Validates a diagnosis on recordings that took no part in it.

The effects found are simulated there with the figures that they have; nothing is fitted again.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from sim2real.diagnosis.examination import Examination
from sim2real.diagnosis.verdict import Diagnosis
from sim2real.fitting import AxisModel
from sim2real.gap import NO_GAP_BELOW
from sim2real.report import GapReport
from sim2real.shrinkage import FLOOR_LEVEL, axis_gap


def judge_elsewhere(diagnosis: Diagnosis, others: Examination) -> GapReport:
    """The report with what all causes, and each step of the selection, close on other recordings.

    Args:
        diagnosis: with causes; without any its report is returned as it is.
        others: recordings of the same stage that it knows nothing of, with their gaps.
    """
    report = diagnosis.report
    if not report.causes or not others.measured:
        return report
    names = [axis.name for axis in others.settings.axes]

    def opened(models: Mapping[str, AxisModel], axis: str) -> float:
        return axis_gap(axis, models, others.measured, others.settings)

    before = {name: opened({}, name) for name in names}
    models = diagnosis.models
    after = {name: opened(models, name) for name in names}
    steps = []
    numbers = dict.fromkeys(names, 0)
    for step in report.steps:
        free = diagnosis.searches[step.axis].free
        if free is not None:
            model = free.steps[numbers[step.axis]].model
            numbers[step.axis] += 1
            left = opened({**models, step.axis: model}, step.axis)
            step = replace(step, elsewhere=_closed(before[step.axis], left, 1))
        steps.append(step)
    share = _closed(sum(before.values()), sum(after.values()), len(names))
    return replace(report, steps=tuple(steps), gap_closed_elsewhere=share)


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
