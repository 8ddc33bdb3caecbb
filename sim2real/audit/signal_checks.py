"""Faults that the logged numbers alone reveal, from units and signs to saturation.

Neither controller nor mechanics are used, only the demand, which a stage in closed loop follows,
and the travel of the machine file. The findings are not applied yet.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from hil_sim.settings import AxisSettings
from sim2real.findings import SIGNALS, ChannelFinding
from sim2real.gap import coarse_steps, number_periods, stated_step
from sim2real.phases import REST, split_phases
from stagedata import AxisSignals, BoolArray, FloatArray

ALL_AXES = "all"
"""Axis of a finding about time, which all axes share."""

_POWERS = (1e3, 1e6, 1e9, 1e-3, 1e-6)
_NAMES = {1e3: "mm", 1e6: "µm", 1e9: "nm or counts"}
_ANGLES = {1e3: "mrad", 1e6: "µrad", 1e9: "nrad or counts"}
_CLOSE = 0.03
"""Relative distance within which a factor is taken for that of a unit."""
_DRIFT = 20e-6
"""Relative rate error of the time stamps from which their drift is reported."""
_JITTER = 0.05
"""Host time stamps that scatter by more than this share of the SYNC period are reported."""
_SCALE = 2e-4
"""Relative deviation of the logged position's scale from which it is reported."""
_SCALE_IN_MOTION = 5e-3
"""As `_SCALE`, of a recording without rests."""
_SLOWED = 3.0
"""Multiple of the loss of amplitude that a lagging loop explains: within it there is no scale."""
_PARTS = 8
"""Parts of a recording, each left out once, that show how well a scale is known."""
_OFFSET = 5e-6
"""Logged minus demanded position at rest beyond which the log has an offset [m]."""
_CERTAIN = 5.0
"""Standard deviations by which scale and offset must differ; a slow loop has not settled when the
next move begins."""
_FEWEST = 4
"""Fewest rests by which scale and offset are judged."""
_SPREAD = 1e-3
"""Shortest range of the demand at which positions are judged [m]."""
_FULL = 0.995
"""Share of the peak force from which the drive counts as saturated."""
_PLATEAU = 3
"""Fewest samples at a limit below the peak force for it to be reported."""


def note(
    axis: str, channel: str, kind: str, value: float, words: str, unit: str = "1"
) -> ChannelFinding:
    """A finding, in words that follow the names of axis and channel."""
    place = channel if axis == ALL_AXES else f"{axis}: {channel}"
    return ChannelFinding(axis, channel, kind, value, unit, text=f"{place} {words}")


def check_time(time: FloatArray, period: float) -> list[ChannelFinding]:
    """Units, drift and jitter of the time stamps.

    Args:
        time: as recorded, float64[K], in seconds unless it is in another unit.
        period: SYNC period of the machine file [s].
    """
    if len(time) < 10:
        return []
    steps = np.diff(time)
    usual = float(np.median(steps)) / period
    for factor, name in ((1e3, "ms"), (1e6, "µs"), (1e9, "ns")):
        if abs(usual / factor - 1.0) < _CLOSE:
            return [note(ALL_AXES, "time", "units", factor, f"is in {name}, not in seconds")]
    if abs(usual - 1.0) > 0.1:
        return []
    place = number_periods(time, usual * period)
    slope, start = np.polyfit(place * period, time, 1)
    scatter = float(np.std(time - slope * place * period - start))
    found = []
    sigma = scatter / (float(np.std(place)) * period * math.sqrt(len(time)))
    drift = float(slope) - 1.0
    if abs(drift) > max(_DRIFT, 5.0 * sigma):
        words = f"stamps run {drift * 1e6:+.0f} ppm against the SYNC period"
        found.append(note(ALL_AXES, "time", "clock", drift, words))
    if scatter > _JITTER * period:
        words = f"stamps jitter by {scatter * 1e6:.0f} µs rms around the SYNC period"
        found.append(note(ALL_AXES, "time", "jitter", scatter, words, "s"))
    return found


def check_constant(signals: AxisSignals, axis: AxisSettings) -> list[ChannelFinding]:
    """A channel that does not change while the axis is commanded to move."""
    if np.ptp(signals.position_demand[signals.valid]) < _SPREAD:
        return []
    found = []
    for channel, unit in (("position_actual", "m"), ("force_actual", "N")):
        values = getattr(signals, channel)[signals.valid]
        if np.ptp(values) == 0.0:
            value, own = float(values[0]), axis.unit_of(unit)
            words = f"is constant at {value:.4g} {own}"
            found.append(note(axis.name, channel, "constant", value, words, own))
    return found


def check_demand_units(signals: AxisSignals, axis: AxisSettings) -> list[ChannelFinding]:
    """A demand that exceeds the travel by powers of ten is in another unit."""
    reach = max(abs(end) for end in axis.travel)
    largest = float(np.abs(signals.position_demand).max())
    for factor in (1e3, 1e6, 1e9):
        if largest > 2.0 * reach and largest / factor <= 1.2 * reach:
            words = f"is in {_names(axis)[factor]}, not in {axis.unit_of('metres')}"
            return [note(axis.name, "position_demand", "units", factor, words)]
    return []


def check_position(signals: AxisSignals, axis: AxisSettings, period: float) -> list[ChannelFinding]:
    """Units, sign, scale and offset of the logged position against the demand, which it follows.

    Args:
        signals: of the axis.
        axis: of the machine file.
        period: Ts [s].
    """
    demand, actual = signals.position_demand, signals.position_actual
    valid = signals.valid
    if np.ptp(demand[valid]) < _SPREAD:
        return []
    rough = float(np.polyfit(demand[valid], actual[valid], 1)[0])
    counts = 1.0 / axis.increment
    unit = match_unit(rough, {counts: "counts"})
    if unit is not None:
        other = "counts" if unit == counts else f"units of {1 / unit:g} {axis.unit_of('m')}"
        words = f"is in {_names(axis).get(unit, other)}, not in {axis.unit_of('metres')}"
        return [note(axis.name, "position_actual", "units", unit, words)]
    if abs(rough + 1.0) < _CLOSE:
        return [note(axis.name, "position_actual", "sign", -1.0, "has the wrong sign")]
    resting = valid & (split_phases(demand, period).phase == REST)
    ends = np.flatnonzero(resting & ~np.append(resting[1:], False))
    if len(ends) < _FEWEST or resting.sum() < 20 or np.ptp(demand[resting]) < _SPREAD:
        scale = _scale_in_motion(demand, actual, valid, period)
        return [] if scale is None else [scale_finding(axis, scale)]
    line, (off_scale, off_place) = _line(demand[ends], actual[ends])
    slope, offset = line.tolist()
    found = []
    if abs(slope - 1.0) > max(_SCALE, _CERTAIN * off_scale):
        found.append(scale_finding(axis, slope))
    if axis.control.ki > 0 and abs(offset) > max(_OFFSET, _CERTAIN * off_place):
        words = f"is off by {offset * 1e6:.3g} {axis.unit_of('µm')}"
        found.append(note(axis.name, "position_actual", "offset", offset, words, axis.unit_of("m")))
    return found


def scale_finding(axis: AxisSettings, scale: float) -> ChannelFinding:
    """The logged positions of an axis are the real ones times a scale."""
    return note(axis.name, "position_actual", "scale", scale, f"is scaled by {scale:.5g}")


def _scale_in_motion(
    demand: FloatArray, actual: FloatArray, valid: BoolArray, period: float
) -> float | None:
    """The ratio of logged to demanded position where there are no rests; None where it may be 1.

    A loop that lags by T has a smaller amplitude, too: by about the square of T times the rate of
    the motion. Springs and friction that a loop does not settle are far smaller than what counts.

    Args:
        demand: position, float64[K] [m].
        actual: position as logged, float64[K] [m].
        valid: bool[K].
        period: of the samples [s].
    """
    velocity = np.gradient(demand, period)
    columns = np.column_stack((demand, velocity, np.ones(len(demand))))[valid]
    columns[:, 0] -= columns[:, 0].mean()
    logged = actual[valid]
    solved = np.linalg.lstsq(columns, logged, rcond=None)[0]
    parts = np.array_split(np.arange(len(logged)), _PARTS)
    without = [
        np.linalg.lstsq(np.delete(columns, p, axis=0), np.delete(logged, p), rcond=None)[0][0]
        for p in parts
    ]
    sigma = float(np.std(without)) * math.sqrt(_PARTS - 1)
    scale = float(solved[0])
    lag = float(solved[1]) / scale if scale else math.inf
    slowed = (lag * float(np.std(columns[:, 1]) / np.std(columns[:, 0]))) ** 2
    if abs(scale - 1.0) > max(_SCALE_IN_MOTION, _CERTAIN * sigma, _SLOWED * slowed):
        return scale
    return None


def _line(demand: FloatArray, actual: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Slope and offset of a line, and their standard deviations; infinite for too few points."""
    columns = np.column_stack((demand, np.ones(len(demand))))
    if len(demand) < _FEWEST:
        return np.array([1.0, 0.0]), np.full(2, np.inf)
    line = np.linalg.lstsq(columns, actual, rcond=None)[0]
    variance = float(np.square(actual - columns @ line).sum()) / (len(demand) - 2)
    sigmas = np.sqrt(variance * np.diag(np.linalg.inv(columns.T @ columns)))
    return np.asarray(line), np.asarray(sigmas)


def _names(axis: AxisSettings) -> dict[float, str]:
    """Factor -> unit of a length, or of an angle."""
    return _ANGLES if axis.rotary else _NAMES


def match_unit(
    factor: float, more: Mapping[float, str] | None = None, close: float = _CLOSE
) -> float | None:
    """The factor of a unit (1000, 1e-6, ..., a key of `more`) near to this one, with its sign."""
    for candidate in (*(more or {}), *_POWERS):
        if candidate != 1.0 and abs(abs(factor) / candidate - 1.0) < close:
            return math.copysign(candidate, factor)
    return None


def check_quantisation(signals: AxisSignals, axis: AxisSettings) -> list[ChannelFinding]:
    """Position and force that are logged more coarsely than encoder and drive report them."""
    found = []
    for signal, grid in coarse_steps(signals, axis).items():
        channel, step = f"{signal}_actual", stated_step(axis, signal)
        unit = axis.unit_of(SIGNALS[signal])
        words = f"comes in steps of {grid:.3g} {unit}, not {step:.3g}"
        found.append(note(axis.name, channel, "quantisation", grid, words, unit))
    return found


def check_saturation(
    signals: AxisSignals, axis: AxisSettings, commanded: FloatArray, usable: BoolArray
) -> list[ChannelFinding]:
    """Share of the samples at which the drive is at its force limit.

    Args:
        signals: of the axis.
        axis: its settings.
        commanded: force that the controller law asks for, unclamped, float64[K] [N].
        usable: bool[K], where that is known.
    """
    force = np.abs(signals.force_actual)
    peak = axis.control.peak_force
    limit = float(force[signals.valid].max(initial=0.0))
    unit = axis.control.rated_force / 1000.0
    full = signals.valid & (force >= _FULL * peak)
    if not full.any():
        wanted = np.abs(commanded) > limit + 5.0 * unit
        full = signals.valid & usable & (force >= limit - 0.6 * unit) & wanted
        if full.sum() < _PLATEAU or (force[wanted & usable] < 0.9 * limit).any():
            return []
    duty, newtons = float(full.sum() / signals.valid.sum()), axis.unit_of("N")
    text = (
        f"{axis.name}: the force is at its limit of {limit:.3g} {newtons} in {100 * duty:.2g} % of "
        f"the samples (peak_force {peak:g} {newtons})"
    )
    return [ChannelFinding(axis.name, "force_actual", "saturation", duty, "1", text=text)]
