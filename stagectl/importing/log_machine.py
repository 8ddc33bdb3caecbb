"""The machine file of a log: what it leaves out is taken from the log.

Whoever has the log of some machine need not know its bus, drive, limits or encoder. What scales the
search for effects (travel, speeds, the size of forces) is in the log; nothing else of these matters
where no controller is simulated.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from pydantic import TypeAdapter
from scipy.signal import savgol_filter

from sim2real.gap import quantisation_step
from stagectl.config.machine import NO_BUS, Homing, Machine, position_unit_for
from stagectl.config.machine.file import load_machine, parse_machine
from stagectl.config.machine.unknown import UNKNOWN
from stagectl.config.parsing.units import PositiveTime
from stagectl.config.parsing.yaml_nodes import load_document
from stagectl.errors import UnusableInput
from stagedata import AxisSignals, FloatArray, Recording

_COMPLETED = "# Completed from a log."
_PERIOD = TypeAdapter(PositiveTime)
_SECTIONS = ("travel", "limits", "encoder", "drive", "plant")
_BUS = ("interface", "channel", "bitrate", "sync_period")
_ANY_PERIOD = 1e-3
SPARSE = 1.5
"""Periods between samples beyond which resampling would invent samples."""
_SMOOTHED = 11
"""Samples over which positions are differentiated."""
_MARGIN = 0.02
"""Travel beyond what was logged, as a share of it."""
_BANDWIDTH = 500.0
"""Of a current loop that nothing is known of [Hz]."""
_SLOWEST_TICK = 1e-3
"""Longest control period that is assumed [s]."""
_USUAL = 0.999
"""Share of the samples whose speeds and accelerations count."""
_ACCELERATION_UNIT = 1e-3
"""Of a drive that nothing is known of [m/s^2]: robots exceed the range of the usual one."""
_TOLERANCE = 0.02
"""Of figures of the plant that are given without one."""
_FINEST = 1e-6
"""Increment where a log shows none, as a share of the travel."""


def load_log_machine(path: Path) -> Machine:
    """The machine of the file at `path`, with any figures in place of what a log will say.

    Its document is the file as it is.

    Raises:
        ConfigError: the file cannot be used; one line per problem.
    """
    document = load_document(path)
    data: Any = document.data
    if not _has_axes(data) or is_complete(data):
        return parse_machine(document.text, document.name, fitted=True)
    still = np.array([0.0, 1.0])
    signals = AxisSignals(still, still, still, still, None, still > -1.0)
    machine = _parsed(data, {axis: [signals] for axis in data["axes"]}, _ANY_PERIOD, str(path))
    machine.attach(document, machine.unknown)
    return machine


def _has_axes(data: Any) -> bool:
    """Whether a machine file names axes, whatever it says of them."""
    axes: Any = data.get("axes") if isinstance(data, dict) else None
    return isinstance(axes, dict) and all(a is None or isinstance(a, dict) for a in axes.values())


def is_complete(data: Any) -> bool:
    """Whether a machine file says all that a stage needs."""
    axes, bus = data["axes"].values(), data.get("bus")
    has_bus = "bus" in data and (not isinstance(bus, dict) or set(_BUS) <= set(bus))
    return has_bus and all(axis and set(_SECTIONS) <= set(axis) for axis in axes)


def load_machine_of(path: Path, logs: Sequence[Recording]) -> Machine:
    """The machine of a file; what it leaves out is taken from the logs that are fitted together.

    Args:
        path: of the file.
        logs: recordings that were imported, or others: these need a file that says all.

    Raises:
        ConfigError: the file cannot be used; one line per problem.
        UnusableInput: it leaves something out, and a log has other axes.
    """
    given: Any = load_document(path).data
    is_of_logs = all(log.machine.startswith(_COMPLETED) for log in logs)
    if not is_of_logs or not _has_axes(given) or is_complete(given):
        return load_machine(path, fitted=True)
    load_log_machine(path)  # names what is wrong by the lines of the file
    for log in logs:
        if set(log.axes) != set(given["axes"]):
            own, other = (", ".join(sorted(axes)) for axes in (given["axes"], log.axes))
            raise UnusableInput(f"{path}: has axes {own}, {log.source} {other}")
    return completed(given, logs, own_period(logs[0].time, logs[0].source))


def own_period(time: FloatArray, name: str) -> float:
    """Distance of the samples, holes left out [s].

    Args:
        time: of the samples, float64[K] [s].
        name: of their file.

    Raises:
        UnusableInput: there are fewer than two.
    """
    steps = np.diff(time)
    if not len(steps):
        raise UnusableInput(f"{name}: {len(time)} samples")
    usual = steps[steps < SPARSE * np.median(steps)]
    return float(f"{float(usual.mean() if len(usual) else steps[0]):.7g}")


def completed(given: Any, recordings: Sequence[Recording], period: float) -> Machine:
    """The machine of a file with what it leaves out as recordings have it.

    Args:
        given: values of the file.
        recordings: of its machine.
        period: of the samples [s].

    Raises:
        ConfigError: what the file says does not go with the log; one line per problem.
    """
    signals = {axis: [own.axes[axis] for own in recordings] for axis in given["axes"]}
    return _parsed(given, signals, period, f"{recordings[0].source}: the machine file")


def _parsed(
    given: Any, signals: Mapping[str, Sequence[AxisSignals]], period: float, name: str
) -> Machine:
    bus = {"interface": NO_BUS, "channel": "log", "bitrate": 1_000_000, "sync_period": period}
    data = copy.deepcopy(given)
    own_bus = data.get("bus") or {}
    if isinstance(own_bus, dict):  # of another kind it is refused below
        data["bus"] = bus | own_bus
        period = stated_period(given) or period
    for number, (axis, own) in enumerate(data["axes"].items(), start=1):
        data["axes"][axis] = _axis(own or {}, number, signals[axis], period)
    text = yaml.safe_dump(data, sort_keys=False, allow_unicode=True, width=100)
    return parse_machine(f"{_COMPLETED}\n{text}", name, fitted=True)


def stated_period(data: Any) -> float | None:
    """The SYNC period that a machine file states [s]; None where it states none, or no time."""
    bus: Any = data.get("bus") if isinstance(data, dict) else None
    try:
        return float(_PERIOD.validate_python(bus["sync_period"]))
    except (KeyError, TypeError, ValueError):
        return None


def _axis(given: Any, number: int, signals: Sequence[AxisSignals], period: float) -> dict[str, Any]:
    """An axis of a machine file with what it leaves out as its signals have it."""
    positions = [own.position_actual for own in signals]
    low, high = min(float(p.min()) for p in positions), max(float(p.max()) for p in positions)
    span = (high - low) or 1.0
    speed, rate = (
        max(_largest_rate(p, order, period) for p in positions) or 1.0 for order in (1, 2)
    )
    force = max(float(np.abs(own.force_actual).max()) for own in signals) or 1.0
    increment = min(quantisation_step(p) or _FINEST * span for p in positions)
    velocity, acceleration = _rounded(1.2 * speed), _rounded(1.5 * rate)
    reach = max(abs(low), abs(high)) + _MARGIN * span
    own = given.get("drive") or {}
    drive: dict[str, Any] = {
        "rated_force": own.get("peak_force", _rounded(force)),
        "peak_force": own.get("rated_force", _rounded(2.0 * force)),
        "current_bandwidth": _BANDWIDTH,
        "control_period": period / math.ceil(period / _SLOWEST_TICK - 1e-9),
        "position_unit": position_unit_for(max(reach, velocity)),
        "acceleration_unit": _ACCELERATION_UNIT,
    }
    drive |= own
    if not {"pid", "cascade"} & set(drive):
        drive["pid"] = UNKNOWN
    plant = {"tolerance": _TOLERANCE, "mass": UNKNOWN, "friction": UNKNOWN}
    left_out = {
        "node": number,
        "travel": [_rounded(low - _MARGIN * span), _rounded(high + _MARGIN * span)],
        "limits": {
            "velocity": velocity,
            "acceleration": acceleration,
            "jerk": _rounded(100.0 * acceleration),
            "following_error": _rounded(0.1 * span),
            "position_window": _rounded(1e-3 * span),
        },
        "encoder": {"increment": increment, "noise": 0.0},
        "homing": {
            "velocity": min(velocity, Homing().velocity),
            "index_velocity": min(velocity, Homing().index_velocity),
        },
    }
    return {**left_out, **given, "drive": drive, "plant": plant | (given.get("plant") or {})}


def _largest_rate(position: FloatArray, order: int, period: float) -> float:
    """The largest derivative of this order of a position, single outliers left out."""
    window = min(_SMOOTHED, len(position) - 1 + len(position) % 2)
    if window <= 2:
        return 0.0
    rate = savgol_filter(position, window, 2, deriv=order, delta=period)
    return float(np.quantile(np.abs(rate), _USUAL))


def _rounded(value: float) -> float:
    return float(f"{value:.4g}")
