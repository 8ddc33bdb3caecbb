"""What is printed at the end of a run: outcome, moves, friction, where the files are."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich import box
from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from stagectl.cli.wide import Wide
from stagectl.report import friction_map_used, interruption, resume_command, verdict
from stagectl.run import RunResult
from stagectl.store import SPOOL_NAME

_STYLES = {"completed": "green", "aborted": "yellow", "fault": "red"}
_ORDER = {"macro": 0, "micro": 1}
_MAX_LISTED = 10  # refused estimates and failed sites


def render_outcome(result: RunResult, folder: Path) -> RenderableType:
    """Outcome, move statistics, friction, refused estimates, site verdicts, notices, files."""
    summary = result.summary
    parts: list[RenderableType] = [_headline(result), *_interruptions(summary)]
    parts.append(Text(f"friction map: {friction_map_used(summary)}"))
    if summary["moves"]:
        parts.append(_moves(result))
    if summary["friction"]:
        parts += [_friction(summary["friction"]), *_refused(summary["friction"])]
    parts += _site_verdicts(result)
    cycle = summary["cycle"]
    if cycle["missed"] or cycle["late"]:
        text = f"cycle: {cycle['missed']} TPDOs missed, {cycle['late']} SYNCs late"
        ledger = summary.get("punctuality")
        if ledger is not None:
            text += f" (at most {ledger['late_in_a_row']} in a row), {ledger['doubled']} doubled"
        parts.append(Text(text))
    done = [f"{e['axis']} {e['effect']}" for e in summary.get("effects", ()) if e["compensated"]]
    if done:
        parts.append(Text(f"compensated effects: {', '.join(done)}"))
    parts += [_whole(notice, "yellow") for notice in result.notices]
    files = sorted(p.name for p in folder.iterdir()) if folder.is_dir() else []
    if SPOOL_NAME in files:
        parts.append(
            _whole(
                f"the bus log is incomplete (disk full?); its frames are in {SPOOL_NAME}, and "
                f"'stagectl recover {shlex.quote(str(folder))}' turns them into a log",
                "yellow",
            )
        )
    parts.append(Text(f"files in {folder}: {', '.join(files)}"))
    command = resume_command(summary)
    if command is not None:
        parts.append(_whole(f"to continue: {command}"))
    return Wide(Group(*parts))


def _whole(text: str, style: str = "") -> Text:
    """A line with a command to copy: only the terminal itself may break it."""
    return Text(text, style=style, no_wrap=True, overflow="ignore")


def _table(title: str) -> Table:
    return Table(title=title, title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1))


def _headline(result: RunResult) -> Text:
    summary = result.summary
    moves = () if result.recording is None else result.recording.moves
    # From the recording: the summary leaves out moves on which no axis had any distance to go.
    sites = {move.site for move in moves if move.site is not None}
    text = Text(f"{summary['recipe']} on {summary['machine']}: ")
    text.append(summary["outcome"], style=_STYLES[summary["outcome"]])
    where = interruption(summary)
    count = f"{len(sites)} sites" if sites else f"{len(moves)} moves"
    text.append(f", {count} in" if where is None else f" {where}, after")
    text.append(f" {summary['duration']:.1f} s")
    if summary["simulated"] and summary["wall_time"] > 0:
        speed = summary["duration"] / summary["wall_time"]
        text.append(f" (simulated in {summary['wall_time']:.2f} s, {speed:.0f} x real time)")
    return text


def _interruptions(summary: dict[str, Any]) -> list[RenderableType]:
    """The run that this one continues, and restarted sites."""
    lines = []
    resumed = summary.get("resumed")
    if resumed is not None:
        unit = "sites" if any(move["site"] for move in summary["moves"]) else "moves"
        lines.append(f"continues after the first {resumed['done']} {unit} of {resumed['run']}")
    for retry in summary.get("retries", ()):
        where = "" if retry["site"] is None else f"site {retry['site']} "
        lines.append(f"{where}restarted (attempt {retry['attempt']}): {retry['fault']}")
    return [Text("\n".join(lines))] if lines else []


def _moves(result: RunResult) -> Table:
    """Medians per axis and kind, before and after the first friction update."""
    table = _table("Moves (medians: peak error, settling time to ±50 nm and ±200 nm)")
    for name in ("axis", "move", "friction"):
        table.add_column(name, no_wrap=True)
    for name in ("count", "peak error", "±50 nm", "±200 nm", "unsettled"):
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
    """The friction model behind the force offsets of a move."""
    mode: str = result.summary["compensation"]
    if mode != "estimated":
        return {"none": "none", "model": "file", "oracle": "true"}[mode]
    first = result.first_update.get(axis)
    return "updated" if first is not None and move >= first else "initial"


def _move_numbers(result: RunResult) -> list[int]:
    """The index in the recording of each move in the summary."""
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
    table = _table("Friction estimate at the end of the run")
    for name in ("axis", "parameter"):
        table.add_column(name, no_wrap=True)
    for name in ("value", "±1 sigma"):
        table.add_column(name, justify="right", no_wrap=True)
    for name in ("unit", "moves accepted"):
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
    return _list("estimates refused, previous model kept:", refused)


def _site(site: int | None) -> str:
    """Moves in a list of moves belong to no site."""
    return f"site {site} " if site else ""


def _site_verdicts(result: RunResult) -> list[RenderableType]:
    judged = verdict(result.summary)
    if judged is None:
        return []
    failed = [f"site {v.site}: {'; '.join(v.failures)}" for v in result.verdicts if v.failures]
    return _list(judged + (":" if failed else ""), failed, always=True)


def _list(title: str, lines: Sequence[str], always: bool = False) -> list[RenderableType]:
    if not lines and not always:
        return []
    shown = list(lines[:_MAX_LISTED])
    if len(lines) > _MAX_LISTED:
        shown.append(f"and {len(lines) - _MAX_LISTED} more")
    # long lines wrap below their own beginning, not below the title
    return [Text(title), *(Padding(Text(line), (0, 0, 0, 2), expand=False) for line in shown)]
