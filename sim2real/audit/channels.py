"""The channels before any physics: does the log mean what the machine file says it means?

Time axis, units, signs, scales, grids and saturation from the numbers alone
(`sim2real.plain_checks`); delays, the force's scale and the controller from the logged force
against the controller's law (`sim2real.law`, `sim2real.law_fit`). What is found is corrected for at
once inside the audit, so that one fault does not hide another; whether the caller goes on with the
corrected recording is the caller's choice. Dead time and current bandwidth are the stage's own and
are no findings: they are passed on as they were measured.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from hil_sim.settings import StageSettings
from sim2real.audit.controller_law import TERMS, law_of
from sim2real.audit.law_hypotheses import ACCEPTED, Supposition, explain, log_is_late, suppose
from sim2real.audit.signal_checks import (
    constant,
    demand_units,
    grid_of,
    grids,
    position_against_demand,
    saturation,
    time_axis,
    unit_factor,
)
from sim2real.gap import periods, prepare
from sim2real.recording import AxisSignals, BoolArray, FloatArray, Recording
from sim2real.report import ChannelFinding

MISLEADING = (
    "units", "sign", "scale", "offset", "delay", "clock", "controller_kp", "controller_ki",
    "controller_kd", "constant",
)  # fmt: skip
"""Findings that would pass for physics: they are corrected for, or there is no diagnosis."""
BEYOND = ("constant",)
"""Findings that nothing can be done about."""
_SMALLEST = 1e-6
"""Shortest delay that is told [s]; what the law resolves is about a tenth of it."""
_FACTOR = 2e-3
"""A gain this near to 1 is as the machine file says."""
_SEED = 1
_FEWEST = 200
"""Samples at which the law must be known to be held against the log."""
_REMAINDER = 3.0
_GROSS = np.log(5.0)
"""A force larger or smaller than the model's by this factor may be in another unit."""


@dataclass(frozen=True, slots=True)
class CurrentPath:
    """What lies between the controller's output and the reported force, where not as stated.

    Attributes:
        dead_time: [s], None where it is the machine file's.
        bandwidth: of the current loop [Hz], None where it is the machine file's.
    """

    dead_time: float | None
    bandwidth: float | None


@dataclass(frozen=True, slots=True, eq=False)
class Audit:
    """What is wrong with the channels of a recording.

    Attributes:
        findings: none applied.
        recording, settings: with all that can be corrected corrected.
        path: axis -> current path, where it differs from the machine file's.
    """

    findings: tuple[ChannelFinding, ...]
    recording: Recording
    settings: StageSettings
    path: dict[str, CurrentPath]

    @property
    def misleading(self) -> tuple[ChannelFinding, ...]:
        """Findings without whose correction physics would be blamed for them."""
        return tuple(f for f in self.findings if f.finding in MISLEADING)


def audit(recording: Recording, settings: StageSettings) -> Audit:
    """Look through the channels of a recording.

    Args:
        recording: as logged.
        settings: of the machine file it is held against.

    Raises:
        ValueError: the recording does not fit the machine file at all (axes, SYNC period).
    """
    findings = time_axis(recording.time, settings.sync_period)
    for finding in findings:
        if finding.finding == "units" and finding.value:
            recording = replace(recording, time=recording.time / finding.value)
            findings += time_axis(recording.time, settings.sync_period)
            break
    if any(f.finding in ("clock", "jitter") for f in findings):
        place = periods(recording.time, float(np.median(np.diff(recording.time))))
        on_time = np.asarray(place * settings.sync_period, dtype=np.float64)
        recording = replace(recording, time=on_time)
    for axis in settings.axes:
        if axis.name not in recording.axes:
            continue
        findings += constant(recording.axes[axis.name], axis)
        found = demand_units(recording.axes[axis.name], axis)
        findings += found
        recording = _rescaled(recording, found)
        for _ in range(2):  # behind a factor of units or sign there may be a scale or an offset
            signals = recording.axes[axis.name]
            found = position_against_demand(signals, axis, settings.sync_period)
            findings += found
            recording = _rescaled(recording, found)
    findings += (units := _force_units(recording, settings))
    recording = _rescaled(recording, units)
    for axis in settings.axes:
        findings += grids(recording.axes[axis.name], axis)
    path: dict[str, CurrentPath] = {}
    dead = {f.axis for f in findings if f.finding == "constant"}
    expected = _expected(recording, settings)
    for axis in settings.axes:
        if axis.name in dead:
            continue
        found, recording, settings, current = _law_findings(
            recording, settings, axis.name, expected[axis.name]
        )
        findings += found
        if current is not None:
            path[axis.name] = current
        law = law_of(prepare(recording, settings), settings, axis.name)
        signals = recording.axes[axis.name]
        findings += saturation(signals, axis, law.terms().sum(axis=0), law.usable)
    return Audit(tuple(findings), recording, settings, path)


def applied(findings: tuple[ChannelFinding, ...]) -> tuple[ChannelFinding, ...]:
    """The same findings, those that can be corrected marked as corrected."""
    return tuple(
        replace(f, applied=f.finding in (*MISLEADING, "jitter") and f.finding not in BEYOND)
        for f in findings
    )


def _force_units(recording: Recording, settings: StageSettings) -> list[ChannelFinding]:
    """Forces whose size is that of another unit, by the model's own over the same demands."""
    replay = prepare(recording, settings)
    run = replay.run(settings)
    found = []
    for axis in settings.axes:
        valid = replay.valid(axis.name)
        model = run[axis.name]["force"][valid]
        logged = recording.axes[axis.name].force_actual[valid]
        size = float(model @ model)
        factor = float(logged @ model) / size if size > 0 else 1.0
        if abs(np.log(abs(factor) or 1.0)) < _GROSS:
            continue
        per_mille = 1000.0 / axis.control.rated_force
        names = {per_mille: "1/1000 of the rated force", per_mille / 10: "% of the rated force"}
        unit = unit_factor(factor, names, 0.3)
        if unit is not None:
            name = names.get(abs(unit), f"units of {1 / abs(unit):g} N")
            sign = " with the wrong sign" if unit < 0 else ""
            text = f"{axis.name}: force_actual is in {name}{sign}, not in newtons"
            found.append(ChannelFinding(axis.name, "force_actual", "units", unit, "1", text=text))
    return found


def _expected(recording: Recording, settings: StageSettings) -> dict[str, float]:
    """What the law leaves on the model's own noisy run over these demands, rms [N] per axis.

    That run is rounded to the grids that the recording is on.
    """
    replay = prepare(recording, settings)
    run = replay.run(settings, _SEED)
    for name, signals in run.items():
        logged = replay.measured()[name]
        for signal, values in signals.items():
            grid = grid_of(logged[signal][replay.valid(name)])
            if grid is not None:
                run[name][signal] = np.rint(values / grid) * grid
    own = replace(
        recording,
        axes={
            name: replace(
                signals,
                position_actual=run[name]["position"],
                force_actual=run[name]["force"],
            )
            for name, signals in recording.axes.items()
        },
    )
    replay = prepare(own, settings)
    return {
        axis.name: max(
            suppose(law_of(replay, settings, axis.name)).left,
            axis.control.rated_force / 1000.0 / np.sqrt(12.0),
        )
        for axis in settings.axes
    }


def _law_findings(
    recording: Recording, settings: StageSettings, axis: str, expected: float
) -> tuple[list[ChannelFinding], Recording, StageSettings, CurrentPath | None]:
    """Findings of one axis from its controller's law; recording and settings put right."""
    law = law_of(prepare(recording, settings), settings, axis)
    if law.usable.sum() < _FEWEST:
        return [], recording, settings, None
    found = explain(law, expected)
    findings: list[ChannelFinding] = []
    current: CurrentPath | None = None
    channel = {
        "position": "position_actual", "demand": "position_demand", "resampled": "force_actual",
        "drift": "position_actual",
    }.get(found.timing, "")  # fmt: skip
    if found.timing == "lag" and abs(found.value) > _SMALLEST:
        if found.bandwidth is None and (found.value < 0 or log_is_late(law, found.value)):
            channel = "force_actual"
        else:
            current = CurrentPath(law.dead_time + found.value, found.bandwidth)
    elif found.timing == "bandwidth":
        current = CurrentPath(None, found.value)
    if found.timing == "drift":
        text = f"{axis}: position_actual runs {found.value * 1e6:+.0f} ppm against the setpoints"
        findings.append(ChannelFinding(axis, channel, "clock", found.value, "1", text=text))
        recording = _shifted(recording, axis, channel, lambda t: t * (1.0 + found.value))
    elif channel and abs(found.value) > _SMALLEST:
        samples = found.value / settings.sync_period
        text = (
            f"{axis}: {channel} is {abs(found.value) * 1e3:.3g} ms "
            f"({abs(samples):.3g} samples) {'late' if found.value > 0 else 'early'}"
        )
        findings.append(ChannelFinding(axis, channel, "delay", found.value, "s", text=text))
        recording = _undelayed(recording, axis, channel, found.value, settings.sync_period)
    gains, recording, settings = _gain_findings(found, recording, settings, axis)
    findings += gains
    if found.left > _REMAINDER * ACCEPTED * expected:
        text = (
            f"{axis}: the force is not what the controller of the machine file gives: "
            f"{found.left:.3g} N rms remain ({expected:.2g} N would)"
        )
        findings.append(
            ChannelFinding(axis, "force_actual", "controller", found.left, "N", text=text)
        )
    return findings, recording, settings, current


def _gain_findings(
    found: Supposition, recording: Recording, settings: StageSettings, axis: str
) -> tuple[list[ChannelFinding], Recording, StageSettings]:
    if found.gains == "scale":
        kind, value, text = _named_factor(found.factors[0])
        finding = ChannelFinding(
            axis, "force_actual", kind, value, "1", text=f"{axis}: force_actual {text}"
        )
        return [finding], _rescaled(recording, [finding]), settings
    findings = []
    for term, factor in zip(TERMS, found.factors, strict=True):
        if abs(factor - 1.0) < _FACTOR:
            continue
        if term == "force_offset":
            # A part that weighs twice was logged at half its size.
            logged = 1.0 / factor if abs(factor) > 1e-3 else 0.0
            if logged == 0.0:
                kind, value, text = "scale", 0.0, "is not applied by the drive"
            else:
                kind, value, text = _named_factor(logged)
            finding = ChannelFinding(
                axis, term, kind, value, "1", text=f"{axis}: force_offset {text}"
            )
            recording = _rescaled(recording, [finding])
        else:
            finding = ChannelFinding(
                axis, "force_actual", f"controller_{term}", factor, "1",
                text=f"{axis}: the drive's {term} is {factor:.4g} times the machine file's",
            )  # fmt: skip
            settings = _regained(settings, axis, term, factor)
        findings.append(finding)
    return findings, recording, settings


def _named_factor(factor: float) -> tuple[str, float, str]:
    known = unit_factor(factor)
    if known is not None:
        sign = " with the wrong sign" if known < 0 else ""
        return "units", known, f"is in units of {1 / abs(known):g} N{sign}"
    if abs(factor + 1.0) < _FACTOR:
        return "sign", -1.0, "has the wrong sign"
    return "scale", factor, f"is scaled by {factor:.4g}"


def _regained(settings: StageSettings, axis: str, term: str, factor: float) -> StageSettings:
    axes = tuple(
        replace(a, control=replace(a.control, **{term: getattr(a.control, term) * factor}))
        if a.name == axis and factor > 0
        else a
        for a in settings.axes
    )
    return replace(settings, axes=axes)


def _changed(recording: Recording, axis: str, **channels: FloatArray | BoolArray) -> Recording:
    signals: AxisSignals = replace(recording.axes[axis], **channels)  # type: ignore[arg-type]
    return replace(recording, axes={**recording.axes, axis: signals})


def _rescaled(recording: Recording, findings: list[ChannelFinding]) -> Recording:
    """Channels divided by the factors, and freed from the offsets, that were found."""
    for finding in findings:
        if finding.axis not in recording.axes or not finding.value:
            continue
        values = getattr(recording.axes[finding.axis], finding.channel)
        if finding.finding in ("units", "sign", "scale"):
            values = values / finding.value
        elif finding.finding == "offset":
            values = values - finding.value
        recording = _changed(recording, finding.axis, **{finding.channel: values})
        if finding.finding == "units" and finding.channel == "position_demand":
            recording = _rescaled_moves(recording, finding.axis, finding.value)
    return recording


def _rescaled_moves(recording: Recording, axis: str, factor: float) -> Recording:
    moves = tuple(
        replace(
            move,
            origin={**move.origin, axis: move.origin[axis] / factor},
            target={**move.target, axis: move.target[axis] / factor},
        )
        for move in recording.moves
    )
    return replace(recording, moves=moves)


def _undelayed(
    recording: Recording, axis: str, channel: str, delay: float, period: float
) -> Recording:
    """The channel moved back by its delay; samples that it has none for are no longer valid."""
    if channel == "position_demand":
        recording = _undelayed(recording, axis, "force_offset", delay, period)
        return _shifted(recording, axis, channel, lambda t: t - delay)
    if channel == "force_offset":
        return _shifted(recording, axis, channel, lambda t: t - delay)
    return _shifted(recording, axis, channel, lambda t: t + delay)


def _shifted(
    recording: Recording, axis: str, channel: str, at: Callable[[FloatArray], FloatArray]
) -> Recording:
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
    return _changed(recording, axis, **{channel: moved, "valid": valid})
