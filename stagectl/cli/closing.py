"""The closing table of a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich import box
from rich.console import Console, ConsoleOptions, Group, RenderableType, RenderResult
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from stagectl.run import RunResult
from stagectl.sequencer import SiteVerdict
from stagectl.store import SPOOL_NAME

_STYLES = {"completed": "green", "aborted": "yellow", "fault": "red"}
_ORDER = {"macro": 0, "micro": 1}
_WIDTH = 80
_LISTED = 10  # refused estimates and failed sites shown


def closing(result: RunResult, folder: Path) -> RenderableType:
    """Outcome, moves per axis, friction figures, refused estimates, where the files are."""
    summary = result.summary
    parts: list[RenderableType] = [_headline(result), *_went_on(summary)]
    if summary["moves"]:
        parts.append(_moves(result))
    if summary["friction"]:
        parts += [_friction(summary["friction"]), *_refused(summary["friction"])]
    parts += _judged(result.verdicts)
    cycle = summary["cycle"]
    if cycle["missed"] or cycle["late"]:
        text = f"cycles: {cycle['missed']} TPDOs missed, {cycle['late']} SYNCs late"
        ledger = summary.get("punctuality")
        if ledger is not None:
            text += f" (at most {ledger['late_in_a_row']} in a row), {ledger['doubled']} doubled"
        parts.append(Text(text))
    parts += [Text(notice, style="yellow") for notice in result.notices]
    files = sorted(p.name for p in folder.iterdir()) if folder.is_dir() else []
    if SPOOL_NAME in files:
        parts.append(
            Text(
                f"the bus log could not be written whole (disk full?); what there is stays in "
                f"{SPOOL_NAME}, and 'stagectl recover {folder}' makes a log of it",
                style="yellow",
            )
        )
    parts.append(Text(f"files in {folder}: {', '.join(files)}"))
    return _Wide(Group(*parts))


@dataclass(frozen=True, slots=True)
class _Wide:
    """At least as wide as its tables: a narrow terminal breaks their lines, none is cut off."""

    inner: RenderableType

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        yield from console.render(self.inner, options.update(width=max(options.max_width, _WIDTH)))


def _table(title: str) -> Table:
    return Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1))


def _headline(result: RunResult) -> Text:
    summary = result.summary
    moves = () if result.recording is None else result.recording.moves
    # Of the recording: the summary leaves out a move that no axis makes (already there).
    sites = {move.site for move in moves if move.site is not None}
    text = Text(f"{summary['recipe']} on {summary['machine']}: ")
    text.append(summary["outcome"], style=_STYLES[summary["outcome"]])
    text.append(f", {len(sites)} sites in {summary['duration']:.1f} s of the stage's time")
    if summary["simulated"] and summary["wall_time"] > 0:
        speed = summary["duration"] / summary["wall_time"]
        text.append(f" (simulated in {summary['wall_time']:.2f} s, {speed:.0f} x real time)")
    return text


def _went_on(summary: dict[str, Any]) -> list[RenderableType]:
    """What the run took up, and what it began again."""
    lines = []
    resumed = summary.get("resumed")
    if resumed is not None:
        lines.append(f"went on behind {resumed['done']} finished, which are in {resumed['run']}")
    for retry in summary.get("retries", ()):
        where = "" if retry["site"] is None else f"site {retry['site']} "
        lines.append(f"{where}begun again (attempt {retry['attempt']}): {retry['fault']}")
    return [Text("\n".join(lines))] if lines else []


def _moves(result: RunResult) -> Table:
    """Medians per axis and kind, with and without the friction update where both are known."""
    table = _table("Moves (medians)")
    for name in ("axis", "move", "friction"):
        table.add_column(name, no_wrap=True)
    for name in ("count", "peak error", "±50 nm", "±200 nm", "open"):
        table.add_column(name, justify="right", no_wrap=True)
    groups: dict[tuple[str, str, str], list[dict[str, Any]]] = {}
    for number, move in zip(_move_numbers(result), result.summary["moves"], strict=True):
        key = (move["axis"], move["kind"], _model(result, move["axis"], number))
        groups.setdefault(key, []).append(move)
    for (axis, kind, model), moves in sorted(
        groups.items(), key=lambda item: (item[0][0], _ORDER.get(item[0][1], 9), item[0][2])
    ):
        table.add_row(
            axis,
            kind,
            model,
            str(len(moves)),
            f"{_median([m['peak_error'] for m in moves]) * 1e6:.3f} µm",
            f"{_median([m['settling']['5e-08'] for m in moves]) * 1e3:.0f} ms",
            f"{_median([m['settling']['2e-07'] for m in moves]) * 1e3:.0f} ms",
            str(sum(not m["settled"] for m in moves)),
        )
    return table


def _model(result: RunResult, axis: str, move: int) -> str:
    """What the offsets of a move were made of."""
    mode: str = result.summary["compensation"]
    if mode != "estimated":
        return {"none": "no model", "model": "machine file", "oracle": "truth"}[mode]
    first = result.first_update.get(axis)
    return "updated" if first is not None and move >= first else "before update"


def _move_numbers(result: RunResult) -> list[int]:
    """For each entry of the summary, the index of its move in the recording."""
    moves = result.recording.moves if result.recording is not None else ()
    numbers, number = [], 0
    for entry in result.summary["moves"]:
        while number < len(moves) - 1 and not (
            moves[number].kind == entry["kind"]
            and moves[number].site == entry["site"]
            and abs(abs(moves[number].distance(entry["axis"])) - entry["distance"]) < 1e-12
        ):
            number += 1
        numbers.append(number)
    return numbers


def _median(values: Sequence[float | None]) -> float:
    known = [v for v in values if v is not None]
    return float(np.median(known)) if known else float("nan")


def _friction(entries: Sequence[dict[str, Any]]) -> Table:
    table = _table("Friction at the end")
    for name in ("axis", "figure"):
        table.add_column(name, no_wrap=True)
    for name in ("value", "± 1 sigma"):
        table.add_column(name, justify="right", no_wrap=True)
    for name in ("unit", "estimates accepted"):
        table.add_column(name, no_wrap=True)
    latest = {entry["axis"]: entry for entry in entries}
    for axis, entry in sorted(latest.items()):
        of_axis = [e for e in entries if e["axis"] == axis]
        accepted = f"{sum(e['accepted'] for e in of_axis)} of {len(of_axis)}"
        for row, (name, p) in enumerate(entry["parameters"].items()):
            table.add_row(
                axis if row == 0 else "",
                name,
                f"{p['value']:.4g}",
                f"{p['sigma']:.2g}",
                p["unit"],
                accepted if row == 0 else "",
            )
    return table


def _refused(entries: Sequence[dict[str, Any]]) -> list[RenderableType]:
    refused = [
        f"{_site(e['site'])}axis {e['axis']}: {e['reason']}" for e in entries if not e["accepted"]
    ]
    return _list("estimates refused, the last good model kept:", refused)


def _site(site: int | None) -> str:
    """Moves of a list, not of sites, belong to none."""
    return f"site {site} " if site else ""


def _judged(verdicts: Sequence[SiteVerdict]) -> list[RenderableType]:
    if not verdicts:
        return []
    failed = [f"site {v.site}: {'; '.join(v.failures)}" for v in verdicts if v.failures]
    passed = f"limits: {len(verdicts) - len(failed)} of {len(verdicts)} sites pass"
    return _list(passed + ("; failed:" if failed else ""), failed, always=True)


def _list(title: str, lines: Sequence[str], always: bool = False) -> list[RenderableType]:
    if not lines and not always:
        return []
    shown = list(lines[:_LISTED])
    if len(lines) > _LISTED:
        shown.append(f"and {len(lines) - _LISTED} more")
    # what a line is too long for goes on below it, not below the title
    return [Text(title), *(Padding(Text(line), (0, 0, 0, 2), expand=False) for line in shown)]
