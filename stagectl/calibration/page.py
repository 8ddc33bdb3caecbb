"""What a calibration says, and its page: verdict, sites, what changed against the last map."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from stagectl.calibration.outcome import (
    ACT,
    WATCH,
    SiteOutcome,
    common_changes,
    reached_gains,
)
from stagectl.calibration.sequence import SiteSequence
from stagectl.maps import AxisChange, MapVersion
from stagectl.maps.output import draw_maps
from stagectl.report import Fact, Outline, Section, Table, render_page
from stagectl.report.formats import percent, place
from stagectl.report.outline import Level
from stagectl.store import write_atomically

_LEVELS: dict[str, Level] = {"good": "good", "watch": "warning", "act": "bad", "failed": "bad"}
"""Severities, from the best to the worst, and how they are coloured."""
_WORDS = {"good": "in order", "watch": "to watch", "act": "to act on", "failed": "failed"}


@dataclass(frozen=True, slots=True)
class CalibrationReport:
    """What there is to say.

    Attributes:
        name, stage, started: of the calibration.
        error: what went wrong, or None.
        used: the friction map that it went by, in words.
        visited: sites visited, out of `planned`.
        outcomes: by site and axis.
        changes: since the version before; empty without one.
        sequence: of the moves at a site.
        version: the new map, or None.
        before: the version before, or None.
        is_from_recording: made from the recording alone, which holds no maps.
        notices: texts for the operator.
    """

    name: str
    stage: str
    started: str
    error: str | None
    used: str
    visited: int
    planned: int
    outcomes: Sequence[SiteOutcome]
    changes: Sequence[AxisChange]
    sequence: SiteSequence
    version: MapVersion | None
    before: MapVersion | None
    is_from_recording: bool = False
    notices: Sequence[str] = ()


def write_calibration_page(path: Path, report: CalibrationReport) -> None:
    """Write the page, atomically.

    Raises:
        StagectlError: it cannot be written.
    """
    write_atomically(path, render_calibration(report), "report")


def render_calibration(report: CalibrationReport) -> str:
    """The page's HTML."""
    drawn = {} if report.version is None else draw_maps(report.version, report.before)
    return render_page(
        "calibration.html.j2",
        calibration_outline(report),
        pictures=[picture for pictures in drawn.values() for picture in pictures],
    )


def calibration_outline(report: CalibrationReport) -> Outline:
    """All that a calibration says."""
    if report.before is not None:
        compared = f"map {report.before.number}"
    elif report.is_from_recording:
        compared = "nothing: the recording holds no maps"
    else:
        compared = "nothing: there was no map"
    notices = [Fact(text, "warning") for text in report.notices]
    notices += [] if report.error is None else [Fact(report.error, "bad")]
    notices += [Fact(line, "good") for line in common_changes(report.changes, report.outcomes)]
    reached = reached_gains(report.outcomes, report.sequence)
    return Outline(
        f"Calibration {report.name}",
        report.stage,
        [_badge(report)],
        verdict(report),
        facts={
            "Started": report.started, "Friction map used": report.used, "Compared with": compared
        },
        notices=notices,
        sections={
            "sites": _sites(report),
            "reached": Section(
                "Uncertainty reached, median over the sites, 1 sigma",
                [Fact(line.replace("_", " ")) for line in reached],
            ),
        },
    )  # fmt: skip


def _badge(report: CalibrationReport) -> Fact:
    worst = {_LEVELS[outcome.severity] for outcome in report.outcomes}
    has_map = report.version is not None or report.is_from_recording
    level: Level = "warning" if "warning" in worst or not has_map else "good"
    if report.error is not None or "bad" in worst or not report.outcomes:
        level = "bad"
    if report.visited < report.planned:
        return Fact("Interrupted", level)
    if report.version is not None:
        return Fact(f"Map {report.version.number}", level)
    return Fact("Complete" if report.is_from_recording else "No new map", level)


def verdict(report: CalibrationReport) -> str:
    """The outcome in one sentence."""
    counts = Counter(outcome.severity for outcome in report.outcomes)
    parts = [f"{counts[s]} {_WORDS[s]}" for s in reversed(_LEVELS) if counts[s]]
    text = f"{report.visited} of {report.planned} visits"
    if parts:
        text += f"; results by site and axis: {', '.join(parts)}"
    if report.is_from_recording:
        return f"{text}. From the recording alone, which holds no maps; they are in the history."
    if report.version is None:
        return f"{text}. No new map."
    text += f". New map {report.version.number}"
    return f"{text}, compared with map {report.before.number}." if report.before else f"{text}."


def _sites(report: CalibrationReport) -> Section:
    """A row per site and axis; what to do about those that are not in order."""
    rows, facts = [], []
    for o in report.outcomes:
        expected = sum(gain.bits for gain in report.sequence.gains[o.axis].values())
        bits = sum(gain.bits for gain in o.gains.values())
        rows.append((
            str(o.site), place(o.place), o.axis,
            "" if o.coulomb is None else f"{o.coulomb:.3f}",
            "" if o.sigma is None else percent(o.sigma, 1),
            "" if o.change is None else percent(o.change, 1, signed=True),
            f"{bits:.1f} ({expected:.1f})", str(len(o.refused) or ""),
            Fact(o.severity, _LEVELS[o.severity]),
        ))  # fmt: skip
        if o.severity != "good":
            text = f"site {o.site}, axis {o.axis}: {o.suggestion}"
            facts.append(Fact(text, _LEVELS[o.severity]))
    note = (
        "Change: of this site since the last map, without the change that all sites have in "
        f"common. Watch: {percent(WATCH)} or more; act: {percent(ACT)} or more. Bits: information "
        "that the moves gave about the friction figures, and what was expected of them. Refused: "
        "estimates not used."
    )
    titles = ("Site", "Place, mm", "Axis", "Fc, N", "± 1 sigma", "Change", "Bits (expected)",
              "Refused", "Verdict")  # fmt: skip
    table = Table(titles, rows, on_page=("Refused",))
    return Section("Sites", facts, table, note=note, most=100)
