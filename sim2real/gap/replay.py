"""A recording's demands run again on a stage model, and set against what was recorded.

The model starts at rest at the first target. A recording that starts with force in the motor
(after homing) starts the model with that force in its friction elements and its integrator.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hil_sim.plant.simulate import Response, needs_all_axes, simulate
from hil_sim.settings import AxisSettings, StageSettings
from sim2real.recording import AxisSignals, BoolArray, FloatArray, Recording
from sim2real.report import SIGNALS

_REST_UNITS = 4
"""A force at the first sample beyond so many force units is taken as the friction's state there."""
_STILL = 10
"""A recording starts at rest where the demand stands for so many samples."""
_LEVEL = 15
"""Samples before and after a jump of the time that say whether it stays."""
_DRIFT = 0.01
"""A clock this far off is counted in its own periods."""
_MAX_STRETCH = 10
"""Periods passed over for each sample, at most: beyond that it is no recording of one run."""

Signals = dict[str, dict[str, FloatArray]]
"""Axis -> signal ("position", "force") -> float64[K] in m or N."""


@dataclass(frozen=True, slots=True, eq=False)
class Replay:
    """What is fed to a model to compare it with a recording of K samples.

    Attributes:
        recording: the measured side.
        names: of the axes, in the order of the model.
        period: SYNC period [s].
        demand, offset: setpoints of every SYNC period, shape (P, axes), P >= K [m, N].
        place: int64[K], the period that each sample belongs to.
        rest_force: motor force of each axis at the start [N].
    """

    recording: Recording
    names: tuple[str, ...]
    period: float
    demand: FloatArray
    offset: FloatArray
    place: NDArray[np.int64]
    rest_force: tuple[float, ...]

    def run(self, settings: StageSettings, seed: int | None = None) -> Signals:
        """The model's signals at the recording's samples.

        Args:
            settings: of the model, the same axes and SYNC period as `prepare` was given.
            seed: of encoder noise and friction wander; None for neither.
        """
        response = simulate(settings, self.demand, self.offset, seed, rest_force=self.rest_force)
        return {name: self._sampled(response, a) for a, name in enumerate(self.names)}

    def run_axis(self, settings: StageSettings, name: str) -> dict[str, FloatArray]:
        """Signals of one axis, without noise; the others are run where they have to be."""
        if needs_all_axes(settings):
            return self.run(settings)[name]
        a = self.names.index(name)
        response = simulate(
            replace(settings, axes=(settings.axes[a],)),
            self.demand[:, a : a + 1],
            self.offset[:, a : a + 1],
            None,
            rest_force=(self.rest_force[a],),
        )
        return self._sampled(response, 0)

    def _sampled(self, response: Response, a: int) -> dict[str, FloatArray]:
        return {signal: getattr(response, signal)[self.place, a] for signal in SIGNALS}

    def measured(self) -> Signals:
        """The recorded signals."""
        return {
            name: {"position": axis.position_actual, "force": axis.force_actual}
            for name, axis in ((n, self.recording.axes[n]) for n in self.names)
        }

    def valid(self, axis: str) -> BoolArray:
        """bool[K], samples that count."""
        return self.recording.axes[axis].valid


def prepare(recording: Recording, settings: StageSettings) -> Replay:
    """Fit a recording to a model.

    Raises:
        ValueError: axes or SYNC periods that differ, or an axis without a valid sample.
    """
    names = tuple(axis.name for axis in settings.axes)
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
    return Replay(
        recording,
        names,
        settings.sync_period,
        np.column_stack([s.position_demand for s in signals])[sent],
        np.column_stack([s.force_offset for s in signals])[sent],
        place,
        tuple(_rest_force(s, axis) for s, axis in zip(signals, settings.axes, strict=True)),
    )


def _rest_force(signals: AxisSignals, axis: AxisSettings) -> float:
    """Force that holds the axis at the start [N]; 0 where it moves, or has no integrator."""
    force = float(signals.force_actual[0])
    still = bool(np.all(signals.position_demand[:_STILL] == signals.position_demand[0]))
    large = abs(force) > _REST_UNITS * axis.control.rated_force / 1000.0
    return force if still and large and axis.control.ki > 0 else 0.0


def residual(measured: Signals, model: Signals) -> Signals:
    """Measured minus model, every axis and signal."""
    return {
        name: {signal: values - model[name][signal] for signal, values in signals.items()}
        for name, signals in measured.items()
    }


def rms(difference: FloatArray, valid: BoolArray) -> float:
    """Root mean square over valid samples; inf where there is no such number."""
    with np.errstate(over="ignore"):
        return float(np.sqrt(np.mean(np.square(difference[valid]))))


def _places(time: FloatArray, period: float) -> NDArray[np.int64]:
    """Number of the SYNC period each sample belongs to, from 0, strictly increasing.

    Args:
        time: of the samples [s].
        period: of the model's SYNC [s].

    Raises:
        ValueError: the samples are not a period apart.
    """
    if len(time) < 2:
        return np.arange(len(time))
    usual = float(np.median(np.diff(time)))
    if abs(usual - period) > 0.1 * period:
        raise ValueError(
            f"its samples are {usual:.6g} s apart, the model's sync_period is {period:g} s"
        )
    places = periods(time, usual if abs(usual - period) > _DRIFT * period else period)
    if places[-1] > _MAX_STRETCH * len(time):
        raise ValueError(f"its samples are spread over {places[-1] * period:.6g} s")
    return places


def periods(time: FloatArray, period: float) -> NDArray[np.int64]:
    """Number of the SYNC period of each sample, from 0, strictly increasing.

    One after the other, but where time jumps ahead for good: there periods were passed over. A
    host that stamps a few samples late has passed over none.

    Args:
        time: of the samples [s].
        period: of the SYNC [s].
    """
    steps = np.arange(len(time))
    place = steps.copy()
    level = (time - time[0]) / period - steps
    jumps = np.flatnonzero(np.diff(level) > 0.5)
    edges = [-1, *jumps.tolist(), len(time) - 1]
    for number, jump in enumerate(jumps, start=1):
        before = level[max(edges[number - 1] + 1, jump + 1 - _LEVEL) : jump + 1]
        after = level[jump + 1 : min(edges[number + 1] + 1, jump + 1 + _LEVEL)]
        place[jump + 1 :] += max(round(float(np.median(after) - np.median(before))), 0)
    return place
