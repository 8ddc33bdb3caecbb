"""The free-run gap of one axis under a model: the gap that users see."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from hil_sim.settings import StageSettings
from sim2real.fitting import AxisModel, compose_stage
from sim2real.gap import Measured, rms

FLOOR_LEVEL = 2.0
"""Squared gap over floor of an axis that is explained: one for each signal."""


def axis_gap(
    name: str,
    models: Mapping[str, AxisModel],
    measured: Sequence[Measured],
    settings: StageSettings,
) -> float:
    """Squared gap over floor of one axis, summed over its signals, averaged over recordings.

    Args:
        name: of the axis.
        models: axis -> its model; axes without one are as the machine file says.
        measured: recordings, with their floors.
        settings: of the machine file.
    """
    stage = compose_stage(settings, models)
    total = samples = 0.0
    for m in measured:
        recorded, simulated = m.replay.measured()[name], m.replay.run_axis(stage, name)
        valid = m.replay.valid(name)
        count = float(valid.sum())
        total += count * sum(
            (rms(values - simulated[signal], valid) / max(m.floor.rms[name][signal], 1e-12)) ** 2
            for signal, values in recorded.items()
        )
        samples += count
    return total / samples
