"""Writes the page of a gap diagnosis: verdict first, one file that opens offline."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2
import yaml
from markupsafe import Markup

from sim2real.attribution import FrictionOverPosition, Pairs
from sim2real.diagnosis import Examination
from sim2real.gap import Signals, combined_gap
from sim2real.report import GapReport
from stagectl.report import gap_traces
from stagectl.report.content import Notice
from stagectl.report.gap_charts import legend, matrix
from stagectl.store import write_atomically

_HERE = Path(__file__).parent
_CANDIDATES = 12
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


def write_gap_page(
    path: Path,
    report: GapReport,
    examined: Examination,
    machine: str,
    *,
    explained: Sequence[Signals] | None = None,
    left: Sequence[str] = (),
    likeness: Mapping[str, Pairs] | None = None,
    profiles: Sequence[FrictionOverPosition] = (),
) -> None:
    """Write the page, atomically; arguments as `render_gap_page`.

    Raises:
        StagectlError: it cannot be written.
    """
    text = render_gap_page(
        report, examined, machine,
        explained=explained, left=left, likeness=likeness, profiles=profiles,
    )  # fmt: skip
    write_atomically(path, text, "report")


def render_gap_page(
    report: GapReport,
    examined: Examination,
    machine: str,
    *,
    explained: Sequence[Signals] | None = None,
    left: Sequence[str] = (),
    likeness: Mapping[str, Pairs] | None = None,
    profiles: Sequence[FrictionOverPosition] = (),
) -> str:
    """The page's HTML.

    Args:
        report: of the diagnosis.
        examined: what it rests on; its residuals are drawn.
        machine: name of the machine.
        explained: the model's signals with the causes, one per recording; None without causes.
        left: what is left after the causes, in sentences.
        likeness: axis -> how alike effects are there, besides what `report.confusable` says.
        profiles: friction over position, where it was named.
    """
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_HERE / "templates"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    measured, located = examined.measured, examined.located
    sections: list[gap_traces.Section] = []
    move_name, move_panels = "", tuple[gap_traces.Panel, ...]()
    if measured and located is not None:
        ratio = examined.settings.control_period / examined.settings.sync_period
        order = sorted(
            ((share, a, s) for a, of in located.excess.items() for s, share in of.items()),
            reverse=True,
        )
        sections = [
            gap_traces.section(measured, explained, axis, signal, share, ratio)
            for share, axis, signal in order
        ]
        move_name, move_panels = gap_traces.telling_move(measured, explained, order[0][1], ratio)
    ranked = sorted(report.candidates, key=lambda c: -c.probability)
    moves = report.next_experiment.to_json()["moves"] if report.next_experiment else ()
    return environment.get_template("gap.html.j2").render(
        static={name: _inline(name) for name in ("report.css", "gap.css")},
        report=report,
        machine=machine,
        verdict=_VERDICTS[report.verdict],
        headline=headline(report),
        reason=_sentence(report.reason),
        figures=_figures(report),
        gap_rows=_gap_rows(report),
        explained=explained is not None,
        repeats=_repeats(examined),
        sections=sections,
        profiles=[gap_traces.friction(profile) for profile in profiles],
        profile_key=legend(("measured", "after")),
        move_name=move_name,
        move_panels=move_panels,
        move_key=legend(("measured", "before", *(("after",) if explained is not None else ()))),
        residual_key=gap_traces.key(explained is not None),
        left=left,
        candidates=ranked[:_CANDIDATES],
        more_candidates=max(len(ranked) - _CANDIDATES, 0),
        taken={(cause.axis, cause.effect) for cause in report.causes},
        matrices=_matrices(likeness or {}),
        next_moves=_yaml(moves),
        with_sigma=_with_sigma,
    )


def headline(report: GapReport) -> str:
    """The verdict in one sentence."""
    named = " and ".join(
        f"{cause.effect.replace('_', ' ')} on {cause.axis}" for cause in report.causes
    )
    closed = "" if report.gap_closed is None else f" closes {100 * report.gap_closed:.0f} % of it"
    match report.verdict:
        case "no_gap":
            return "The machine file describes this stage: nothing to explain above the floor."
        case "explained":
            return f"The gap is {named}{':' if closed else ''}{closed}."
        case "partly_explained":
            return (
                f"Part of the gap is {named}{':' if closed else ''}{closed}; the rest has no name."
            )
        case "unexplained":
            return "There is a gap, and no known effect accounts for it."
        case _:
            return "These recordings can't support a diagnosis."


def _figures(report: GapReport) -> list[tuple[str, str]]:
    """The few figures that are read from the last row."""
    figures = []
    if report.gap:
        gap = combined_gap(report.gap)  # type: ignore[arg-type]
        if math.isfinite(gap):
            figures.append((f"{gap**0.5:.1f} x", "the floor: the gap as given"))
    if report.gap_closed is not None:
        figures.append((f"{100 * report.gap_closed:.0f} %", "of it closed, on moves held back"))
        if report.gap_closed_interval is not None:
            low, high = (100 * end for end in report.gap_closed_interval)
            figures.append((f"{low:.0f}–{high:.0f} %", "interval of that"))  # noqa: RUF001
    if report.causes:
        probable = report.causes[0]
        figures.append(
            (f"{100 * probable.probability:.0f} %", f"sure of {probable.effect.replace('_', ' ')}")
        )
    return figures


def _gap_rows(report: GapReport) -> list[GapRow]:
    rows = []
    for axis, signals in (report.gap or {}).items():
        for signal, figures in signals.items():
            scale, unit = gap_traces.SCALES[signal]

            def shown(value: float | None, scale: float = scale, unit: str = unit) -> str:
                return "–" if value is None else f"{_digits(value * scale)} {unit}"  # noqa: RUF001

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
                    f"{axis} {signal}: {check.moves} moves repeat another; they scatter by "
                    f"{check.ratio:.1f} times what the machine file's repeatability gives."
                )
    return lines


def _matrices(likeness: Mapping[str, Pairs]) -> list[tuple[str, Markup]]:
    """Likeness of the effects per axis, where it is known."""
    axes = {axis: dict(pairs) for axis, pairs in likeness.items() if pairs}
    pictures = []
    for axis, pairs in axes.items():
        names = list(dict.fromkeys(name for pair in pairs for name in pair))
        words = {name: name.replace("_", " ") for name in names}
        renamed = {(words[a], words[b]): value for (a, b), value in pairs.items()}
        pictures.append((axis, matrix(list(words.values()), renamed)))
    return pictures


def _yaml(moves: Sequence[Mapping[str, Any]]) -> str:
    """Moves as a recipe has them."""
    if not moves:
        return ""
    listed = {"moves": [dict(move) for move in moves]}
    text: str = yaml.safe_dump(listed, sort_keys=False, default_flow_style=None)
    return text


def _sentence(text: str) -> str:
    whole = text if text.endswith((".", "!", "?")) else text + "."
    return whole[:1].upper() + whole[1:]


def _digits(value: float) -> str:
    """Three significant digits, without an exponent where that is short."""
    if value == 0 or not math.isfinite(value):
        return "0" if value == 0 else "–"  # noqa: RUF001
    if 1e-3 <= abs(value) < 1e5:
        decimals = max(0, 2 - math.floor(math.log10(abs(value))))
        return f"{value:.{decimals}f}"
    return f"{value:.2e}"


def _with_sigma(value: float, sigma: float) -> tuple[str, str]:
    """Value and sigma with the decimals that sigma's two digits ask for."""
    if not (math.isfinite(sigma) and sigma > 0):
        return _digits(value), "–"  # noqa: RUF001
    decimals = 1 - math.floor(math.log10(sigma))
    if 0 <= decimals <= 7:
        return f"{value:.{decimals}f}", f"{sigma:.{decimals}f}"
    return f"{value:.4g}", f"{sigma:.2g}"


def _inline(name: str) -> Markup:
    # Our own files, not input: they go into <style> as they are.
    return Markup((_HERE / "static" / name).read_text(encoding="utf-8"))  # noqa: S704
