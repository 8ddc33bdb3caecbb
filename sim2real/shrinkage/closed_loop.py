"""The free-run gap of one axis under a model: the gap that users see."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from hil_sim.settings import StageSettings
from sim2real.fitting import AxisModel, compose_stage
from sim2real.gap import Measured, rms
from stagedata import BoolArray

FLOOR_LEVEL = 2.0
"""Squared gap over floor of an axis that is explained: one for each signal."""


def axis_gap(
    name: str,
    models: Mapping[str, AxisModel],
    measured: Sequence[Measured],
    settings: StageSettings,
    masks: Sequence[BoolArray] | None = None,
) -> float:
    """Squared gap over floor of one axis, summed over its signals, averaged over recordings.

    Args:
        name: of the axis.
        models: axis -> its model; axes without one are as the machine file says.
        measured: recordings, with their floors.
        settings: of the machine file.
        masks: samples that count among the valid ones, per recording; None for all.
    """
    stage = compose_stage(settings, models)
    total = samples = 0.0
    for number, m in enumerate(measured):
        recorded, simulated = m.replay.measured()[name], m.replay.run_axis(stage, name)
        valid = m.replay.valid(name)
        if masks is not None:
            valid = valid & masks[number]
        count = float(valid.sum())
        total += count * sum(
            (rms(values - simulated[signal], valid) / max(m.floor.rms[name][signal], 1e-12)) ** 2
            for signal, values in recorded.items()
        )
        samples += count
    return total / samples
