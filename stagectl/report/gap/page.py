"""The page of a gap diagnosis: verdict first, one HTML file that opens offline."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import yaml
from markupsafe import Markup

from sim2real.attribution import FrictionOverPosition, Pairs
from sim2real.diagnosis import Examination
from sim2real.findings import GapReport
from sim2real.gap import Signals
from sim2real.residuals import ResidualViews
from stagectl.report.gap import traces
from stagectl.report.gap.charts import legend, matrix
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
    profiles: Sequence[FrictionOverPosition] = (),
    views: Mapping[str, ResidualViews] | None = None,
) -> str:
    """The page's HTML.

    Args:
        report: of the diagnosis.
        examined: the recordings it is based on; their residuals are drawn.
        machine: name of the machine.
        explained: signals of the model with the causes, one per recording; None without causes.
        similarity: axis -> similarity of pairs of effects.
        profiles: friction over position, where it was found to be a cause.
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
    moves = report.next_experiment.to_json()["moves"] if report.next_experiment else ()
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
        profiles=[traces.friction_panel(profile, axes[profile.axis]) for profile in profiles],
        profile_key=legend(("measured", "after")),
        moves=charts,
        views=draw_views(shown),
        move_key=legend(("measured", *models)),
        model_key=legend(models),
        residual_key=traces.residual_legend(explained is not None),
        matrices=_matrices(similarity or {}),
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


def _matrices(similarity: Mapping[str, Pairs]) -> list[tuple[str, Markup]]:
    """The matrix of similarities of each axis that has any."""
    axes = {axis: dict(pairs) for axis, pairs in similarity.items() if pairs}
    pictures = []
    for axis, pairs in axes.items():
        names = list(dict.fromkeys(name for pair in pairs for name in pair))
        words = {name: name.replace("_", " ") for name in names}
        renamed = {(words[a], words[b]): value for (a, b), value in pairs.items()}
        pictures.append((axis, matrix(list(words.values()), renamed)))
    return pictures


def _yaml(moves: Sequence[Mapping[str, Any]]) -> str:
    """Moves in the syntax of a recipe."""
    if not moves:
        return ""
    listed = {"moves": [dict(move) for move in moves]}
    text: str = yaml.safe_dump(listed, sort_keys=False, default_flow_style=None)
    return text
