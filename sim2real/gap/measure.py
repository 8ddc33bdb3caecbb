"""The gap of a stage model against a recording; nothing is fitted.

Gap: the recording's demands and offsets run through the closed-loop simulation of the model, free
of noise (roundings stay); rms over valid samples of recorded minus simulated, in m or N. Combined:
G^2, the sum over axes and signals of (gap/floor)^2. Definitions: docs/formats/gap-report.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from hil_sim.settings import StageSettings
from sim2real.gap.floor import DRAWS, Floor, RepeatCheck, check_repeats, floor
from sim2real.gap.replay import Replay, Signals, prepare, residual, rms
from sim2real.recording import Recording
from sim2real.report import SIGNALS, GapFigures

Gap = dict[str, dict[str, GapFigures]]
"""Axis -> signal ("position", "force") -> figures."""

NO_GAP_BELOW = 1.5
"""Combined gap over floor, squared, below which no share of it can be called closed."""


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """Gap of a model against a recording, with what it was computed from.

    Attributes:
        replay: the recording as fed to the model.
        floor: of the model.
        residual: recorded minus simulated, noise-free.
        gap: the figures.
        repeats: floor against repeated moves; empty where none repeats.
    """

    replay: Replay
    floor: Floor
    residual: Signals
    gap: Gap
    repeats: dict[str, dict[str, RepeatCheck]]


def measure(
    recording: Recording,
    settings: StageSettings,
    draws: int = DRAWS,
    progress: Callable[[int, int], object] | None = None,
) -> Gap:
    """The gap of a model against a recording; arguments and errors as `compare_with`."""
    return compare_with(recording, settings, draws, progress).gap


def compare_with(
    recording: Recording,
    settings: StageSettings,
    draws: int = DRAWS,
    progress: Callable[[int, int], object] | None = None,
) -> Measured:
    """The gap of a model against a recording, and its floor.

    Args:
        recording: of a stage.
        settings: of the model; its axes must be those of the recording.
        draws: noisy draws for the floor.
        progress: called with (simulations done, all).

    Raises:
        ValueError: axes or SYNC periods that differ, or a recording without a valid sample.
    """
    replay = prepare(recording, settings)
    below = floor(replay, settings, draws, progress)
    difference = residual(replay.measured(), below.nominal)
    gap: Gap = {
        name: {
            signal: GapFigures(
                rms(difference[name][signal], replay.valid(name)), below.rms[name][signal], unit
            )
            for signal, unit in SIGNALS.items()
        }
        for name in replay.names
    }
    checked = check_repeats(recording, replay.period, difference, below.draws)
    return Measured(replay, below, difference, gap, checked)


def combined(gap: Gap) -> float:
    """G^2 over the number of signals: 1 where nothing is left but the floor.

    Signals whose floor is zero (a machine file without noise and repeatability) don't count.
    """
    ratios = [
        (figures.nominal / figures.floor) ** 2
        for signals in gap.values()
        for figures in signals.values()
        if figures.floor > 0
    ]
    return sum(ratios) / len(ratios) if ratios else float("nan")


def pooled(gaps: Sequence[tuple[Gap, int]]) -> Gap:
    """Figures of several recordings as of one: mean squares weighted by their samples.

    Args:
        gaps: (figures, samples) of each recording, the same axes in all.
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


def closed(before: Gap, after: Gap) -> float | None:
    """Gap closed from one model to another: 1 - (G1^2 - floor^2)/(G0^2 - floor^2).

    Args:
        before: G0, of the machine file as given.
        after: G1; the floors are those of `before`.

    Returns:
        1 where nothing is left but the floor; None where G0^2 < 1.5 floor^2, or where one of the
        gaps is beyond all numbers.
    """
    same: Gap = {
        axis: {
            signal: GapFigures(figures.nominal, before[axis][signal].floor, figures.unit)
            for signal, figures in signals.items()
        }
        for axis, signals in after.items()
    }
    first, second = combined(before), combined(same)
    if not first >= NO_GAP_BELOW or not math.isfinite(first + second):
        return None
    return 1.0 - (second - 1.0) / (first - 1.0)
