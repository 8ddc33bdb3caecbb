"""The audit of a recording's channels: do they mean what the machine file says?

Time axis, units, signs, scales, quantisation and saturation come from the numbers alone
(`sim2real.audit.signal_checks`); delays, the force's scale and the controller from the logged force
against the controller's law (`sim2real.audit.controller_law`, `law_hypotheses`). Each fault is
corrected inside the audit as soon as it is found, so that it does not hide the next; whether to
continue with the corrected recording is the caller's choice. Dead time and current bandwidth belong
to the stage and are not findings: they are returned as measured.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hil_sim.settings import AxisSettings, StageSettings
from sim2real.audit.controller_law import TERMS, ControllerLaw, reconstruct_law
from sim2real.audit.corrections import remove_delay, rescale, scale_gain, shift_channel
from sim2real.audit.law_hypotheses import (
    ACCEPTED,
    LawHypothesis,
    find_hypothesis,
    fit_hypothesis,
    log_lateness,
)
from sim2real.audit.signal_checks import (
    check_constant,
    check_demand_units,
    check_position,
    check_quantisation,
    check_saturation,
    check_time,
    match_unit,
)
from sim2real.axis_units import unit_on
from sim2real.findings import ChannelFinding
from sim2real.gap import number_periods, prepare_replay, run_by_model
from stagedata import Recording

MISLEADING = (
    "units", "sign", "scale", "offset", "delay", "clock", "controller_kp", "controller_ki",
    "controller_kd", "constant", "controller_unknown",
)  # fmt: skip
"""Findings that would pass for physics: unless they are corrected for, there is no diagnosis."""
UNCORRECTABLE = ("constant", "controller_unknown")
"""Findings that cannot be corrected for."""
_SMALLEST_DELAY = 1e-6
"""Shortest delay reported [s]; the law resolves about a tenth of it."""
_GAIN_TOLERANCE = 2e-3
"""A gain this near to 1 is as the machine file says."""
_SEED = 1
_MIN_SAMPLES = 200
"""Fewest samples at which the law must be computable for it to be compared with the log."""
_REMAINDER = 3.0
"""What the law leaves is reported from this many times what an accepted hypothesis may leave."""
_MOST = 0.5
"""Largest share of the logged force that the law may leave unexplained: beyond it, no figure of
the controller can be read from the recording."""
_OTHER_UNIT = np.log(5.0)
"""Logarithm of the ratio of logged to simulated force from which the unit may be another one."""


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
    """The faults of a recording's channels.

    Attributes:
        findings: none of them marked as applied.
        recording, settings: with everything corrected that can be.
        current_paths: axis -> current path, where it differs from the machine file's.
    """

    findings: tuple[ChannelFinding, ...]
    recording: Recording
    settings: StageSettings
    current_paths: dict[str, CurrentPath]

    @property
    def misleading(self) -> tuple[ChannelFinding, ...]:
        """Findings that physics would be blamed for if they were not corrected."""
        return tuple(f for f in self.findings if f.finding in MISLEADING)


def audit_channels(recording: Recording, settings: StageSettings) -> Audit:
    """Audit the channels of a recording.

    Args:
        recording: as logged.
        settings: of the machine file it is compared with.

    Raises:
        ValueError: the recording does not fit the machine file at all (axes, SYNC period).
    """
    findings = check_time(recording.time, settings.sync_period)
    for finding in findings:
        if finding.finding == "units" and finding.value:
            recording = replace(recording, time=recording.time / finding.value)
            findings += check_time(recording.time, settings.sync_period)
            break
    if any(f.finding in ("clock", "jitter") for f in findings):
        place = number_periods(recording.time, float(np.median(np.diff(recording.time))))
        on_time = np.asarray(place * settings.sync_period, dtype=np.float64)
        recording = replace(recording, time=on_time)
    for axis in settings.axes:
        if axis.name not in recording.axes:
            continue
        findings += check_constant(recording.axes[axis.name], axis)
        found = check_demand_units(recording.axes[axis.name], axis)
        findings += found
        recording = rescale(recording, found)
        for _ in range(2):  # a wrong unit or sign may hide a scale or an offset
            signals = recording.axes[axis.name]
            found = check_position(signals, axis, settings.sync_period)
            findings += found
            recording = rescale(recording, found)
    findings += (units := _check_force_units(recording, settings))
    recording = rescale(recording, units)
    for axis in settings.axes:
        findings += check_quantisation(recording.axes[axis.name], axis)
    current_paths: dict[str, CurrentPath] = {}
    dead = {f.axis for f in findings if f.finding == "constant"}
    expected = _expected_remainders(recording, settings)
    for axis in settings.axes:
        if axis.name in dead:
            continue
        found, recording, settings, current = _check_law(
            recording, settings, axis.name, expected[axis.name]
        )
        findings += found
        if current is not None:
            current_paths[axis.name] = current
        law = reconstruct_law(prepare_replay(recording, settings), settings, axis.name)
        signals = recording.axes[axis.name]
        findings += check_saturation(signals, axis, law.terms().sum(axis=0), law.usable)
    return Audit(tuple(findings), recording, settings, current_paths)


def mark_applied(findings: tuple[ChannelFinding, ...]) -> tuple[ChannelFinding, ...]:
    """The same findings, with those that can be corrected marked as corrected."""
    return tuple(
        replace(
            f,
            applied=f.applied
            or (f.finding in (*MISLEADING, "jitter") and f.finding not in UNCORRECTABLE),
        )
        for f in findings
    )


def delay_finding(axis: str, channel: str, delay: float, period: float) -> ChannelFinding:
    """A channel of an axis is late by a delay, or early [s]; `period` of the samples [s]."""
    text = (
        f"{axis}: {channel} is {abs(delay) * 1e3:.3g} ms "
        f"({abs(delay / period):.3g} samples) {'late' if delay > 0 else 'early'}"
    )
    return ChannelFinding(axis, channel, "delay", delay, "s", text=text)


def _check_force_units(recording: Recording, settings: StageSettings) -> list[ChannelFinding]:
    """Forces in another unit, judged by the model's own forces over the same demands."""
    replay = prepare_replay(recording, settings)
    run = replay.run(settings)
    found = []
    for axis in settings.axes:
        valid = replay.valid(axis.name)
        model = run[axis.name]["force"][valid]
        logged = recording.axes[axis.name].force_actual[valid]
        size = float(model @ model)
        factor = float(logged @ model) / size if size > 0 else 1.0
        if abs(np.log(abs(factor) or 1.0)) < _OTHER_UNIT:
            continue
        per_mille = 1000.0 / axis.control.rated_force
        names = {per_mille: "1/1000 of the rated force", per_mille / 10: "% of the rated force"}
        unit = match_unit(factor, names, 0.3)
        if unit is not None:
            own = unit_on(axis, "N")
            name = names.get(abs(unit), f"units of {1 / abs(unit):g} {own}")
            sign = " with the wrong sign" if unit < 0 else ""
            newtons = unit_on(axis, "newtons")
            text = f"{axis.name}: force_actual is in {name}{sign}, not in {newtons}"
            found.append(ChannelFinding(axis.name, "force_actual", "units", unit, "1", text=text))
    return found


def _expected_remainders(recording: Recording, settings: StageSettings) -> dict[str, float]:
    """What the law leaves on the model's own noisy run over these demands, rms [N] per axis.

    That run is rounded to the quantisation of the recording.
    """
    replay = run_by_model(prepare_replay(recording, settings), settings, _SEED)
    return {
        axis.name: max(
            fit_hypothesis(reconstruct_law(replay, settings, axis.name)).remainder,
            axis.control.rated_force / 1000.0 / np.sqrt(12.0),
        )
        for axis in settings.axes
    }


def _check_law(
    recording: Recording, settings: StageSettings, axis: str, expected: float
) -> tuple[list[ChannelFinding], Recording, StageSettings, CurrentPath | None]:
    """Check one axis against its controller's law: findings, and what is corrected for them.

    Args:
        recording: corrected for all findings so far.
        settings: likewise.
        axis: its name.
        expected: what the law leaves on the model's own noisy run, rms [N].

    Returns:
        Findings, recording, settings, and the current path where it differs from the file's.
    """
    law = reconstruct_law(prepare_replay(recording, settings), settings, axis)
    if law.usable.sum() < _MIN_SAMPLES:
        return [], recording, settings, None
    found = find_hypothesis(law, expected)
    own = next(a for a in settings.axes if a.name == axis)
    unit, wrong = unit_on(own, "N"), _why_unusable(found, law, own)
    if wrong is not None:
        text = f"{axis}: the force is not that of the machine file's controller: {wrong}"
        finding = ChannelFinding(
            axis, "force_actual", "controller_unknown", found.remainder, unit, text=text
        )
        return [finding], recording, settings, None
    findings: list[ChannelFinding] = []
    current: CurrentPath | None = None
    channel = {
        "position": "position_actual", "demand": "position_demand", "resampled": "force_actual",
        "drift": "position_actual",
    }.get(found.timing, "")  # fmt: skip
    delay = found.value
    if found.timing == "lag" and abs(delay) > _SMALLEST_DELAY:
        delay = log_lateness(law, found.value)
        channel = "force_actual"
        dead_time = found.value - delay
        if dead_time > _SMALLEST_DELAY or found.bandwidth is not None:
            current = CurrentPath(law.dead_time + dead_time, found.bandwidth)
    elif found.timing == "bandwidth":
        current = CurrentPath(None, found.value)
    if found.timing == "drift":
        text = f"{axis}: position_actual runs {found.value * 1e6:+.0f} ppm against the setpoints"
        findings.append(ChannelFinding(axis, channel, "clock", found.value, "1", text=text))
        recording = shift_channel(recording, axis, channel, lambda t: t * (1.0 + found.value))
    elif channel and abs(delay) > _SMALLEST_DELAY:
        findings.append(delay_finding(axis, channel, delay, settings.sync_period))
        recording = remove_delay(recording, axis, channel, delay, settings.sync_period)
    gains, recording, settings = _check_gains(found, recording, settings, axis, unit)
    findings += gains
    if found.remainder > _REMAINDER * ACCEPTED * expected:
        text = (
            f"{axis}: the force does not match the machine file's controller: "
            f"{found.remainder:.3g} {unit} rms remain ({expected:.2g} {unit} expected)"
        )
        findings.append(
            ChannelFinding(axis, "force_actual", "controller", found.remainder, unit, text=text)
        )
    return findings, recording, settings, current


def _why_unusable(found: LawHypothesis, law: ControllerLaw, axis: AxisSettings) -> str | None:
    """Why no figure of the controller can be taken from a hypothesis, or None.

    It leaves most of the force, or needs a gain that no stable loop has.
    """
    force = float(np.std(law.force[law.usable]))
    if found.gains == "scale":
        force /= abs(found.factors[0])
    if found.remainder > _MOST * force:
        return f"its law leaves {found.remainder:.3g} of {force:.3g} {unit_on(axis, 'N')} rms"
    if found.gains == "scale":
        return None
    control = axis.control
    factors = dict(zip(TERMS, found.factors, strict=True))
    negative = [
        f"{name} would be {factors[name]:.3g} times its own"
        for name in TERMS[:3]
        if factors[name] <= 0.0 and getattr(control, name) > 0.0
    ]
    if negative:
        return " and ".join(negative)
    kp, ki, kd = (factors[name] * getattr(control, name) for name in TERMS[:3])
    if (kd + axis.friction.viscous) * kp <= axis.mass * ki:  # Routh, of the rigid mass
        return f"with kp {kp:.3g}, ki {ki:.3g} and kd {kd:.3g} the loop would be unstable"
    return None


def _check_gains(
    found: LawHypothesis, recording: Recording, settings: StageSettings, axis: str, unit: str
) -> tuple[list[ChannelFinding], Recording, StageSettings]:
    """Findings about gains and scales, with recording and settings corrected for them.

    `unit` is that of the axis' force.
    """
    if found.gains == "scale":
        kind, value, text = _describe_factor(found.factors[0], unit)
        finding = ChannelFinding(
            axis, "force_actual", kind, value, "1", text=f"{axis}: force_actual {text}"
        )
        return [finding], rescale(recording, [finding]), settings
    findings = []
    for term, factor in zip(TERMS, found.factors, strict=True):
        if abs(factor - 1.0) < _GAIN_TOLERANCE:
            continue
        if term == "force_offset":
            # A part with a factor of two was logged at half its size.
            logged = 1.0 / factor if abs(factor) > 1e-3 else 0.0
            if logged == 0.0:
                kind, value, text = "scale", 0.0, "is not applied by the drive"
            else:
                kind, value, text = _describe_factor(logged, unit)
            finding = ChannelFinding(
                axis, term, kind, value, "1", text=f"{axis}: force_offset {text}"
            )
            recording = rescale(recording, [finding])
        else:
            finding = ChannelFinding(
                axis, "force_actual", f"controller_{term}", factor, "1",
                text=f"{axis}: the drive's {term} is {factor:.4g} times the machine file's",
            )  # fmt: skip
            settings = scale_gain(settings, axis, term, factor)
        findings.append(finding)
    return findings, recording, settings


def _describe_factor(factor: float, unit: str) -> tuple[str, float, str]:
    """Kind of finding, its value and its wording for a channel scaled by a factor."""
    known = match_unit(factor)
    if known is not None:
        sign = " with the wrong sign" if known < 0 else ""
        return "units", known, f"is in units of {1 / abs(known):g} {unit}{sign}"
    if abs(factor + 1.0) < _GAIN_TOLERANCE:
        return "sign", -1.0, "has the wrong sign"
    return "scale", factor, f"is scaled by {factor:.4g}"
