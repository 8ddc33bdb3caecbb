"""A recording with the errors of its channels removed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from hil_sim.settings import StageSettings
from sim2real.findings import ChannelFinding
from stagedata import AxisSignals, BoolArray, FloatArray, Recording


def scale_gain(settings: StageSettings, axis: str, term: str, factor: float) -> StageSettings:
    """The settings with one gain of an axis' controller scaled.

    Args:
        settings: of the stage.
        axis: its name.
        term: the gain ("kp", "ki", "kd").
        factor: that it is multiplied by, > 0.
    """
    axes = tuple(
        replace(a, control=replace(a.control, **{term: getattr(a.control, term) * factor}))
        if a.name == axis
        else a
        for a in settings.axes
    )
    return replace(settings, axes=axes)


def _replace_channels(
    recording: Recording, axis: str, **channels: FloatArray | BoolArray
) -> Recording:
    """The recording with channels of one axis replaced."""
    signals: AxisSignals = replace(recording.axes[axis], **channels)  # type: ignore[arg-type]
    return replace(recording, axes={**recording.axes, axis: signals})


def rescale(recording: Recording, findings: list[ChannelFinding]) -> Recording:
    """The recording with the factors found divided out and the offsets found subtracted."""
    for finding in findings:
        if finding.axis not in recording.axes or not finding.value:
            continue
        values = getattr(recording.axes[finding.axis], finding.channel)
        if finding.finding in ("units", "sign", "scale"):
            values = values / finding.value
        elif finding.finding == "offset":
            values = values - finding.value
        recording = _replace_channels(recording, finding.axis, **{finding.channel: values})
        if finding.finding == "units" and finding.channel == "position_demand":
            recording = _rescale_moves(recording, finding.axis, finding.value)
    return recording


def _rescale_moves(recording: Recording, axis: str, factor: float) -> Recording:
    """The recording with the ends of its moves on one axis divided by a factor."""
    moves = tuple(
        replace(
            move,
            origin={**move.origin, axis: move.origin[axis] / factor},
            target={**move.target, axis: move.target[axis] / factor},
        )
        for move in recording.moves
    )
    return replace(recording, moves=moves)


def remove_delay(
    recording: Recording, axis: str, channel: str, delay: float, period: float
) -> Recording:
    """The recording with a channel moved back by its delay [s].

    Samples for which a measured channel then has no value are no longer valid; setpoints keep their
    first or last value there. The force offset moves with the position demand.
    """
    if channel == "position_demand":
        recording = remove_delay(recording, axis, "force_offset", delay, period)
        return shift_channel(recording, axis, channel, lambda t: t - delay)
    if channel == "force_offset":
        return shift_channel(recording, axis, channel, lambda t: t - delay)
    return shift_channel(recording, axis, channel, lambda t: t + delay)


def shift_channel(
    recording: Recording, axis: str, channel: str, at: Callable[[FloatArray], FloatArray]
) -> Recording:
    """The recording with a channel resampled at other times.

    Args:
        recording: whose channel it is.
        axis: its name.
        channel: its name.
        at: sample times -> times at which the channel is read instead, float64[K] each [s].
    """
    time, values = recording.time, getattr(recording.axes[axis], channel)
    wanted = np.clip(at(time), time[0], time[-1])
    shift = (wanted - time) / np.median(np.diff(time))
    if np.all(np.abs(shift - np.rint(shift)) < 1e-3):  # whole samples: nothing to interpolate
        moved = values[np.clip(np.arange(len(time)) + np.rint(shift).astype(int), 0, len(time) - 1)]
    elif channel == "position_actual":
        moved = CubicSpline(time, values)(wanted)
    else:
        moved = np.interp(wanted, time, values)
    inside = (at(time) >= time[0] - 1e-9) & (at(time) <= time[-1] + 1e-9)
    valid = recording.axes[axis].valid & (inside | (channel in ("position_demand", "force_offset")))
    return _replace_channels(recording, axis, **{channel: moved, "valid": valid})
