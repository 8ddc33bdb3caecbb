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
    rest_of_scale,
)
from sim2real.audit.signal_checks import (
    check_constant,
    check_demand_units,
    check_position,
    check_quantisation,
    check_saturation,
    check_time,
    match_unit,
    note,
    scale_finding,
)
from sim2real.findings import ChannelFinding
from sim2real.gap import number_periods, prepare_replay, run_by_model
from stagedata import Recording

MISLEADING = (
    "units", "sign", "scale", "offset", "delay", "clock", "controller_kp", "controller_ki",
    "controller_kd", "constant", "controller_unknown",
)  # fmt: skip
"""Findings that would pass for physics: unless they are corrected for, there is no diagnosis."""
_CHANNELS = {
    "lag": "force_actual",
    "resampled": "force_actual",
    "position": "position_actual",
    "demand": "position_demand",
}
"""Which channel is late, by the timing of the law."""
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
    audit = _Corrected(recording, settings)
    audit.take(check_time(recording.time, settings.sync_period))
    for finding in audit.findings:
        if finding.finding == "units" and finding.value:
            audit.recording = replace(recording, time=recording.time / finding.value)
            audit.take(check_time(audit.recording.time, settings.sync_period))
            break
    if any(f.finding in ("clock", "jitter") for f in audit.findings):
        time = audit.recording.time
        place = number_periods(time, float(np.median(np.diff(time))))
        on_time = np.asarray(place * settings.sync_period, dtype=np.float64)
        audit.recording = replace(audit.recording, time=on_time)
    for axis in settings.axes:
        if axis.name in recording.axes:
            audit.take(check_constant(audit.recording.axes[axis.name], axis))
            audit.take(check_demand_units(audit.recording.axes[axis.name], axis))
            for _ in range(2):  # a wrong unit or sign may hide a scale or an offset
                signals = audit.recording.axes[axis.name]
                audit.take(check_position(signals, axis, settings.sync_period))
    audit.take(_check_force_units(audit.recording, settings))
    for axis in settings.axes:
        audit.take(check_quantisation(audit.recording.axes[axis.name], axis))
    dead = {f.axis for f in audit.findings if f.finding == "constant"}
    for axis in settings.axes:
        if axis.name not in dead:
            audit.refine_scale(axis)
    expected = _expected_remainders(audit.recording, settings)
    for axis in settings.axes:
        if axis.name not in dead:
            audit.check_law(axis, expected[axis.name])
            law, signals = audit.law(axis), audit.recording.axes[axis.name]
            audit.take(check_saturation(signals, axis, law.terms().sum(axis=0), law.usable))
    return Audit(tuple(audit.findings), audit.recording, audit.settings, audit.current_paths)


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
    late = "late" if delay > 0 else "early"
    words = f"is {abs(delay) * 1e3:.3g} ms ({abs(delay / period):.3g} samples) {late}"
    return note(axis, channel, "delay", delay, words, "s")


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
            name = names.get(abs(unit), f"units of {1 / abs(unit):g} {axis.unit_of('N')}")
            sign = " with the wrong sign" if unit < 0 else ""
            words = f"is in {name}{sign}, not in {axis.unit_of('newtons')}"
            found.append(note(axis.name, "force_actual", "units", unit, words))
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


class _Corrected:
    """A recording and settings with everything corrected that was found so far.

    Attributes:
        findings, recording, settings, current_paths: as in `Audit`.
    """

    def __init__(self, recording: Recording, settings: StageSettings) -> None:
        self.recording = recording
        self.settings = settings
        self.findings: list[ChannelFinding] = []
        self.current_paths: dict[str, CurrentPath] = {}

    def take(self, findings: list[ChannelFinding]) -> None:
        """Add findings, and correct for units, signs, scales and offsets."""
        self.findings += findings
        self.recording = rescale(self.recording, findings)

    def law(self, axis: AxisSettings) -> ControllerLaw:
        """The controller of an axis."""
        replay = prepare_replay(self.recording, self.settings)
        return reconstruct_law(replay, self.settings, axis.name)

    def refine_scale(self, axis: AxisSettings) -> None:
        """Make a scale of the position exact that was found without rests, by the law."""
        for place, finding in enumerate(self.findings):
            if (finding.axis, finding.channel, finding.finding) == (
                axis.name, "position_actual", "scale",
            ):  # fmt: skip
                rest = rest_of_scale(self.law(axis))
                value = rest * (finding.value or 1.0)
                self.findings[place] = scale_finding(axis, value)
                self.recording = rescale(self.recording, [scale_finding(axis, rest)])

    def check_law(self, axis: AxisSettings, expected: float) -> None:
        """Check an axis against its controller's law.

        Args:
            axis: of the machine file.
            expected: what the law leaves on the model's own noisy run, rms [N].
        """
        law, name, unit = self.law(axis), axis.name, axis.unit_of("N")
        if law.usable.sum() < _MIN_SAMPLES:
            return
        found = find_hypothesis(law, expected)
        kind, text = "controller", ""
        if (wrong := _why_unusable(found, law, axis)) is not None:
            kind = "controller_unknown"
            text = f"{name}: the force is not that of the machine file's controller: {wrong}"
        else:
            self._correct_timing(found, law, name)
            self._correct_gains(found, name, unit)
            if found.remainder > _REMAINDER * ACCEPTED * expected:
                text = (
                    f"{name}: the force does not match the machine file's controller: "
                    f"{found.remainder:.3g} {unit} rms remain ({expected:.2g} {unit} expected)"
                )
        if text:
            rest = found.remainder
            self.take([ChannelFinding(name, "force_actual", kind, rest, unit, text=text)])

    def _correct_timing(self, found: LawHypothesis, law: ControllerLaw, axis: str) -> None:
        value, period = found.value, self.settings.sync_period
        if found.timing == "bandwidth":
            self.current_paths[axis] = CurrentPath(None, value)
        elif found.timing == "drift":
            words = f"runs {value * 1e6:+.0f} ppm against the setpoints"
            self.take([note(axis, "position_actual", "clock", value, words)])
            self.recording = shift_channel(
                self.recording, axis, "position_actual", lambda t: t * (1.0 + value)
            )
        elif found.timing and abs(value) > _SMALLEST_DELAY:
            channel, delay = _CHANNELS[found.timing], value
            if found.timing == "lag":
                delay = log_lateness(law, value)
                dead_time = value - delay
                if dead_time > _SMALLEST_DELAY or found.bandwidth is not None:
                    path = CurrentPath(law.dead_time + dead_time, found.bandwidth)
                    self.current_paths[axis] = path
            if abs(delay) > _SMALLEST_DELAY:
                self.take([delay_finding(axis, channel, delay, period)])
                self.recording = remove_delay(self.recording, axis, channel, delay, period)

    def _correct_gains(self, found: LawHypothesis, axis: str, unit: str) -> None:
        if found.gains == "scale":
            self.take([_factor_finding(axis, "force_actual", found.factors[0], unit)])
            return
        for term, factor in zip(TERMS, found.factors, strict=True):
            if abs(factor - 1.0) < _GAIN_TOLERANCE:
                continue
            if term != "force_offset":
                text = f"{axis}: the drive's {term} is {factor:.4g} times the machine file's"
                kind = f"controller_{term}"
                self.take([ChannelFinding(axis, "force_actual", kind, factor, "1", text=text)])
                self.settings = scale_gain(self.settings, axis, term, factor)
            elif abs(factor) <= 1e-3:
                self.take([note(axis, term, "scale", 0.0, "is not applied by the drive")])
            else:  # a part with a factor of two was logged at half its size
                self.take([_factor_finding(axis, term, 1.0 / factor, unit)])


def _why_unusable(found: LawHypothesis, law: ControllerLaw, axis: AxisSettings) -> str | None:
    """Why no figure of the controller can be taken from a hypothesis, or None.

    It leaves most of the force, or needs a gain that no stable loop has.
    """
    force = float(np.std(law.force[law.usable]))
    if found.gains == "scale":
        force /= abs(found.factors[0])
    if found.remainder > _MOST * force:
        return f"its law leaves {found.remainder:.3g} of {force:.3g} {axis.unit_of('N')} rms"
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


def _factor_finding(axis: str, channel: str, factor: float, unit: str) -> ChannelFinding:
    """A channel that is scaled by a factor, or in another unit than `unit`."""
    known = match_unit(factor)
    if known is not None:
        sign = " with the wrong sign" if known < 0 else ""
        words = f"is in units of {1 / abs(known):g} {unit}{sign}"
        return note(axis, channel, "units", known, words)
    if abs(factor + 1.0) < _GAIN_TOLERANCE:
        return note(axis, channel, "sign", -1.0, "has the wrong sign")
    return note(axis, channel, "scale", factor, f"is scaled by {factor:.4g}")
