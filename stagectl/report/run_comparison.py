"""Two runs beside each other, by what their outlines say."""

from __future__ import annotations

from stagectl.report.ending import Summary
from stagectl.report.formats import DASH
from stagectl.report.outline import Cell, Section, Table
from stagectl.report.run_outline import run_outline


def compare_runs(first: Summary, second: Summary, names: tuple[str, str]) -> Section:
    """A row per circumstance, per figure of each axis' kinds of moves, and per friction figure."""
    a, b = _figures(first), _figures(second)
    rows = [(what, a.get(what, DASH), b.get(what, DASH)) for what in dict.fromkeys([*a, *b])]
    return Section(f"{names[0]} and {names[1]}", table=Table(("", *names), rows))


def _figures(summary: Summary) -> dict[str, str]:
    """What a run says, by its subject."""
    outline = run_outline(summary, None)
    found = {"Outcome": ". ".join(badge.text for badge in outline.badges)}
    for key in ("Stage", "Friction map", "Lot", "Wafer"):
        found[key] = outline.facts.get(key) or DASH
    moves, friction = (outline.sections[name].table for name in ("results", "friction"))
    if moves is not None:
        for axis, kind, _, *cells in moves.rows:
            for title, cell in zip(moves.titles[3:], cells, strict=True):
                if title not in moves.on_page:
                    found[f"{_text(axis)} {_text(kind)}: {title}"] = _text(cell)
    if friction is not None:
        for axis, name, value, sigma, unit, _ in friction.rows:
            what = f"{_text(axis)} {_text(name)}, {_text(unit)}"
            found[what] = f"{_text(value)} ± {_text(sigma)}"
    return found


def _text(cell: Cell) -> str:
    return cell if isinstance(cell, str) else cell.text
