"""The HTML page of a calibration: verdict, sites, and what changed against the last map."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from markupsafe import Markup

from stagectl.calibration.outcome import (
    ACT,
    WATCH,
    SiteOutcome,
    common_changes,
    reached_gains,
)
from stagectl.calibration.sequence import SiteSequence
from stagectl.maps import AxisChange, MapVersion, draw_maps
from stagectl.report import render_template
from stagectl.store import write_atomically

_LEVELS = {"good": "good", "watch": "warning", "act": "bad", "failed": "bad"}
"""Severities, from the best to the worst, and how the page colours them."""
_WORDS = {"good": "in order", "watch": "to watch", "act": "to act on", "failed": "failed"}


@dataclass(frozen=True, slots=True)
class CalibrationReport:
    """What the page shows.

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


def write_calibration_report(path: Path, report: CalibrationReport) -> None:
    """Write the page, atomically.

    Raises:
        StagectlError: it cannot be written.
    """
    write_atomically(path, render_calibration(report), "report")


def render_calibration(report: CalibrationReport) -> str:
    """The page's HTML."""
    pictures: dict[str, list[Markup]] = (
        {} if report.version is None else draw_maps(report.version, report.before)
    )
    return render_template(
        "calibration.html.j2",
        ("report.css",),
        report=report,
        level=_level(report),
        verdict=verdict(report),
        rows=[_row(outcome, report.sequence) for outcome in report.outcomes],
        common=common_changes(report.changes),
        reached=reached_gains(report.outcomes, report.sequence),
        pictures=[picture for drawn in pictures.values() for picture in drawn],
        watch=f"{100 * WATCH:.0f} %",
        act=f"{100 * ACT:.0f} %",
    )


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


def _level(report: CalibrationReport) -> str:
    worst = {_LEVELS[outcome.severity] for outcome in report.outcomes}
    if report.error is not None or "bad" in worst or not report.outcomes:
        return "bad"
    has_map = report.version is not None or report.is_from_recording
    return "warning" if "warning" in worst or not has_map else "good"


def _row(outcome: SiteOutcome, sequence: SiteSequence) -> dict[str, str]:
    expected = sum(gain.bits for gain in sequence.gains[outcome.axis].values())
    return {
        "site": str(outcome.site),
        "place": f"({outcome.place[0] * 1e3:.1f}, {outcome.place[1] * 1e3:.1f})",
        "axis": outcome.axis,
        "coulomb": "" if outcome.coulomb is None else f"{outcome.coulomb:.3f}",
        "sigma": "" if outcome.sigma is None else f"{100 * outcome.sigma:.1f} %",
        "change": "" if outcome.change is None else f"{100 * outcome.change:+.1f} %",
        "bits": f"{sum(gain.bits for gain in outcome.gains.values()):.1f} ({expected:.1f})",
        "level": _LEVELS[outcome.severity],
        "severity": outcome.severity,
        "suggestion": outcome.suggestion,
        "refused": str(len(outcome.refused)) if outcome.refused else "",
    }
