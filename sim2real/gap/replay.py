"""The free-run simulation of a recording: its demands replayed on a stage model.

The model starts at rest at the first target. Where a recording starts with force in the motor
(after homing), the model starts with that force in its friction elements and its integrator. A long
recording comes in blocks, along which one simulation goes on.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hil_sim.plant import Response, Simulation, needs_all_axes, simulate
from hil_sim.settings import AxisSettings, StageSettings
from sim2real.findings import SIGNALS
from sim2real.gap.quantisation import coarse_steps
from sim2real.gap.sync_grid import match_periods, skipped_periods
from stagedata import AxisSignals, BoolArray, FloatArray, Recording

_REST_UNITS = 4
"""A force beyond this many force units at the first sample is the friction's initial state."""
_STILL = 10
"""A recording starts at rest where the demand stands still for this many samples."""

Signals = dict[str, dict[str, FloatArray]]
"""Axis -> signal ("position", "force") -> float64[K] in m or N."""


@dataclass(frozen=True, slots=True, eq=False)
class BlockEnd:
    """The last sample of a block of a recording.

    Attributes:
        time: of the sample [s].
        demand, offset: its setpoints, float64[axes] [m, N].
    """

    time: float
    demand: FloatArray
    offset: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Replay:
    """What a model is fed with to be compared with a recording of K samples.

    Attributes:
        recording: the measured side.
        names: of the axes, in the order of the model.
        period: SYNC period [s].
        demand, offset: setpoints of every SYNC period, shape (P, axes), P >= K [m, N].
        place: int64[K], number of the SYNC period that each sample belongs to; of a block that
            follows another, from the period after that one's last sample.
        rest_force: motor force of each axis at the start [N].
        steps: axis -> signal -> step of the log where it is coarser than the sensor [m, N].
        start: of the recording, on the clock of effects that fade with time [s].
    """

    recording: Recording
    names: tuple[str, ...]
    period: float
    demand: FloatArray
    offset: FloatArray
    place: NDArray[np.int64]
    rest_force: tuple[float, ...]
    steps: Mapping[str, Mapping[str, float]]
    start: float = 0.0

    def run(self, settings: StageSettings, seed: int | None = None) -> Signals:
        """Simulated signals at the recording's samples.

        Args:
            settings: of the model, with the axes and SYNC period that `prepare_replay` was given;
                it starts when the recording did.
            seed: of encoder noise and friction wander; None for neither.
        """
        settings = replace(settings, start=self.start)
        response = simulate(settings, self.demand, self.offset, seed, rest_force=self.rest_force)
        return {name: self._sampled(response, a) for a, name in enumerate(self.names)}

    def simulation(self, settings: StageSettings, seed: int | None) -> Simulation:
        """A simulation that starts where this recording does; arguments as of `run`."""
        settings = replace(settings, start=self.start).reaching(self.demand)
        return Simulation(settings, (self.demand[0], self.offset[0]), seed, self.rest_force)

    def go_on(self, simulation: Simulation) -> Signals:
        """Signals at this block's samples of a simulation that has come to its first period."""
        response = simulation.run(self.demand, self.offset)
        return {name: self._sampled(response, a) for a, name in enumerate(self.names)}

    def end(self) -> BlockEnd:
        """Where this block ends."""
        time = float(self.recording.time[-1])
        return BlockEnd(time, self.demand[-1].copy(), self.offset[-1].copy())

    def run_axis(self, settings: StageSettings, name: str) -> dict[str, FloatArray]:
        """Noise-free signals of one axis; others are simulated only where it needs them."""
        if needs_all_axes(settings):
            return self.run(settings)[name]
        a = self.names.index(name)
        response = simulate(
            replace(settings, axes=(settings.axes[a],), start=self.start),
            self.demand[:, a : a + 1],
            self.offset[:, a : a + 1],
            None,
            rest_force=(self.rest_force[a],),
        )
        return self._sampled(response, 0)

    def _sampled(self, response: Response, a: int) -> dict[str, FloatArray]:
        return {signal: getattr(response, signal)[self.place, a] for signal in SIGNALS}

    def as_logged(self, signals: Signals) -> Signals:
        """Simulated signals rounded as the log is, where that is coarser than the sensors."""
        return {
            name: {
                signal: np.rint(values / step) * step
                if (step := self.steps[name].get(signal))
                else values
                for signal, values in of_axis.items()
            }
            for name, of_axis in signals.items()
        }

    def measured(self) -> Signals:
        """The recorded signals."""
        return {
            name: {"position": axis.position_actual, "force": axis.force_actual}
            for name, axis in ((n, self.recording.axes[n]) for n in self.names)
        }

    def valid(self, axis: str) -> BoolArray:
        """bool[K], the axis' valid samples."""
        return self.recording.axes[axis].valid


def prepare_replay(
    recording: Recording, settings: StageSettings, after: BlockEnd | None = None
) -> Replay:
    """Match a recording to a model, which starts when the settings say.

    Args:
        recording: or a block of one, of at least one sample.
        settings: of the model.
        after: end of the block before; None for the first.

    Raises:
        ValueError: axes or SYNC periods differ, an axis has no valid sample, or its demand or force
            was not logged.
    """
    names = tuple(axis.name for axis in settings.axes)
    if set(names) != set(recording.axes):
        raise ValueError(
            f"the model has axes {', '.join(names)}, the recording {', '.join(recording.axes)}"
        )
    signals = [recording.axes[name] for name in names]
    for name, axis in zip(names, signals, strict=True):
        if after is None and not axis.valid.any():
            raise ValueError(f"axis {name}: no valid sample")
        if axis.missing:
            raise ValueError(
                f"axis {name}: {' and '.join(axis.missing)} not logged: there is no loop to "
                f"simulate; a diagnosis compares forces along the motion"
            )
    place = match_periods(recording.time, settings.sync_period)
    # Where whole periods were skipped, the drives held their setpoint.
    sent = np.searchsorted(place, np.arange(place[-1] + 1), side="right") - 1
    demand = np.column_stack([s.position_demand for s in signals])[sent]
    offset = np.column_stack([s.force_offset for s in signals])[sent]
    if after is not None:
        held = skipped_periods(after.time, recording.time, settings.sync_period)
        demand = np.concatenate((np.tile(after.demand, (held, 1)), demand))
        offset = np.concatenate((np.tile(after.offset, (held, 1)), offset))
        place += held
    return Replay(
        recording,
        names,
        settings.sync_period,
        demand,
        offset,
        place,
        tuple(_rest_force(s, axis) for s, axis in zip(signals, settings.axes, strict=True)),
        {axis.name: coarse_steps(recording.axes[axis.name], axis) for axis in settings.axes},
        settings.start,
    )


def run_by_model(replay: Replay, settings: StageSettings, seed: int) -> Replay:
    """The recording that the model itself would have made of these demands, noise included.

    Args:
        replay: of the recording.
        settings: of the model.
        seed: of encoder noise and friction wander.
    """
    run = replay.as_logged(replay.run(settings, seed))
    axes = {
        name: replace(
            signals, position_actual=run[name]["position"], force_actual=run[name]["force"]
        )
        for name, signals in replay.recording.axes.items()
        if name in run
    }
    own = replace(replay.recording, axes=axes)
    return prepare_replay(own, replace(settings, start=replay.start))


def _rest_force(signals: AxisSignals, axis: AxisSettings) -> float:
    """Force that holds the axis at the start [N]; 0 where it moves or has no integrator."""
    force = float(signals.force_actual[0])
    still = bool(np.all(signals.position_demand[:_STILL] == signals.position_demand[0]))
    large = abs(force) > _REST_UNITS * axis.control.rated_force / 1000.0
    return force if still and large and axis.control.ki > 0 else 0.0


def subtract_signals(measured: Signals, model: Signals) -> Signals:
    """Measured minus simulated, of every axis and signal."""
    return {
        name: {signal: values - model[name][signal] for signal, values in signals.items()}
        for name, signals in measured.items()
    }


def rms(difference: FloatArray, valid: BoolArray) -> float:
    """Root mean square over valid samples; inf where it overflows."""
    with np.errstate(over="ignore"):
        return float(np.sqrt(np.mean(np.square(difference[valid]))))
