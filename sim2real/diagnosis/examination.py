"""Examination before any effect is suspected: channels, floor, gap and its location.

Also whether the recordings can support a diagnosis at all.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TypeVar

import numpy as np

from hil_sim.settings import StageSettings
from sim2real.audit import (
    UNCORRECTABLE,
    audit_channels,
    check_quantisation,
    check_time,
    mark_applied,
    repair_samples,
)
from sim2real.diagnosis.clock import Clock, find_common_clock
from sim2real.diagnosis.motion_channels import audit_motion
from sim2real.findings import (
    CLOSED_LOOP,
    INSUFFICIENT,
    OPEN_LOOP,
    SHORTEST,
    UNEXPLAINED,
    ChannelFinding,
    GapReport,
)
from sim2real.gap import (
    Gap,
    Located,
    Measured,
    combined_floors,
    compare_with_model,
    locate_gap,
    pool_gaps,
)
from sim2real.open_loop import Motion, compare_along, fit_figures, measure_motion
from sim2real.phases import split_moves
from sim2real.tracking import require_presliding
from stagedata import Recording

SLOWEST = 0.01
"""Longest sample period at which a diagnosis is attempted [s]: friction and loops are faster."""
_FEWEST_MOVES = 2
_FEWEST_STROKES = 4
"""Fewest strokes along a motion: two for each half of the recording, as rests carry no
information."""
_SLOWEST_MOTION = 0.1
"""Longest sample period at which forces are compared along a motion [s]: fine enough for the
accelerations of strokes that last seconds."""
OTHER_CONTROLLER = "the controller is not the machine file's"
"""Why the closed loop is not simulated where its law does not explain the force."""
GAINS = "gains"
"""Name of the controller's gains among what a machine file leaves unknown."""
_FEWEST_VALID = 0.5
_EXCITED = 1e-6
_LARGEST = 1e15
"""No position or force is larger, in whatever unit."""
_CORRECT = "correct it first, or continue with --correct"
"""What to do about a finding that can be corrected for."""
_T = TypeVar("_T")
Progress = Callable[[str, int, int], object]
"""Called with (what is being done, steps done, all steps)."""
PHASES = ("channels", "floor and gap", "where", "effects", "curves", "held-out moves")
"""What is being done, in order."""


@dataclass(frozen=True, slots=True, eq=False)
class Examination:
    """Result of the examination.

    Attributes:
        recordings: by name.
        findings: of all recordings; those corrected for are marked as applied.
        insufficient: why there can be no diagnosis, None where there can.
        settings: of the machine file, corrected by the audit where correction was asked for.
        measured: gap of each recording, corrected likewise; empty where it cannot be measured,
            which makes the recordings insufficient.
        gap: of all recordings together; None where it cannot be measured.
        located: where it lies; None where it cannot be measured.
        open_loop: why forces are compared along the measured motion; None where the closed loop is
            simulated. Then gap and residual are those of the force alone.
        motions: of the recordings, in the open loop.
        unknown: axis -> figures that the machine file leaves unknown; `settings` has them as found.
        clock: of the recordings.
    """

    recordings: tuple[str, ...]
    findings: tuple[ChannelFinding, ...]
    insufficient: str | None
    settings: StageSettings
    measured: tuple[Measured, ...] = ()
    gap: Gap | None = None
    located: Located | None = None
    open_loop: str | None = None
    motions: tuple[Motion, ...] = ()
    unknown: Mapping[str, Sequence[str]] = field(default_factory=dict)
    clock: Clock = field(default=Clock(()))


def examine(
    recordings: Sequence[Recording],
    settings: StageSettings,
    *,
    correct: bool = False,
    unknown: Mapping[str, Sequence[str]] | None = None,
    clock: Clock | None = None,
    open_loop: str | None = None,
    progress: Progress = lambda *_: None,
) -> Examination:
    """Examine recordings of one stage: channels, floor, gap, its location (long: in this order).

    Args:
        recordings: at least one.
        settings: of the machine file.
        correct: continue with corrected channels instead of giving up.
        unknown: axis -> what the machine file leaves unknown, keys of `open_loop.FIGURES` or
            `GAINS`; the settings have any values there.
        clock: of the recordings; None: their own.
        open_loop: why forces are to be compared along the motion; None: as the recordings need it.
        progress: called along the way.

    Raises:
        ValueError: a recording does not fit the machine file; with the recording's name. Or a
            friction law that cannot be tracked, with the axis.
    """
    unknown = unknown or {}
    open_loop = open_loop or why_open_loop(recordings, unknown)
    if open_loop is None:
        require_presliding(settings)
    names = tuple(r.source for r in recordings)
    clock = find_common_clock(recordings) if clock is None else clock
    repairs = [repair_samples(recording, settings) for recording in recordings]
    recordings = [recording for recording, _ in repairs]
    settings = _reaching(settings, recordings)
    repaired = [findings for _, findings in repairs]
    examined = Examination(
        names, _merge_findings(repaired), None, settings,
        open_loop=open_loop, unknown=unknown, clock=clock,
    )  # fmt: skip
    if open_loop is not None:
        return examine_motion(examined, recordings, correct=correct)
    for recording in recordings:
        reason = why_insufficient(recording, settings)
        if reason is not None:
            reason = _name_recording(recording, recordings, reason)
            return _with_gap(replace(examined, insufficient=reason), recordings, progress)
    return _examine_channels(examined, recordings, repaired, correct, progress)


def _reaching(settings: StageSettings, recordings: Sequence[Recording]) -> StageSettings:
    """The settings with travels that cover where recordings have been."""
    axes = settings.axes
    for recording in recordings:
        axes = tuple(
            axis.reaching(own.position_actual[own.valid])
            if (own := recording.axes.get(axis.name)) is not None and own.valid.any()
            else axis
            for axis in axes
        )
    return replace(settings, axes=axes)


def _examine_channels(
    examined: Examination,
    recordings: Sequence[Recording],
    repaired: Sequence[Sequence[ChannelFinding]],
    correct: bool,
    progress: Progress,
) -> Examination:
    """Audit the channels and measure the gap.

    The gap is that of the closed loop, or of the force along the motion where the controller is not
    that of the machine file.

    Args:
        examined: so far.
        recordings: repaired.
        repaired: findings of that, one list per recording.
        correct: continue with corrected channels instead of giving up.
        progress: called along the way.
    """
    audits, settings = [], examined.settings
    for number, recording in enumerate(recordings):
        progress("channels", number, len(recordings))
        audits.append(_name_errors(recording, lambda r: audit_channels(r, settings)))
    progress("channels", len(recordings), len(recordings))
    findings = _merge_findings([*repaired, *(list(audit.findings) for audit in audits)])
    misleading = [f for a in audits for f in a.misleading]
    beyond = [f for f in misleading if f.finding in UNCORRECTABLE]
    only = {f.finding for f in misleading} == {"controller_unknown"}
    if only or (correct and {f.finding for f in beyond} == {"controller_unknown"}):
        recordings = [a.recording for a in audits] if correct else recordings
        findings = mark_applied(findings) if correct else findings
        return examine_motion(
            replace(examined, findings=findings, open_loop=OTHER_CONTROLLER),
            recordings,
            correct=correct,
        )
    if beyond or (misleading and not correct):
        worst = (beyond or misleading)[0]
        way = _CORRECT if worst.finding not in UNCORRECTABLE else "no diagnosis is possible"
        reason = f"{worst.text}; {way}"
        given_up = replace(examined, findings=findings, insufficient=reason)
        return _with_gap(given_up, recordings, progress)
    if correct:
        findings = mark_applied(findings)
        recordings = [a.recording for a in audits]
        settings = audits[0].settings
    done = replace(examined, findings=findings, settings=settings)
    return _with_gap(done, recordings, progress)


def _with_gap(
    examined: Examination, recordings: Sequence[Recording], progress: Progress
) -> Examination:
    """The examination with gap, floor and location.

    Without them where they cannot be measured and the recordings are insufficient anyway.
    """
    settings, measured = examined.settings, []
    for number, (recording, start) in enumerate(
        zip(recordings, examined.clock.starts, strict=True)
    ):

        def simulated(done: int, draws: int, before: int = number) -> None:
            progress("floor and gap", before * draws + done, len(recordings) * draws)

        stage = replace(settings, start=start)
        compare = partial(compare_with_model, settings=stage, progress=simulated)
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                compared = _name_errors(recording, compare)
        except ValueError:
            if examined.insufficient is None:
                raise
            return examined
        measured.append(compared)
    gap = pool_gaps([(m.gap, len(m.replay.recording)) for m in measured])
    if examined.insufficient is not None and not _is_finite(gap):
        return examined
    progress("where", 0, 1)
    ratio = settings.control_period / settings.sync_period
    located = locate_gap(measured, ratio)
    return replace(examined, measured=tuple(measured), gap=gap, located=located)


def why_open_loop(
    recordings: Sequence[Recording], unknown: Mapping[str, Sequence[str]]
) -> str | None:
    """Why the closed loop cannot be simulated, known before any data are looked at; or None."""
    for recording in recordings:
        for name, axis in recording.axes.items():
            if "position_demand" in axis.missing:
                return f"no demand of {name} was logged"
    for name, figures in unknown.items():
        if GAINS in figures:
            return f"the gains of {name} are unknown"
    for name, figures in unknown.items():
        if figures:
            return f"{' and '.join(figures)} of {name} is unknown"
    return None


def examine_motion(
    examined: Examination, recordings: Sequence[Recording], *, correct: bool = False
) -> Examination:
    """Examine recordings along their motion: channels, gap in force, its floor and its location.

    Args:
        examined: so far; its settings may have any values where figures are unknown.
        recordings: repaired.
        correct: continue with corrected channels instead of giving up.

    Raises:
        ValueError: a recording does not fit the machine file; with the recording's name.
    """
    findings = list(examined.findings)
    for recording in recordings:
        reason = why_no_motion(recording, examined.settings)
        if reason is not None:
            reason = _name_recording(recording, recordings, reason)
            return replace(examined, insufficient=reason)
        findings += check_time(recording.time, examined.settings.sync_period)
        for axis in examined.settings.axes:
            findings += check_quantisation(recording.axes[axis.name], axis)
    motions = _measure_motions(recordings, examined.settings, examined.clock)
    audits = [
        audit_motion(recording, motion, examined.settings)
        for recording, motion in zip(recordings, motions, strict=True)
    ]
    faults = tuple(fault for findings_of, _ in audits for fault in findings_of)
    lost = next((fault for fault in faults if fault.finding == "sign"), None)
    marked = mark_applied(faults) if correct and lost is None else faults
    examined = replace(examined, findings=_merge_findings([[*findings, *marked]]))
    if lost is not None:
        return replace(examined, insufficient=f"{lost.text}: log it with its sign")
    if faults and correct:
        recordings = [corrected for _, corrected in audits]
        motions = _measure_motions(recordings, examined.settings, examined.clock)
    reason = f"{faults[0].text}; {_CORRECT}" if faults and not correct else None
    settings = examined.settings
    if any(examined.unknown.values()):
        try:
            settings = fit_figures(motions, settings, examined.unknown, is_rough=True)
            # How smooth the motion must be depends on the mass.
            motions = _measure_motions(recordings, settings, examined.clock)
            settings = fit_figures(motions, examined.settings, examined.unknown)
        except ValueError as error:
            alone = "; without this axis the others can be diagnosed"
            why = f"{error}{alone if len(settings.axes) > 1 else ''}"
            return replace(examined, insufficient=reason or why)
    moves = min(len(motion.recording.moves) for motion in motions)
    if moves < _FEWEST_STROKES:
        few = f"{moves} strokes: at least {_FEWEST_STROKES} are needed to hold some out"
        return replace(examined, insufficient=reason or few)
    measured = [compare_along(motion, settings) for motion in motions]
    return replace(
        examined,
        insufficient=reason,
        settings=settings,
        motions=tuple(motions),
        measured=tuple(measured),
        gap=pool_gaps([(m.gap, len(m.replay.recording)) for m in measured]),
        located=locate_gap(measured),
    )


def _measure_motions(
    recordings: Sequence[Recording], settings: StageSettings, clock: Clock
) -> list[Motion]:
    return [
        _name_errors(recording, partial(measure_motion, settings=replace(settings, start=start)))
        for recording, start in zip(recordings, clock.starts, strict=True)
    ]


def why_no_motion(recording: Recording, settings: StageSettings) -> str | None:
    """Why a recording cannot be judged along its motion, or None."""
    count = len(recording)
    if count * settings.sync_period < SHORTEST:
        return f"{count * settings.sync_period:.3g} s long: at least {SHORTEST:g} s are needed"
    if settings.sync_period > _SLOWEST_MOTION:
        return f"samples are {settings.sync_period:.3g} s apart: accelerations are shorter"
    units = {axis.name: axis.unit_of("N") for axis in settings.axes}
    for name, axis in recording.axes.items():
        if "force_actual" in axis.missing:
            return (
                f"no force of {name} was logged: log force, torque or motor current, for nothing "
                f"else says what a motion took"
            )
        if np.ptp(axis.force_actual[axis.valid]) == 0.0 and np.ptp(axis.position_actual) > 0.0:
            return f"axis {name}: the force is constant at {axis.force_actual[0]:.4g} {units[name]}"
        share = float(axis.valid.mean())
        if share < _FEWEST_VALID:
            return f"axis {name}: only {100 * share:.0f} % of the samples are valid"
    moved = [float(np.ptp(axis.position_actual)) for axis in recording.axes.values()]
    if max(moved) < _EXCITED:
        return "no motion: the axes stand still throughout"
    return None


def _is_finite(gap: Gap) -> bool:
    return all(
        np.isfinite((figures.nominal, figures.floor)).all()
        for signals in gap.values()
        for figures in signals.values()
    )


def why_insufficient(recording: Recording, settings: StageSettings) -> str | None:
    """Why a recording cannot support a diagnosis, or None.

    Args:
        recording: as logged.
        settings: of the machine file.
    """
    count = len(recording)
    if count < 2:
        return f"{count} samples"
    period = float(np.median(np.diff(recording.time)))
    ratio = period / settings.sync_period
    in_other_units = any(abs(ratio / unit - 1.0) < 0.03 for unit in (1e3, 1e6, 1e9))
    if period > SLOWEST and not in_other_units:
        return (
            f"samples are {period:.3g} s apart ({1 / period:.3g} Hz): friction and control act "
            f"within milliseconds"
        )
    seconds = count * (settings.sync_period if in_other_units else period)
    if seconds < SHORTEST:
        return f"{seconds:.3g} s long: at least {SHORTEST:g} s with {_FEWEST_MOVES} moves needed"
    for name, axis in recording.axes.items():
        for channel in ("position_demand", "force_offset", "position_actual", "force_actual"):
            largest = float(np.abs(getattr(axis, channel)).max())
            if largest > _LARGEST:
                return (
                    f"axis {name}: {channel} reaches {largest:.3g}, more than any sensor measures"
                )
        share = float(axis.valid.mean())
        if share < _FEWEST_VALID:
            return f"axis {name}: only {100 * share:.0f} % of the samples are valid"
    demands = [axis.position_demand for axis in recording.axes.values()]
    if max(float(np.ptp(demand)) for demand in demands) < _EXCITED:
        return "no motion: the demand stands still throughout"
    moves = split_moves(recording, settings.sync_period)
    if len(moves) < _FEWEST_MOVES:
        return f"{len(moves)} move: at least {_FEWEST_MOVES} are needed to hold one out"
    return None


def report_without_causes(examined: Examination) -> GapReport:
    """The report as far as it is known before any effect is suspected.

    The verdict is `unexplained` where a diagnosis is possible: no cause has been looked for.
    """
    located = () if examined.located is None else examined.located.cells
    verdict, reason = INSUFFICIENT, examined.insufficient or "no recording"
    if examined.insufficient is None and examined.gap is not None:
        size = combined_floors(examined.gap)
        verdict = UNEXPLAINED
        reason = f"the combined gap is {size:.3g} times the floor; no cause has been looked for"
    mode = CLOSED_LOOP if examined.open_loop is None else OPEN_LOOP
    return GapReport(
        examined.recordings, verdict, reason, examined.findings, examined.gap or {}, where=located,
        mode=mode, clock=examined.clock.text,
    )  # fmt: skip


def _merge_findings(found: Sequence[Sequence[ChannelFinding]]) -> tuple[ChannelFinding, ...]:
    """Findings of several recordings, each kind once, with the mean of its values."""
    kinds: dict[tuple[str, str, str], list[ChannelFinding]] = {}
    for findings in found:
        for finding in findings:
            kinds.setdefault((finding.axis, finding.channel, finding.finding), []).append(finding)
    return tuple(
        replace(same[0], value=float(np.mean([f.value for f in same if f.value is not None])))
        if any(f.value is not None for f in same)
        else same[0]
        for same in kinds.values()
    )


def _name_recording(recording: Recording, recordings: Sequence[Recording], reason: str) -> str:
    return f"{recording.source}: {reason}" if len(recordings) > 1 else reason


def _name_errors(recording: Recording, do: Callable[[Recording], _T]) -> _T:
    try:
        return do(recording)
    except ValueError as error:
        raise ValueError(f"{recording.source}: {error}") from error
