"""The closing table of a run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from stagectl.session import RunResult

_STYLES = {"completed": "green", "aborted": "yellow", "fault": "red"}


def closing(result: RunResult, folder: Path) -> RenderableType:
    """Outcome, moves per axis, friction figures, refused estimates, where the files are."""
    summary = result.summary
    parts: list[RenderableType] = [_headline(summary)]
    if summary["moves"]:
        parts.append(_moves(result))
    if summary["friction"]:
        parts.append(_friction(summary["friction"]))
        parts += _refused(summary["friction"])
    cycle = summary["cycle"]
    if cycle["missed"] or cycle["late"]:
        parts.append(Text(f"cycles: {cycle['missed']} TPDOs missed, {cycle['late']} SYNCs late"))
    parts.append(
        Text(
            f"files: {folder}{'/' if str(folder) != '/' else ''} "
            "(report.html, recording.h5, summary.json, bus.asc)"
        )
    )
    return Group(*parts)


def _headline(summary: dict[str, Any]) -> Text:
    sites = {m["site"] for m in summary["moves"] if m["site"]}
    text = Text(f"{summary['recipe']} on {summary['machine']}: ")
    text.append(summary["outcome"], style=_STYLES[summary["outcome"]])
    text.append(f", {len(sites)} sites in {summary['duration']:.1f} s of the stage's time")
    if summary["simulated"] and summary["wall_time"] > 0:
        text.append(
            f" (simulated in {summary['wall_time']:.2f} s, "
            f"{summary['duration'] / summary['wall_time']:.0f} x real time)"
        )
    return text


def _moves(result: RunResult) -> Table:
    """Medians per axis and kind, before and after that axis' first friction update."""
    table = Table(title="Moves: medians", title_justify="left")
    for name in ("axis", "move", "friction model", "count", "peak error", "to ±50 nm", "to ±200 nm",
                 "not settled"):  # fmt: skip
        table.add_column(
            name, justify="left" if name in ("axis", "move", "friction model") else "right"
        )
    summary = result.summary
    learning = summary["compensation"] == "estimated"
    groups: dict[tuple[str, str, str], list[dict[str, Any]]] = {}
    order = {"macro": 0, "micro": 1}
    number, last = -1, None
    for move in summary["moves"]:
        key = (move["site"], move["kind"])
        if key != last or summary["moves"].index(move) == 0:
            last = key
        number = _move_number(result, move, number)
        first = result.first_update.get(move["axis"])
        model = (
            summary["compensation"]
            if not learning
            else "updated"
            if first is not None and number >= first
            else "not updated yet"
        )
        groups.setdefault((move["axis"], move["kind"], model), []).append(move)
    for (axis, kind, model), moves in sorted(
        groups.items(), key=lambda item: (item[0][0], order.get(item[0][1], 9), item[0][2])
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


def _move_number(result: RunResult, move: dict[str, Any], last: int) -> int:
    """Index in the recording of the move that an entry belongs to, searched from the last one."""
    if result.recording is None:
        return 0
    for number in range(max(last, 0), len(result.recording.moves)):
        candidate = result.recording.moves[number]
        if candidate.kind == move["kind"] and candidate.site == move["site"]:
            return number
    return last


def _median(values: Sequence[float | None]) -> float:
    known = [v for v in values if v is not None]
    return float(np.median(known)) if known else float("nan")


def _friction(entries: Sequence[dict[str, Any]]) -> Table:
    table = Table(title="Friction at the end: value ± 1 sigma", title_justify="left")
    latest = {entry["axis"]: entry for entry in entries}
    names = list(next(iter(latest.values()))["parameters"])
    table.add_column("axis")
    for name in names:
        table.add_column(name, justify="right")
    table.add_column("estimates", justify="right")
    for axis, entry in sorted(latest.items()):
        of_axis = [e for e in entries if e["axis"] == axis]
        accepted = sum(e["accepted"] for e in of_axis)
        table.add_row(
            axis,
            *(
                f"{p['value']:.4g} ± {p['sigma']:.2g} {p['unit']}"
                for p in entry["parameters"].values()
            ),
            f"{accepted} of {len(of_axis)} accepted",
        )
    return table


def _refused(entries: Sequence[dict[str, Any]]) -> list[RenderableType]:
    refused = [e for e in entries if not e["accepted"]]
    if not refused:
        return []
    lines = [f"  site {e['site']} axis {e['axis']}: {e['reason']}" for e in refused[:10]]
    if len(refused) > 10:
        lines.append(f"  and {len(refused) - 10} more, in summary.json")
    return [Text("\n".join(["estimates refused, the last good model kept:", *lines]))]
