"""The free closed-loop gap of one axis under a model: what people see of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from hil_sim.settings import StageSettings
from sim2real.axis_model import AxisModel, composed
from sim2real.gap import Measured
from sim2real.recording import BoolArray
from sim2real.replay import residual, rms

_MOVING = 0.02
"""Demanded velocity from which friction has the sign of the velocity [m/s]."""
_FEWEST = 200
"""Samples in motion that a profile needs."""
_PITCH = 4e-3
"""Of the nodes of a friction profile [m]."""
SIGNALS = 2.0
"""Squared gap over floor of an axis that is explained: one for each signal."""


def axis_gap(
    name: str,
    models: Mapping[str, AxisModel],
    measured: Sequence[Measured],
    settings: StageSettings,
    masks: Sequence[BoolArray] | None = None,
) -> float:
    """Squared gap over floor of one axis, summed over its signals, mean over recordings.

    Args:
        name: of the axis.
        models: axis -> its model; axes that are not in it are as the machine file says.
        measured: recordings, with their floors.
        settings: of the machine file.
        masks: samples that count, of those that are valid, per recording; all by default.
    """
    stage = composed(settings, models)
    total = samples = 0.0
    for number, m in enumerate(measured):
        left = residual(m.replay.measured(), m.replay.run(stage))[name]
        valid = m.replay.valid(name)
        if masks is not None:
            valid = valid & masks[number]
        count = float(valid.sum())
        total += count * sum(
            (rms(values, valid) / max(m.floor.rms[name][signal], 1e-12)) ** 2
            for signal, values in left.items()
        )
        samples += count
    return total / samples


def friction_profile(
    name: str,
    models: Mapping[str, AxisModel],
    measured: Sequence[Measured],
    settings: StageSettings,
) -> float:
    """Share of the force that a model leaves in motion that any friction profile would take up.

    A profile over position, linear between nodes: what it leaves in the force has the sign of the
    velocity, other than what any force over position does.

    Args:
        name: of the axis.
        models: axis -> its model.
        measured: recordings.
        settings: of the machine file.

    Returns:
        0 (none of it) to 1 (all of it), by least squares.
    """
    stage = composed(settings, models)
    where, sign, force = [], [], []
    for m in measured:
        left = residual(m.replay.measured(), m.replay.run(stage))[name]["force"]
        signals = m.replay.recording.axes[name]
        velocity = np.gradient(signals.position_demand, m.replay.recording.time)
        moving = m.replay.valid(name) & (np.abs(velocity) > _MOVING)
        where.append(signals.position_actual[moving])
        sign.append(np.sign(velocity[moving]))
        force.append(left[moving])
    x, s, f = (np.concatenate(parts) for parts in (where, sign, force))
    if len(f) < _FEWEST:
        return 0.0
    low, high = float(x.min()), float(x.max())
    nodes = np.linspace(low, high, max(2, round((high - low) / _PITCH) + 1))
    place = np.clip((x - low) / (nodes[1] - nodes[0]), 0.0, len(nodes) - 1.001)
    index = place.astype(np.int64)
    columns = np.zeros((len(f), len(nodes)))
    rows = np.arange(len(f))
    columns[rows, index] = s * (1.0 - (place - index))
    columns[rows, index + 1] = s * (place - index)
    taken = columns @ np.linalg.lstsq(columns, f, rcond=1e-6)[0]
    return float(1.0 - np.sum(np.square(f - taken)) / max(float(f @ f), 1e-300))
