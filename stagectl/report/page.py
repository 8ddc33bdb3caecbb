"""The report of a run: template, style, charts and data in one HTML file that opens offline."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from stagectl.report import content, facts
from stagectl.report.ending import resume_command
from stagectl.report.render import render_template, script_json
from stagectl.report.traces import chart_data
from stagectl.store import write_atomically
from stagedata import Recording

_STATIC = ("uPlot.min.css", "uPlot.iife.min.js", "report.css", "charts.js", "report.js")


def write_report(
    path: Path, recording: Recording, summary: Mapping[str, Any], *, control_period: float
) -> None:
    """Write the report of a run, atomically.

    Args:
        path: of the HTML file; an existing one is replaced.
        recording: of the run.
        summary: of the same run, as in `summary.json`.
        control_period: Tc of the drives [s].

    Raises:
        StagectlError: the file cannot be written.
        ValueError: the summary belongs to another recording.
    """
    text = render_report(recording, summary, control_period=control_period)
    write_atomically(path, text, "report")


def render_report(
    recording: Recording, summary: Mapping[str, Any], *, control_period: float
) -> str:
    """The report's HTML; arguments as for `write_report`."""
    axes = tuple(recording.axes)
    by_site = all(move.site is not None for move in recording.moves)
    return render_template(
        "run.html.j2",
        _STATIC,
        data=script_json(chart_data(recording, summary, control_period)),
        summary=summary,
        recording=recording,
        sites=len({move.site for move in recording.moves if move.site is not None}),
        places="sites" if by_site else "moves",
        windows=[content.format_window(key) for key in content.window_keys(summary)],
        headline=content.headline(summary),
        outcome=content.outcome_notice(summary),
        verdict=content.verdict_notice(summary),
        resume=resume_command(summary),
        friction_map=facts.friction_map_used(summary),
        learned_feedforward=facts.learned_feedforward(summary),
        notices=content.notices(summary),
        rows=content.result_rows(summary, axes),
        refused=content.refused_estimates(summary),
        friction=content.latest_friction(summary, axes),
        unchanged=content.unchanged_parameters(summary, axes),
        format_date=content.format_date,
        micrometres=content.format_micrometres,
        milliseconds=content.format_milliseconds,
    )
