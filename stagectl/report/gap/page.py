"""The page of a gap diagnosis: verdict first, one HTML file that opens offline."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import yaml
from markupsafe import Markup

from sim2real.attribution import FrictionOverPosition, Pairs
from sim2real.diagnosis import Examination
from sim2real.findings import SHOWN_AS, GapReport
from sim2real.gap import PERFECT_MODEL, Signals, combined_floors
from sim2real.residuals import ResidualViews
from stagectl.report.content import DASH, Notice
from stagectl.report.gap import traces
from stagectl.report.gap.charts import legend, matrix
from stagectl.report.gap.moves import NO_MOVES, move_data
from stagectl.report.gap.views import draw_views
from stagectl.report.render import render_template, script_json

_STATIC = (
    "uPlot.min.css", "uPlot.iife.min.js", "report.css", "gap.css", "charts.js", "gap.js",
)  # fmt: skip
_MAX_CANDIDATES = 12
_VERDICTS = {
    "no_gap": Notice("good", "No gap"),
    "explained": Notice("good", "Explained"),
    "partly_explained": Notice("warning", "Partly explained"),
    "unexplained": Notice("bad", "Unexplained"),
    "insufficient": Notice("warning", "Insufficient"),
}


@dataclass(frozen=True, slots=True)
class GapRow:
    """A row of the table of gaps, as text."""

    axis: str
    signal: str
    before: str
    after: str
    floor: str
    before_ratio: str
    after_ratio: str


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
    """The page's HTML (long: all that the template takes, one after another).

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
    sections = [
        traces.residual_section(examined.measured, explained, axes[axis], signal, share, ratio)
        for share, axis, signal in order
    ]
    charts = NO_MOVES
    if order:
        charts = move_data(examined.measured, explained, examined.settings, order[0][1])
    shown = [views[axis] for axis in dict.fromkeys(a for _, a, _ in order)] if views else []
    models = ("before", *(("after",) if explained is not None else ()))
    ranked = sorted(report.candidates, key=lambda c: -c.probability)
    moves = report.next_experiment.to_json()["moves"] if report.next_experiment else ()
    return render_template(
        "gap.html.j2",
        _STATIC,
        report=report,
        machine=machine,
        verdict=_VERDICTS[report.verdict],
        headline=headline(report),
        reason=_sentence(report.reason),
        figures=_figures(report),
        gap_rows=_gap_rows(report),
        explained=explained is not None,
        perfect_model=PERFECT_MODEL,
        repeats=_repeats(examined),
        sections=sections,
        profiles=[traces.friction_panel(profile, axes[profile.axis]) for profile in profiles],
        profile_key=legend(("measured", "after")),
        checked=any(step.elsewhere is not None for step in report.steps),
        data=script_json(charts),
        moves=charts,
        views=draw_views(shown),
        move_key=legend(("measured", *models)),
        model_key=legend(models),
        residual_key=traces.residual_legend(explained is not None),
        candidates=ranked[:_MAX_CANDIDATES],
        more_candidates=max(len(ranked) - _MAX_CANDIDATES, 0),
        taken={(cause.axis, cause.effect) for cause in report.causes},
        matrices=_matrices(similarity or {}),
        next_moves=_yaml(moves),
        with_sigma=_with_sigma,
    )


def _largest_first(examined: Examination) -> list[tuple[float, str, str]]:
    """Share of the gap, axis and signal, the largest share first; empty without measurements."""
    if not examined.measured or examined.located is None:
        return []
    excess = examined.located.excess
    return sorted(
        ((share, a, s) for a, of in excess.items() for s, share in of.items()), reverse=True
    )


def headline(report: GapReport) -> str:
    """The verdict in one sentence."""
    names = [c.effect.replace("_", " ") for c in report.causes]
    axes = [c.axis for c in report.causes]
    if len(set(axes)) == 1:
        named = f"{_listed(names)} on {axes[0]}"
    else:
        named = _listed([f"{n} on {axis}" for n, axis in zip(names, axes, strict=True)])
    named = named[:1].upper() + named[1:]
    verb = "accounts" if len(report.causes) == 1 else "together account"
    share = report.gap_closed
    size = "" if share is None else f"{100 * share:.0f} % of "
    share = report.gap_closed_elsewhere
    checked = (
        "" if share is None
        else f", on the recordings of --check for {100 * max(share, 0.0):.0f} %"
    )  # fmt: skip
    match report.verdict:
        case "no_gap":
            return "The machine file describes this stage down to the noise floor."
        case "explained":
            return f"{named} {verb} for {size}the gap{checked}."
        case "partly_explained":
            size = size or "part of "
            return f"{named} {verb} for {size}the gap{checked}; the rest is unexplained."
        case "unexplained":
            return "There is a gap, but no known effect explains it."
        case _:
            return "These recordings cannot support a diagnosis."


def _listed(names: Sequence[str]) -> str:
    """Names as in a sentence: a, b and c."""
    return " and ".join(", ".join(names).rsplit(", ", 1))


def _figures(report: GapReport) -> list[tuple[str, str]]:
    """The key figures in large type: value and meaning."""
    figures = []
    if report.gap:
        floors = combined_floors(report.gap)
        if math.isfinite(floors):
            figures.append((f"{floors:.3g} \u00d7 floor", "gap of the machine file"))
    if report.gap_closed is not None:
        figures.append((f"{100 * report.gap_closed:.0f} %", "of the gap closed, on held-out moves"))
        if report.gap_closed_interval is not None:
            low, high = (100 * end for end in report.gap_closed_interval)
            figures.append((f"{low:.0f}{DASH}{high:.0f} %", "its confidence interval"))
    if report.gap_closed_elsewhere is not None:
        closed = f"{100 * report.gap_closed_elsewhere:.0f} %"
        figures.append((closed, "closed on other recordings"))
    if report.causes:
        probable = report.causes[0]
        figures.append(
            (
                f"{100 * probable.probability:.0f} %",
                f"probability of {probable.effect.replace('_', ' ')}",
            )
        )
    return figures


def _gap_rows(report: GapReport) -> list[GapRow]:
    rows = []
    for axis, signals in (report.gap or {}).items():
        for signal, figures in signals.items():
            scale, unit = SHOWN_AS[figures.unit]

            def shown(value: float | None, scale: float = scale, unit: str = unit) -> str:
                return DASH if value is None else f"{_digits(value * scale)} {unit}"

            floor = figures.floor
            rows.append(
                GapRow(
                    axis,
                    signal,
                    shown(figures.nominal),
                    shown(figures.explained),
                    shown(floor),
                    f"{figures.nominal / floor:.1f}" if floor > 0 else "",
                    f"{figures.explained / floor:.1f}"
                    if figures.explained is not None and floor > 0
                    else "",
                )
            )
    return rows


def _repeats(examined: Examination) -> list[str]:
    lines = []
    for m in examined.measured:
        for axis, signals in m.repeats.items():
            for signal, check in signals.items():
                lines.append(
                    f"{axis} {signal}: {check.moves} repeated moves scatter by "
                    f"{check.ratio:.1f} times what the machine file's repeatability predicts."
                )
    return lines


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


def _sentence(text: str) -> str:
    whole = text if text.endswith((".", "!", "?")) else text + "."
    return whole[:1].upper() + whole[1:]


def _digits(value: float) -> str:
    """Three significant digits, without an exponent unless the text would be long."""
    if value == 0 or not math.isfinite(value):
        return "0" if value == 0 else DASH
    if 1e-3 <= abs(value) < 1e5:
        decimals = max(0, 2 - math.floor(math.log10(abs(value))))
        return f"{value:.{decimals}f}"
    return f"{value:.2e}"


def _with_sigma(value: float, sigma: float) -> tuple[str, str]:
    """Value and sigma, both rounded to two digits of sigma."""
    if not (math.isfinite(sigma) and sigma > 0):
        return _digits(value), DASH
    decimals = 1 - math.floor(math.log10(sigma))
    if 0 <= decimals <= 7:
        return f"{value:.{decimals}f}", f"{sigma:.{decimals}f}"
    return f"{value:.4g}", f"{sigma:.2g}"
