"""The page of a run: what it says, charts and data in one HTML file that opens offline."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from stagectl.report.render import render_page
from stagectl.report.run_outline import run_outline
from stagectl.report.traces import chart_data
from stagedata import Recording


def render_report(
    recording: Recording,
    summary: Mapping[str, Any],
    *,
    control_period: float,
    notices: Sequence[str] = (),
) -> str:
    """The HTML of the report of a run.

    Args:
        recording: of the run.
        summary: of the same run, as in `summary.json`.
        control_period: Tc of the drives [s].
        notices: texts for the operator.

    Raises:
        ValueError: the summary belongs to another recording.
    """
    by_site = all(move.site is not None for move in recording.moves)
    return render_page(
        "run.html.j2",
        run_outline(summary, recording, notices=notices),
        script="report.js",
        data=chart_data(recording, summary, control_period),
        recording=recording,
        places="sites" if by_site else "moves",
        estimated=bool(summary["friction"]),
        observed=any(axis["on"] for axis in summary.get("observer", {}).values()),
    )
