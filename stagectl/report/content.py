"""What the report says in words and tables, from the run's summary alone.

Values come out as text in the units people read (um, ms); every figure is from `summary.json`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from statistics import fmean, median
from typing import Any

Summary = Mapping[str, Any]

_PLAIN = {"completed": "Completed", "aborted": "Aborted", "fault": "Ended on a fault"}
_LISTED = 6  # names listed in a notice before "and n more"


@dataclass(frozen=True, slots=True)
class Row:
    """One line of the table of results: a kind of move on one axis.

    Attributes:
        kind, axis: what it is of.  count: moves of it.
        peak: median and largest peak error.
        settling: per window: median, mean, 90th percentile.
        unsettled: moves still outside at their last sample.
    """

    kind: str
    axis: str
    count: int
    peak: tuple[str, str]
    settling: tuple[tuple[str, str, str], ...]
    unsettled: int


@dataclass(frozen=True, slots=True)
class Notice:
    """One thing the reader should know.

    Attributes:
        level: "good", "warning" or "bad".
        text: one sentence.
    """

    level: str
    text: str


@dataclass(frozen=True, slots=True)
class Refusal:
    """An estimate that was not taken over; `site` is None in a list of moves."""

    site: int | None
    axis: str
    reason: str


def date(started: str) -> str:
    """An ISO 8601 date to the second, for people; as it is where it is something else."""
    try:
        return f"{datetime.fromisoformat(started):%Y-%m-%d %H:%M:%S %Z}".strip()
    except ValueError:
        return started


def micrometres(value: float | None) -> str:
    """A length [m] in um with three significant digits."""
    return "–" if value is None or not math.isfinite(value) else _digits(value * 1e6)  # noqa: RUF001


def milliseconds(value: float | None) -> str:
    """A time [s] in ms."""
    if value is None or not math.isfinite(value):
        return "–"  # noqa: RUF001
    return f"{value * 1e3:.1f}".removesuffix(".0")


def window_name(key: str) -> str:
    """A settling window's key as people say it: "5e-08" -> "±50 nm"."""
    return f"±{float(key) * 1e9:g} nm"


def windows(summary: Summary) -> tuple[str, ...]:
    """Keys of the settling windows, tightest first."""
    keys = {key for move in summary["moves"] for key in move["settling"]}
    return tuple(sorted(keys, key=float))


def headline(summary: Summary) -> str:
    """The run in one sentence."""
    micro = summary["micro"]
    if not micro["count"]:
        return "No micro-move was completed."
    keys = sorted(micro["settling_median"], key=float)
    times = " and to ".join(
        f"{window_name(key)} in {milliseconds(micro['settling_median'][key])} ms" for key in keys
    )
    return (
        f"Micro-moves settle to {times} (medians of {micro['count']}), "
        f"with a peak error of {micrometres(micro['peak_error_median'])}\u00a0µm."
    )


def outcome(summary: Summary) -> Notice:
    """How the run ended, for the badge in the header."""
    text = _PLAIN.get(summary["outcome"], str(summary["outcome"]).capitalize())
    level = {"completed": "good", "aborted": "warning"}.get(summary["outcome"], "bad")
    return Notice(level, text)


def notices(summary: Summary) -> list[Notice]:
    """What the reader should know beyond the tables, worst first."""
    found: list[Notice] = []
    if summary["fault"]:
        found.append(Notice("bad", str(summary["fault"])))
    resumed = summary.get("resumed")
    if resumed:
        text = f"Went on behind {resumed['done']} finished, which are in {resumed['run']}."
        found.append(Notice("good", text))
    for retry in summary.get("retries", ()):
        place = "A move" if retry["site"] is None else f"Site {retry['site']}"
        text = f"{place} was begun again (attempt {retry['attempt']}): {retry['fault']}"
        found.append(Notice("warning", text))
    unsettled = [move for move in summary["moves"] if not move["settled"]]
    if unsettled:
        names = _list_places(unsettled)
        found.append(
            Notice(
                "warning",
                f"{len(unsettled)} of {len(summary['moves'])} moves of an axis were still outside "
                f"{window_name(windows(summary)[0])} when the next one began: {names}.",
            )
        )
    elif summary["moves"]:
        found.append(Notice("good", "Every move settled."))
    refused = refusals(summary)
    if refused:
        found.append(
            Notice(
                "warning",
                f"{len(refused)} of {len(summary['friction'])} friction estimates were refused.",
            )
        )
    cycle = summary["cycle"]
    level = "warning" if cycle["missed"] or cycle["late"] else "good"
    found.append(
        Notice(
            level,
            f"{cycle['missed']} missed process data objects, {cycle['late']} late cycles "
            f"of {milliseconds(cycle['period'])} ms{_punctuality(summary)}.",
        )
    )
    return found


def _punctuality(summary: Mapping[str, Any]) -> str:
    """What else the cycle ledger tells, where there is one."""
    ledger = summary.get("punctuality")
    if ledger is None:
        return ""
    text = f"; {ledger['tardy']} came after their window, {ledger['doubled']} twice"
    if ledger["late_in_a_row"] > 1:
        text += f", at most {ledger['late_in_a_row']} late cycles in a row"
    came = [a for a in ledger["arrival"].values() if a["max"] is not None]
    if came:
        latest = max(a["max"] for a in came)
        text += f"; the latest {milliseconds(latest)} ms after its SYNC"
    return text


def _list_places(moves: Sequence[Mapping[str, Any]]) -> str:
    names = [
        f"{'' if move['site'] is None else 'site ' + str(move['site']) + ' '}"
        f"{move['axis']} {move['kind']}"
        for move in moves
    ]
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    return ", ".join(names[:_LISTED]) + more


def rows(summary: Summary, axes: Sequence[str]) -> list[Row]:
    """The table of results: macro- and micro-moves, each axis; moves broken off are left out."""
    keys = windows(summary)
    table: list[Row] = []
    for kind in ("macro", "micro", "creep", "other"):
        for axis in axes:
            moves = [
                move
                for move in summary["moves"]
                if (move["kind"], move["axis"]) == (kind, axis) and move.get("completed", True)
            ]
            if not moves:
                continue
            peaks = [m["peak_error"] for m in moves if m["peak_error"] is not None]
            table.append(
                Row(
                    kind=kind,
                    axis=axis,
                    count=len(moves),
                    peak=(
                        micrometres(median(peaks) if peaks else None),
                        micrometres(max(peaks, default=None)),
                    ),
                    settling=tuple(_times([m["settling"][key] for m in moves]) for key in keys),
                    unsettled=sum(not m["settled"] for m in moves),
                )
            )
    return table


_TOLD = 1.02
"""A move has told a figure where it narrowed it by so much."""


def refusals(summary: Summary) -> list[Refusal]:
    """The estimates that were refused, in order."""
    return [
        Refusal(entry["site"] or None, entry["axis"], entry["reason"] or "no reason given")
        for entry in summary["friction"]
        if not entry["accepted"]
    ]


def latest_friction(summary: Summary, axes: Sequence[str]) -> list[tuple[str, str, str, str, str]]:
    """Last accepted figure of each parameter: (axis, parameter, value, sigma, unit)."""
    table: list[tuple[str, str, str, str, str]] = []
    for axis in axes:
        latest: dict[str, Mapping[str, Any]] = {}
        for entry in summary["friction"]:
            if entry["axis"] == axis and entry["accepted"]:
                latest |= entry["parameters"]
        for name, figure in latest.items():
            table.append(
                (axis, name, _figure(figure["value"]), _figure(figure["sigma"]), figure["unit"])
            )
    return table


_TOLD_BY = {
    "coulomb": "moves that slide",
    "viscous": "fast moves",
    "stiffness": "the onset of a move, and a reversal",
    "attraction": "moves without a fast slide, of two breakaway travels and more",
}


def figures_that_stayed(summary: Summary, axes: Sequence[str]) -> list[tuple[str, str, str]]:
    """Figures that no move has told, and why: (axis, parameter, why)."""
    table: list[tuple[str, str, str]] = []
    for axis in axes:
        entries = [e for e in summary["friction"] if e["axis"] == axis]
        accepted = [e for e in entries if e["accepted"]]
        for name in entries[0]["parameters"] if entries else ():
            held = sum(name in e.get("held", ()) for e in accepted)
            # A summary of an earlier version does not say what a move has told.
            if any((e.get("gain", {}).get(name) or _TOLD) >= _TOLD for e in accepted):
                continue
            if not accepted:
                why = "no estimate was accepted"
            elif held:
                why = f"{held} of {len(accepted)} accepted moves say less of it than was known"
            else:
                why = "no accepted move could tell it"
            told_by = f"; it is told by {_TOLD_BY[name]}" if name in _TOLD_BY else ""
            table.append((axis, name, why + told_by))
    return table


def _times(values: Sequence[float]) -> tuple[str, str, str]:
    ordered = sorted(values)
    position = 0.9 * (len(ordered) - 1)
    low = math.floor(position)
    high = min(low + 1, len(ordered) - 1)
    p90 = ordered[low] + (ordered[high] - ordered[low]) * (position - low)
    return milliseconds(median(ordered)), milliseconds(fmean(ordered)), milliseconds(p90)


def _figure(value: float | None) -> str:
    return "–" if value is None else _digits(value)  # noqa: RUF001


def _digits(value: float) -> str:
    """Three significant digits without an exponent up to millions."""
    if value == 0:
        return "0"
    decimals = max(0, 2 - math.floor(math.log10(abs(value))))
    return f"{value:,.{min(decimals, 9)}f}".replace(",", " ")
