"""Rows that a log lost and values that it repeated, recognised before anything is judged by them.

Loggers drop rows, and hold a value where none arrived. Neither is physics: such samples are marked
as not valid, lost rows are restored with interpolated demands. Where the host itself paused, the
drives held their setpoint, and nothing is restored. The demand tells the two apart: it advances
through a gap in the log, but not through a pause of the host.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import Akima1DInterpolator, CubicSpline, PPoly

from hil_sim.settings import AxisSettings, StageSettings
from sim2real.audit.signal_checks import ALL_AXES
from sim2real.findings import ChannelFinding
from sim2real.gap import match_periods, quantisation_step
from stagedata import AxisSignals, BoolArray, FloatArray, Move, Recording

_SMOOTH = CubicSpline
"""Of the demand: exact where its jerk is constant. 0.1 um off are 0.1 N and more by the drive."""
_STEPS = 3.0
"""Smallest change of position per sample, in units of log resolution plus noise, at which a held
value can be told from standstill."""
_JUMP = 1.5
"""After a held value the position catches up: it then changes by at least this multiple of the
change per sample before and after."""
_LATE = 2
"""Samples after a held value within which the position catches up; those before it are late."""
_CLEAR = 0.25
"""The demand tells lost rows from a pause if it has advanced by the periods skipped, or by none of
them, to within this share."""
_MOST_LOST = 0.2
"""Largest ratio of lost to logged rows at which the lost ones are put back."""


def repair_samples(
    recording: Recording, settings: StageSettings
) -> tuple[Recording, list[ChannelFinding]]:
    """The recording with lost rows put back and held values marked as not valid.

    Args:
        recording: as logged.
        settings: of the machine file.

    Returns:
        The recording, unchanged where nothing is wrong or its time cannot be matched with the
        SYNC; and what was found, marked as applied.
    """
    try:
        place = match_periods(recording.time, settings.sync_period)
    except ValueError:
        return recording, []
    findings: list[ChannelFinding] = []
    lost = _lost_rows(recording, place)
    if 0 < lost.sum() <= _MOST_LOST * len(recording):
        share = float(lost.sum()) / (len(recording) + float(lost.sum()))
        text = (
            f"{lost.sum()} rows ({100 * share:.2g} %) are missing in the log; they count as invalid"
        )
        findings.append(_applied(ALL_AXES, "time", "missing", share, text))
        recording = _with_rows(recording, lost)
    held = {
        axis.name: _held_samples(recording.axes[axis.name], axis)
        for axis in settings.axes
        if axis.name in recording.axes
    }
    if any(mask.any() for mask in held.values()):
        rows = np.logical_or.reduce(list(held.values()))
        for name, mask in held.items():  # a row that is late on one axis is so on the others
            mask |= rows & (np.diff(recording.axes[name].position_actual, prepend=np.nan) == 0.0)
        recording = _without_held(recording, held)
    for name, mask in held.items():
        if mask.any():
            share = float(mask.mean())
            text = (
                f"{name}: position_actual repeats its last value in motion at {mask.sum()} of "
                f"{len(mask)} samples ({100 * share:.2g} %); they count as invalid"
            )
            findings.append(_applied(name, "position_actual", "held", share, text))
    return recording, findings


def _applied(axis: str, channel: str, kind: str, share: float, text: str) -> ChannelFinding:
    return ChannelFinding(axis, channel, kind, share, "1", applied=True, text=text)


def _lost_rows(recording: Recording, place: NDArray[np.int64]) -> NDArray[np.int64]:
    """Rows lost before each sample, int64[K].

    Where rows were lost, the demand has advanced by as many periods as the time; where the host
    paused, by one. At rest and where its speed changes fast the demand does not say; what most of
    the other gaps are, these are too, unless they are longer than all of those.
    """
    steps = np.diff(place)
    usual_steps = np.flatnonzero(steps == 1)
    changes = [np.diff(signals.position_demand) for signals in recording.axes.values()]
    lost, paused, unclear = [], [], []
    for k in (np.flatnonzero(steps > 1) + 1).tolist():
        around = _nearest(usual_steps, k - 1, k - 1)
        usual = [0.0 if around is None else float(c[list(around)].mean()) for c in changes]
        a = int(np.argmax(np.abs(usual)))
        periods = float(changes[a][k - 1]) / usual[a] if usual[a] != 0.0 else math.nan
        advanced = (periods - 1.0) / (steps[k - 1] - 1.0)
        if abs(advanced - 1.0) < _CLEAR:
            lost.append(k)
        elif abs(advanced) < _CLEAR:
            paused.append(k)
        else:
            unclear.append(k)
    if len(lost) > len(paused):
        longest = max(int(steps[k - 1]) for k in lost)
        lost += [k for k in unclear if steps[k - 1] <= longest]
    before = np.zeros(len(recording), dtype=np.int64)
    before[lost] = [int(steps[k - 1]) - 1 for k in lost]
    return before


def _nearest(usual: NDArray[np.int64], first: int, last: int) -> tuple[int, int] | None:
    """The usual steps next to those from `first` to `last`, before and after; None without them.

    Next to a lost or a held sample there may be another one.
    """
    before = int(np.searchsorted(usual, first)) - 1
    after = int(np.searchsorted(usual, last, side="right"))
    return (int(usual[before]), int(usual[after])) if before >= 0 and after < len(usual) else None


def _with_rows(recording: Recording, lost: NDArray[np.int64]) -> Recording:
    """The recording with rows inserted before each sample, not valid."""
    index = np.arange(len(recording)) + np.cumsum(lost)
    every = np.arange(index[-1] + 1)
    was = np.zeros(len(every), dtype=bool)
    was[index] = True

    def between(values: FloatArray, read: type[PPoly] = Akima1DInterpolator) -> FloatArray:
        filled: FloatArray = read(index, values)(every)
        filled[index] = values
        return filled

    before = np.cumsum(was) - 1
    axes = {}
    for name, signals in recording.axes.items():
        axes[name] = AxisSignals(
            between(signals.position_demand, _SMOOTH),
            between(signals.force_offset),
            between(signals.position_actual),
            between(signals.force_actual),
            None if signals.statusword is None else signals.statusword[before],
            signals.valid[before] & was,
            signals.missing,
        )
    ends = np.append(index, len(every))

    def moved(move: Move) -> Move:
        return replace(move, start=int(ends[move.start]), end=int(ends[move.end]))

    return replace(
        recording,
        time=between(recording.time),
        axes=axes,
        moves=tuple(moved(move) for move in recording.moves),
    )


def _held_samples(signals: AxisSignals, axis: AxisSettings) -> BoolArray:
    """Where the logged position repeats itself although the axis moves, bool[K]."""
    position = signals.position_actual
    held = np.zeros(len(position), dtype=bool)
    logged = position[signals.valid]
    noise = max(axis.noise, _scatter(logged))
    usual = _STEPS * ((quantisation_step(logged) or axis.increment) + noise)
    change = np.diff(position)
    moves = change != 0.0
    moves[1:] &= change[:-1] != 0.0  # what follows a held value catches up
    moving = np.flatnonzero(moves)
    still = np.flatnonzero(change == 0.0)
    for run in np.split(still, np.flatnonzero(np.diff(still) > 1) + 1):
        if not len(run):
            continue
        around = _nearest(moving, int(run[0]), int(run[-1]) + _LATE)
        if around is None:
            continue
        before, after = change[list(around)]
        mean = 0.5 * (before + after)
        if before * after <= 0.0 or abs(mean) <= usual:
            continue
        missed = max(_JUMP, 0.5 * len(run))  # else it has rested
        for last in range(run[-1] + 1, run[-1] + _LATE + 1):
            if change[last] / mean > missed:
                held[run[0] + 1 : last + 1] = True
                break
    return held & signals.valid


def _scatter(position: FloatArray) -> float:
    """Noise of a position, rms [m], from third differences, in which motion hardly shows.

    It is the median's, so that a few held values do not count.
    """
    if len(position) < 4:
        return 0.0
    return 1.4826 * float(np.median(np.abs(np.diff(position, 3)))) / math.sqrt(20.0)


def _without_held(recording: Recording, held: dict[str, BoolArray]) -> Recording:
    """Mark held samples as not valid; where whole rows were repeated, interpolate the demands."""
    rows = np.logical_or.reduce(list(held.values()))
    for signals in recording.axes.values():
        for values in (signals.position_demand, signals.position_actual):
            rows &= np.diff(values, prepend=np.nan) == 0.0
    index = np.arange(len(recording))
    axes = {}
    for name, signals in recording.axes.items():
        demand, offset = signals.position_demand, signals.force_offset
        if rows.any():
            demand, offset = demand.copy(), offset.copy()
            for values, read in ((demand, _SMOOTH), (offset, Akima1DInterpolator)):
                values[rows] = read(index[~rows], values[~rows])(index[rows])
        axes[name] = replace(
            signals, position_demand=demand, force_offset=offset, valid=signals.valid & ~held[name]
        )
    return replace(recording, axes=axes)
