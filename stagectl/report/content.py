"""Sentences and tables of a run's report, from its summary alone.

Values are formatted in µm and ms; every one of them is from `summary.json`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from statistics import fmean, median
from typing import Any

from stagectl.report.ending import Summary, interruption, reason, verdict

_OUTCOMES = {
    "completed": ("good", "Completed"),
    "aborted": ("warning", "Aborted"),
    "fault": ("bad", "Ended with a fault"),
    "killed": ("bad", "Killed"),
}
_VERDICTS = {
    "pass": ("good", "Limits met"),
    "fail": ("bad", "Limits missed"),
    "incomplete": ("warning", "Limits: incomplete"),
}
DASH = "\N{EN DASH}"
"""For a value that is unknown."""
_MAX_LISTED = 6  # names listed in a notice before "and n more"
_INFORMATIVE = 1.02
"""Gain (sigma before over sigma after) from which a move was informative about a parameter."""
_INFORMATIVE_MOVES = {
    "coulomb": "sliding moves",
    "viscous": "fast moves",
    "stiffness": "the onset of moves and reversals",
    "attraction": "slow moves of at least two breakaway distances",
}


@dataclass(frozen=True, slots=True)
class Row:
    """A row of the table of results: one kind of move on one axis.

    Attributes:
        kind, axis: of the moves.
        count: number of moves.
        peak: median and largest peak error.
        settling: per window: median, mean, 90th percentile.
        unsettled: moves still outside the tightest window at their last sample.
    """

    kind: str
    axis: str
    count: int
    peak: tuple[str, str]
    settling: tuple[tuple[str, str, str], ...]
    unsettled: int


@dataclass(frozen=True, slots=True)
class Notice:
    """A message to the reader.

    Attributes:
        level: "good", "warning" or "bad".
        text: one sentence.
    """

    level: str
    text: str


def format_date(started: str) -> str:
    """An ISO 8601 date to the second; any other text unchanged."""
    try:
        return f"{datetime.fromisoformat(started):%Y-%m-%d %H:%M:%S %Z}".strip()
    except ValueError:
        return started


def format_micrometres(value: float | None) -> str:
    """A length [m] in µm with three significant digits."""
    return DASH if value is None or not math.isfinite(value) else _digits(value * 1e6)


def format_milliseconds(value: float | None) -> str:
    """A time [s] in ms."""
    if value is None or not math.isfinite(value):
        return DASH
    return f"{value * 1e3:.1f}".removesuffix(".0")


def format_window(key: str) -> str:
    """A settling window from its key: "5e-08" -> "±50 nm"."""
    return f"±{float(key) * 1e9:g} nm"


def window_keys(summary: Summary) -> tuple[str, ...]:
    """Keys of the settling windows, tightest first."""
    keys = {key for move in summary["moves"] for key in move["settling"]}
    return tuple(sorted(keys, key=float))


def headline(summary: Summary) -> str:
    """The result of the run: where and why it ended early, the wafer's verdict, settling."""
    where, wafer = interruption(summary), verdict(summary)
    sentences = []
    if where is not None:
        sentences.append(f"{outcome_notice(summary).text} {where}: {reason(summary)}.")
    if wafer is not None:
        sentences.append(f"{_capital(wafer)}.")
    return " ".join([*sentences, _settling(summary)])


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _settling(summary: Summary) -> str:
    """Per axis, the worse one given: a fast axis would hide a slow one in a median over both."""
    micro: dict[str, list[dict[str, Any]]] = {}
    for move in summary["moves"]:
        if move["kind"] == "micro" and move.get("completed", True):
            micro.setdefault(move["axis"], []).append(move)
    if not micro:
        return "No micro-move was completed."

    def worse(values: Mapping[str, Sequence[float]]) -> tuple[float | None, str]:
        medians = {axis: median(found) for axis, found in values.items() if found}
        if not medians:
            return None, ""
        most = max(medians.values())
        named = [axis for axis, value in medians.items() if value == most]
        return most, f" ({', '.join(named)})" if len(named) < len(micro) else ""

    times = []
    for key in sorted(
        {key for moves in micro.values() for move in moves for key in move["settling"]}, key=float
    ):
        time, axes = worse({a: [m["settling"][key] for m in moves] for a, moves in micro.items()})
        times.append(f"{format_window(key)} in {format_milliseconds(time)}\u00a0ms{axes}")
    error, axes = worse(
        {
            a: [m["peak_error"] for m in moves if m["peak_error"] is not None]
            for a, moves in micro.items()
        }
    )
    count = sum(map(len, micro.values()))
    where = " on the worse axis" if len(micro) > 1 else ""
    return (
        f"Median settling{where}: {', '.join(times)}; median peak error "
        f"{format_micrometres(error)}\u00a0µm{axes} ({count} micro-moves)."
    )


def outcome_notice(summary: Summary) -> Notice:
    """How the run ended, for the badge in the header."""
    outcome = str(summary["outcome"])
    return Notice(*_OUTCOMES.get(outcome, ("bad", outcome.capitalize())))


def verdict_notice(summary: Summary) -> Notice | None:
    """The wafer's verdict, for the badge in the header."""
    limits = summary.get("limits")
    return None if limits is None else Notice(*_VERDICTS[limits["verdict"]])


def notices(summary: Summary) -> list[Notice]:
    """Messages beyond the tables, worst first."""
    found: list[Notice] = []
    if summary["fault"] and interruption(summary) is None:
        found.append(Notice("bad", str(summary["fault"])))
    failed = [site for site in summary.get("limits", {}).get("sites", ()) if not site["passed"]]
    for site in failed[:_MAX_LISTED]:
        found.append(Notice("bad", f"Site {site['site']}: {'; '.join(site['failures'])}."))
    if len(failed) > _MAX_LISTED:
        found.append(Notice("bad", f"{len(failed) - _MAX_LISTED} more sites miss the limits."))
    resumed = summary.get("resumed")
    if resumed:
        unit = "sites" if any(move["site"] for move in summary["moves"]) else "moves"
        text = f"Continues after the first {resumed['done']} {unit} of {resumed['run']}."
        found.append(Notice("good", text))
    for retry in summary.get("retries", ()):
        place = "A move" if retry["site"] is None else f"Site {retry['site']}"
        text = f"{place} was restarted (attempt {retry['attempt']}): {retry['fault']}"
        found.append(Notice("warning", text))
    unsettled = [move for move in summary["moves"] if not move["settled"]]
    if unsettled:
        text = (
            f"{len(unsettled)} of {len(summary['moves'])} single-axis moves were still outside "
            f"{format_window(window_keys(summary)[0])} when the next one began: "
            f"{_list_moves(unsettled)}."
        )
        found.append(Notice("warning", text))
    elif summary["moves"]:
        found.append(Notice("good", "Every move settled."))
    found += effect_notices(summary)
    found += [Notice("warning", f"{w['text']}.") for w in summary.get("watchdog", ())]
    if refused := refused_estimates(summary):
        text = f"{len(refused)} of {len(summary['friction'])} friction estimates were refused."
        found.append(Notice("warning", text))
    cycle = summary["cycle"]
    text = (
        f"SYNC period {format_milliseconds(cycle['period'])} ms: {cycle['missed']} TPDOs missed, "
        f"{cycle['late']} SYNCs late{_punctuality(summary)}."
    )
    found.append(Notice("warning" if cycle["missed"] or cycle["late"] else "good", text))
    return found


def effect_notices(summary: Summary) -> list[Notice]:
    """Which effects of the machine file were compensated, and which not and why."""
    effects = summary.get("effects", ())
    done = [f"{e['axis']} {e['effect']}" for e in effects if e["compensated"]]
    left = [e for e in effects if not e["compensated"]]
    found = [Notice("good", f"Compensated effects: {', '.join(done)}.")] if done else []
    for effect in left:
        text = f"Not compensated: {effect['axis']} {effect['effect']}: {effect['text']}."
        found.append(Notice("warning", text))
    return found


def _punctuality(summary: Mapping[str, Any]) -> str:
    """More from the cycle ledger, if there is one."""
    ledger = summary.get("punctuality")
    if ledger is None:
        return ""
    text = f"; {ledger['tardy']} TPDOs after their window, {ledger['doubled']} received twice"
    if ledger["late_in_a_row"] > 1:
        text += f", at most {ledger['late_in_a_row']} late SYNCs in a row"
    came = [a for a in ledger["arrival"].values() if a["max"] is not None]
    if came and not summary["simulated"]:  # in virtual time they come with their SYNC
        latest = format_milliseconds(max(a["max"] for a in came))
        text += f"; the latest TPDO came {latest} ms after its SYNC"
    return text


def _list_moves(moves: Sequence[Mapping[str, Any]]) -> str:
    names = [
        f"{'' if move['site'] is None else 'site ' + str(move['site']) + ' '}"
        f"{move['axis']} {move['kind']}"
        for move in moves
    ]
    more = f" and {len(names) - _MAX_LISTED} more" if len(names) > _MAX_LISTED else ""
    return ", ".join(names[:_MAX_LISTED]) + more


def result_rows(summary: Summary, axes: Sequence[str]) -> list[Row]:
    """The table of results by kind of move and axis, without moves that were interrupted."""
    keys = window_keys(summary)
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
                        format_micrometres(median(peaks) if peaks else None),
                        format_micrometres(max(peaks, default=None)),
                    ),
                    settling=tuple(
                        _statistics([m["settling"][key] for m in moves]) for key in keys
                    ),
                    unsettled=sum(not m["settled"] for m in moves),
                )
            )
    return table


def refused_estimates(summary: Summary) -> list[Mapping[str, Any]]:
    """The entries of refused estimates, in order."""
    return [entry for entry in summary["friction"] if not entry["accepted"]]


def latest_friction(summary: Summary, axes: Sequence[str]) -> list[tuple[str, str, str, str, str]]:
    """The last accepted value of each parameter: (axis, parameter, value, sigma, unit)."""
    table: list[tuple[str, str, str, str, str]] = []
    for axis in axes:
        latest: dict[str, Mapping[str, Any]] = {}
        for entry in summary["friction"]:
            if entry["axis"] == axis and entry["accepted"]:
                latest |= entry["parameters"]
        for name, figure in latest.items():
            table.append(
                (axis, name, _number(figure["value"]), _number(figure["sigma"]), figure["unit"])
            )
    return table


def unchanged_parameters(summary: Summary, axes: Sequence[str]) -> list[tuple[str, str, str]]:
    """Parameters about which no move was informative, and why: (axis, parameter, why)."""
    table: list[tuple[str, str, str]] = []
    for axis in axes:
        entries = [e for e in summary["friction"] if e["axis"] == axis]
        accepted = [e for e in entries if e["accepted"]]
        for name in entries[0]["parameters"] if entries else ():
            held = sum(name in e.get("held", ()) for e in accepted)
            # Summaries of earlier versions have no gains.
            if any((e.get("gain", {}).get(name) or _INFORMATIVE) >= _INFORMATIVE for e in accepted):
                continue
            if not accepted:
                why = "no estimate was accepted"
            elif held:
                why = f"{held} of {len(accepted)} accepted moves say less about it than was known"
            else:
                why = "no accepted move was informative about it"
            if name in _INFORMATIVE_MOVES:
                why += f"; {_INFORMATIVE_MOVES[name]} would be informative"
            table.append((axis, name, why))
    return table


def _statistics(values: Sequence[float]) -> tuple[str, str, str]:
    ordered = sorted(values)
    position = 0.9 * (len(ordered) - 1)
    low = math.floor(position)
    high = min(low + 1, len(ordered) - 1)
    p90 = ordered[low] + (ordered[high] - ordered[low]) * (position - low)
    return (
        format_milliseconds(median(ordered)),
        format_milliseconds(fmean(ordered)),
        format_milliseconds(p90),
    )


def _number(value: float | None) -> str:
    return DASH if value is None else _digits(value)


def _digits(value: float) -> str:
    """Three significant digits, without an exponent."""
    if value == 0:
        return "0"
    decimals = max(0, 2 - math.floor(math.log10(abs(value))))
    return f"{value:,.{min(decimals, 9)}f}".replace(",", " ")
