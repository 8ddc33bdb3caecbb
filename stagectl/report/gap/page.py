"""The page of a gap diagnosis: verdict first, one HTML file that opens offline."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import yaml

from sim2real.attribution import Pairs
from sim2real.diagnosis import Examination
from sim2real.findings import GapReport
from sim2real.gap import Signals
from sim2real.residuals import ResidualViews
from stagectl.report.chart import legend
from stagectl.report.gap import traces
from stagectl.report.gap.moves import NO_MOVES, move_data
from stagectl.report.gap.outline import diagnosis_outline
from stagectl.report.gap.views import draw_views
from stagectl.report.render import render_page


def render_gap_page(
    report: GapReport,
    examined: Examination,
    machine: str,
    *,
    explained: Sequence[Signals] | None = None,
    similarity: Mapping[str, Pairs] | None = None,
    views: Mapping[str, ResidualViews] | None = None,
) -> str:
    """The page's HTML.

    Args:
        report: of the diagnosis.
        examined: the recordings it is based on; their residuals are drawn.
        machine: name of the machine.
        explained: signals of the model with the causes, one per recording; None without causes.
        similarity: axis -> similarity of pairs of effects.
        views: axis -> what the models leave over velocity, position, frequency, at reversals.
    """
    order = _largest_first(examined)
    axes = {axis.name: axis for axis in examined.settings.axes}
    ratio = examined.settings.control_period / examined.settings.sync_period
    charts = NO_MOVES
    if order:
        charts = move_data(examined.measured, explained, examined.settings, order[0][1])
    shown = [views[axis] for axis in dict.fromkeys(a for _, a, _ in order)] if views else []
    models = ("before", *(("after",) if explained is not None else ()))
    moves = report.next_experiment.recipe()["moves"] if report.next_experiment else ()
    return render_page(
        "gap.html.j2",
        diagnosis_outline(report, machine, examined.measured),
        script="gap.js",
        data=charts,
        explained=explained is not None,
        sections=[
            traces.residual_section(examined.measured, explained, axes[axis], signal, share, ratio)
            for share, axis, signal in order
        ],
        curves=[traces.curve_panel(found, axes[found.axis]) for found in report.unlisted],
        moves=charts,
        views=draw_views(shown),
        move_key=legend("measured", *models),
        model_key=legend(*models),
        residual_key=legend(*models, "floor"),
        matrices={a: _matrix(pairs) for a, pairs in (similarity or {}).items() if pairs},
        next_moves=_yaml(moves),
    )


def _largest_first(examined: Examination) -> list[tuple[float, str, str]]:
    """Share of the gap, axis and signal, the largest share first; empty without measurements."""
    if not examined.measured or examined.located is None:
        return []
    excess = examined.located.excess
    return sorted(
        ((share, a, s) for a, of in excess.items() for s, share in of.items()), reverse=True
    )


def _matrix(pairs: Pairs) -> tuple[list[str], list[list[float | None]]]:
    """Names of effects and the similarity of each with each."""
    known = dict(pairs)
    names = list(dict.fromkeys(name for pair in known for name in pair))
    rows = [[1.0 if a == b else known.get((a, b), known.get((b, a))) for b in names] for a in names]
    return [name.replace("_", " ") for name in names], rows


def _yaml(moves: Sequence[Mapping[str, Any]]) -> str:
    """Moves in the syntax of a recipe."""
    if not moves:
        return ""
    listed = {"moves": [dict(move) for move in moves]}
    text: str = yaml.safe_dump(listed, sort_keys=False, default_flow_style=None)
    return text
