"""Writes `report.html`: template, style, charts and data in one file that opens offline."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup

from stagectl.report import content
from stagectl.report.traces import chart_data
from stagectl.store import write_atomically
from stagedata import Recording

_HERE = Path(__file__).parent
_INLINE = ("uPlot.min.css", "uPlot.iife.min.js", "report.css", "report.js")


def write_report(
    path: Path, recording: Recording, summary: Mapping[str, Any], *, control_period: float
) -> None:
    """Write the report of a run, atomically.

    Args:
        path: of the HTML file; one that exists is replaced.
        recording: of the run.
        summary: of the same run, as `stagectl.store.summary` builds it or `summary.json` holds it.
        control_period: Tc of the drives [s].

    Raises:
        StagectlError: it cannot be written.
        ValueError: the summary is that of another recording.
    """
    text = render(recording, summary, control_period=control_period)
    write_atomically(path, text, "report")


def render(recording: Recording, summary: Mapping[str, Any], *, control_period: float) -> str:
    """The report's HTML; arguments as `write_report`."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_HERE / "templates"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    axes = tuple(recording.axes)
    by_site = all(move.site is not None for move in recording.moves)
    return environment.get_template("run.html.j2").render(
        static={name: _inline(name) for name in _INLINE},
        data=_script_json(chart_data(recording, summary, control_period)),
        summary=summary,
        recording=recording,
        sites=len({move.site for move in recording.moves if move.site is not None}),
        places="sites" if by_site else "moves",
        windows=[content.window_name(key) for key in content.windows(summary)],
        headline=content.headline(summary),
        outcome=content.outcome(summary),
        notices=content.notices(summary),
        rows=content.rows(summary, axes),
        refusals=content.refusals(summary),
        friction=content.latest_friction(summary, axes),
        stayed=content.figures_that_stayed(summary, axes),
        started=content.date,
        micrometres=content.micrometres,
        milliseconds=content.milliseconds,
    )


def _inline(name: str) -> Markup:
    # Our own files, not input: they go into <style> and <script> as they are.
    return Markup((_HERE / "static" / name).read_text(encoding="utf-8"))  # noqa: S704


def _script_json(data: object) -> Markup:
    """JSON that cannot end the script element it stands in."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return Markup(text)  # noqa: S704 (nothing is left that HTML would read)
