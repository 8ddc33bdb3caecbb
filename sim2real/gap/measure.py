"""The gap of a stage model against a recording; nothing is fitted.

The closed loop of the model is simulated with the recording's demands and offsets, without noise
but with roundings. The gap of a signal is the rms of recorded minus simulated over valid samples,
in m or N. The combined gap is G^2, the sum over axes and signals of (gap/floor)^2. `GapMeter` takes
a recording of any length in blocks. Definitions: docs/formats/gap-report.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hil_sim.settings import StageSettings
from sim2real.findings import SIGNALS, GapFigures
from sim2real.gap.floor import DRAWS, Floor, MeanSquares, ModelRuns, RepeatCheck, RepeatScatter
from sim2real.gap.replay import BlockEnd, Replay, Signals, prepare_replay, subtract_signals
from stagedata import Recording

Gap = dict[str, dict[str, GapFigures]]
"""Axis -> signal ("position", "force") -> figures."""

NO_GAP_BELOW = 1.5
"""Squared combined gap over floor below which no share of it can be said to be closed."""


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """The gap of a model against a recording, with what it was computed from.

    Attributes:
        replay: the recording as fed to the model.
        floor: of the model.
        residual: recorded minus simulated, noise-free.
        gap: the figures.
        repeats: floor against repeated moves; empty where no move repeats another.
    """

    replay: Replay
    floor: Floor
    residual: Signals
    gap: Gap
    repeats: dict[str, dict[str, RepeatCheck]]


class GapMeter:
    """The gap of a model against a recording, added up block by block.

    Memory is that of one block, about 0.3 kB per sample.

    Args:
        settings: of the model; its axes must be those of the recording.
        draws: noisy draws for the floor.
        progress: called with (simulations done, all simulations).
        blocks: how many there will be.
    """

    def __init__(
        self,
        settings: StageSettings,
        draws: int = DRAWS,
        progress: Callable[[int, int], object] | None = None,
        blocks: int = 1,
    ) -> None:
        self._settings = settings
        self._draws = draws
        self._progress = progress
        self._simulations = blocks * (1 + draws)
        self._done = 0
        self._runs: ModelRuns | None = None
        self._end: BlockEnd | None = None
        self._squares = MeanSquares()
        self._repeats = RepeatScatter()

    def add(self, block: Recording) -> tuple[Replay, Signals, tuple[Signals, ...], Signals]:
        """Simulate the next block of the recording and add what the model leaves.

        Returns:
            The block as fed to the model; the model's noise-free signals; its draws minus those;
            recorded minus noise-free signals.

        Raises:
            ValueError: axes or SYNC periods differ, or an axis has no valid sample.
        """
        replay = prepare_replay(block, self._settings, self._end)
        if self._runs is None:
            self._runs = ModelRuns(replay, self._settings, self._draws)
        nominal, draws = self._runs.along(replay, self._count)
        residual = subtract_signals(replay.measured(), nominal)
        for name, signals in residual.items():
            valid = replay.valid(name)
            for signal, values in signals.items():
                every = [v[valid] for v in (values, *(draw[name][signal] for draw in draws))]
                with np.errstate(over="ignore"):
                    energy = [float(np.square(v).sum()) for v in every]
                self._squares.add(name, signal, energy, float(valid.sum()))
        self._repeats.add(replay, residual, draws)
        self._end = replay.end()
        return replay, nominal, draws, residual

    def gap(self) -> Gap:
        """The figures of all blocks."""
        return {
            axis.name: {
                signal: GapFigures(*self._squares.rms(axis.name, signal), axis.unit_of(unit))
                for signal, unit in SIGNALS.items()
            }
            for axis in self._settings.axes
        }

    def repeats(self) -> dict[str, dict[str, RepeatCheck]]:
        """The floor against repeated moves; empty where no move repeats another in its block."""
        return self._repeats.checks({axis.name: SIGNALS for axis in self._settings.axes})

    def _count(self) -> None:
        self._done += 1
        if self._progress is not None:
            self._progress(self._done, self._simulations)


def measure_gap(recording: Recording, settings: StageSettings, draws: int = DRAWS) -> Gap:
    """The gap of a model against a recording; arguments and errors as `compare_with_model`."""
    return compare_with_model(recording, settings, draws).gap


def compare_with_model(
    recording: Recording,
    settings: StageSettings,
    draws: int = DRAWS,
    progress: Callable[[int, int], object] | None = None,
) -> Measured:
    """The gap of a model against a recording, its floor, and the signals of both.

    Args:
        recording: of a stage.
        settings: of the model; its axes must be those of the recording.
        draws: noisy draws for the floor.
        progress: called with (simulations done, all simulations).

    Raises:
        ValueError: axes or SYNC periods differ, or an axis has no valid sample.
    """
    meter = GapMeter(settings, draws, progress)
    replay, nominal, noisy, residual = meter.add(recording)
    gap = meter.gap()
    floors = {
        axis: {signal: figures.floor for signal, figures in signals.items()}
        for axis, signals in gap.items()
    }
    return Measured(replay, Floor(nominal, noisy, floors), residual, gap, meter.repeats())


def combined_floors(gap: Mapping[str, Mapping[str, GapFigures]]) -> float:
    """The combined gap over its floor: the one figure that reasons, tables and pages give."""
    return math.sqrt(combined_gap(gap))


def combined_gap(gap: Mapping[str, Mapping[str, GapFigures]]) -> float:
    """Combined gap per signal, squared: G^2 over the number of signals, 1 at the floor.

    Signals whose floor is zero (a machine file without noise and repeatability) do not count.
    """
    ratios = [
        (figures.nominal / figures.floor) ** 2
        for signals in gap.values()
        for figures in signals.values()
        if figures.floor > 0
    ]
    return sum(ratios) / len(ratios) if ratios else float("nan")


def pool_gaps(gaps: Sequence[tuple[Gap, int]]) -> Gap:
    """Figures of several recordings taken together: mean squares weighted by their samples.

    Args:
        gaps: (figures, number of samples) of each recording, with the same axes.
    """
    samples = sum(count for _, count in gaps)

    def mean(axis: str, signal: str, name: str) -> float:
        energy = sum(count * getattr(gap[axis][signal], name) ** 2 for gap, count in gaps)
        return math.sqrt(energy / samples)

    return {
        axis: {
            signal: GapFigures(
                mean(axis, signal, "nominal"), mean(axis, signal, "floor"), figures.unit
            )
            for signal, figures in signals.items()
        }
        for axis, signals in gaps[0][0].items()
    }


def gap_closed(before: Gap, after: Gap) -> float | None:
    """The share of the gap that is closed from one model to another.

    1 - (G1^2 - floor^2)/(G0^2 - floor^2).

    Args:
        before: G0, of the machine file as given.
        after: G1; the floors are those of `before`.

    Returns:
        1 where nothing but the floor is left, or less than that; None where G0^2 < 1.5 floor^2, or
        where a gap is not finite.
    """
    same: Gap = {
        axis: {
            signal: GapFigures(figures.nominal, before[axis][signal].floor, figures.unit)
            for signal, figures in signals.items()
        }
        for axis, signals in after.items()
    }
    first, second = combined_gap(before), combined_gap(same)
    if not first >= NO_GAP_BELOW or not math.isfinite(first + second):
        return None
    return min(1.0, 1.0 - (second - 1.0) / (first - 1.0))
