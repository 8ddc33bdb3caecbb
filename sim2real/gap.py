"""The gap of a stage model against a recording, and the floor under it; nothing is fitted.

Gap: the recording's demands and offsets run through the closed-loop simulation of the model, free
of noise (roundings stay); rms over valid samples of recorded minus simulated. Floor: the same of a
noisy draw of the model against its noise-free run, mean over a few draws: no model comes closer.
Definitions: docs/formats/gap-report.md.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil_sim.settings import StageSettings
from hil_sim.simulate import Response, simulate
from sim2real.recording import BoolArray, FloatArray, Recording

FLOOR_DRAWS = 4
SIGNALS = {"position": "m", "force": "N"}
_REST_UNITS = 4
"""A force at the first sample beyond so many force units is taken as the friction's state there."""


@dataclass(frozen=True, slots=True)
class SignalGap:
    """Gap of one signal of one axis.

    Attributes:
        nominal: of the model against the recording.
        floor: what a perfect model would still show.
        unit: of both.
    """

    nominal: float
    floor: float
    unit: str


_MAX_STRETCH = 10
"""Periods passed over for each sample, at most: beyond that it is no recording of one run."""

Gap = dict[str, dict[str, SignalGap]]
"""Axis -> signal ("position", "force") -> gap."""


def measure(
    recording: Recording,
    settings: StageSettings,
    draws: int = FLOOR_DRAWS,
    progress: Callable[[int, int], object] | None = None,
) -> Gap:
    """The gap of a model against a recording.

    The model starts at rest at the first target. A recording that starts with force in the motor
    (after homing) starts the model with that force in its friction elements and its integrator.

    Args:
        recording: of a stage.
        settings: of the model; its axes must be those of the recording.
        draws: noisy draws for the floor.
        progress: called with (simulations done, all).

    Raises:
        ValueError: axes or SYNC periods that differ, or a recording without a valid sample.
    """
    names = [axis.name for axis in settings.axes]
    if set(names) != set(recording.axes):
        raise ValueError(
            f"the model has axes {', '.join(names)}, the recording {', '.join(recording.axes)}"
        )
    signals = [recording.axes[name] for name in names]
    for name, axis in zip(names, signals, strict=True):
        if not axis.valid.any():
            raise ValueError(f"axis {name}: no valid sample")
    place = _places(recording.time, settings.sync_period)
    # Where whole periods were passed over, the drives held the setpoint they had.
    sent = np.searchsorted(place, np.arange(place[-1] + 1), side="right") - 1
    demand = np.column_stack([s.position_demand for s in signals])[sent]
    offset = np.column_stack([s.force_offset for s in signals])[sent]
    rest = [
        float(s.force_actual[0])
        if abs(s.force_actual[0]) > _REST_UNITS * axis.control.rated_force / 1000.0
        else 0.0
        for s, axis in zip(signals, settings.axes, strict=True)
    ]

    def run(index: int, seed: int | None) -> Response:
        response = simulate(settings, demand, offset, seed, rest_force=rest)
        if progress is not None:
            progress(index, draws + 1)
        return response

    nominal = run(1, None)
    noisy = [run(2 + i, 1 + i) for i in range(draws)]
    gap: Gap = {}
    for a, (name, axis) in enumerate(zip(names, signals, strict=True)):
        actual = {"position": axis.position_actual, "force": axis.force_actual}
        gap[name] = {}
        for signal, unit in SIGNALS.items():
            model: FloatArray = getattr(nominal, signal)[place, a]
            floors = [_rms(getattr(draw, signal)[place, a] - model, axis.valid) for draw in noisy]
            gap[name][signal] = SignalGap(
                _rms(actual[signal] - model, axis.valid), float(np.mean(floors)), unit
            )
    return gap


def _places(time: FloatArray, period: float) -> NDArray[np.int64]:
    """Number of the SYNC period each sample belongs to, from 0, strictly increasing.

    Args:
        time: of the samples [s].
        period: of the model's SYNC [s].

    Raises:
        ValueError: the samples are not a period apart.
    """
    steps = np.arange(len(time))
    if len(time) < 2:
        return steps
    usual = float(np.median(np.diff(time)))
    if abs(usual - period) > 0.1 * period:
        raise ValueError(
            f"its samples are {usual:.6g} s apart, the model's sync_period is {period:g} s"
        )
    places = np.rint((time - time[0]) / period).astype(np.int64)
    if places[-1] > _MAX_STRETCH * len(time):
        raise ValueError(f"its samples are spread over {places[-1] * period:.6g} s")
    # Host times that jitter by half a period and more: one after the other all the same.
    increasing: NDArray[np.int64] = np.maximum.accumulate(places - steps) + steps
    return increasing


def _rms(difference: FloatArray, valid: BoolArray) -> float:
    return float(np.sqrt(np.mean(np.square(difference[valid]))))
