"""What a run says, from its summary; every value is one of `summary.json`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any

import numpy as np

from stagectl.report.ending import Summary, interruption, reason, resume_command, verdict
from stagectl.report.formats import (
    DASH,
    date,
    micrometres,
    milliseconds,
    percent,
    place,
    sentence,
    window_name,
    with_sigma,
)
from stagectl.report.outline import Cell, Fact, Outline, Section, Table
from stagectl.sequencer import RESOLUTION
from stagedata import Recording

_OUTCOMES = {
    "completed": Fact("Completed", "good"),
    "aborted": Fact("Aborted", "warning"),
    "fault": Fact("Ended with a fault", "bad"),
    "killed": Fact("Killed", "bad"),
}
_VERDICTS = {
    "pass": Fact("Limits met", "good"),
    "fail": Fact("Limits missed", "bad"),
    "incomplete": Fact("Limits: incomplete", "warning"),
}
_MODELS = {"none": "none", "model": "file", "oracle": "true"}
"""The friction behind the force offsets, where it is not estimated."""
_KINDS = ("macro", "micro", "creep", "other")
_NAMED = 6  # moves listed in a notice before "and n more"
_INFORMATIVE = 1.02
"""Gain (sigma before over sigma after) from which a move was informative about a parameter."""
_INFORMATIVE_MOVES = {
    "coulomb": "sliding moves",
    "viscous": "fast moves",
    "stiffness": "the onset of moves and reversals",
    "attraction": "slow moves of at least two breakaway distances",
}


def run_outline(
    summary: Summary,
    recording: Recording | None,
    *,
    notices: Sequence[str] = (),
    first_update: Mapping[str, int] | None = None,
) -> Outline:
    """All that a run says.

    Args:
        summary: as in `summary.json`.
        recording: of the same run; None where it never moved.
        notices: texts for the operator.
        first_update: axis -> number of moves before its first accepted estimate; None where it is
            unknown, and moves before and after it are not told apart.
    """
    outcome = str(summary["outcome"])
    badges = [_OUTCOMES.get(outcome, Fact(outcome.capitalize(), "bad"))]
    if "limits" in summary:
        badges.append(_VERDICTS[summary["limits"]["verdict"]])
    return Outline(
        str(summary["recipe"]),
        f"on {summary['machine']}",
        badges,
        headline(summary, recording),
        facts=_facts(summary, recording),
        notices=[*_happened(summary), *_limitations(summary, notices), _cycle(summary)],
        sections={
            "limits": _limits(summary),
            "results": _results(summary, recording, first_update),
            "friction": _friction(summary),
            "refused": _refused(summary),
            "moves": _every_move(summary),
        },
        command=resume_command(summary),
    )


def headline(summary: Summary, recording: Recording | None) -> str:
    """Where and why it ended early, or the wafer's verdict and how much was done; settling."""
    where, duration = interruption(summary), f"{summary['duration']:.1f} s"
    if where is not None:
        said = [f"ended {where} ({duration}): {reason(summary)}"]
    else:
        moves = () if recording is None else recording.moves
        # From the recording: the summary leaves out moves without any distance to go.
        sites = {move.site for move in moves if move.site is not None}
        said = [f"{f'{len(sites)} sites' if sites else f'{len(moves)} moves'} in {duration}"]
        wall = summary["wall_time"]
        if wall and summary["simulated"]:
            speed = f"{summary['duration'] / wall:.0f} x real time"
            said[0] += f" (simulated in {wall:.2f} s, {speed})"
    wafer = verdict(summary)
    if wafer is not None:
        said.insert(0 if where is None else 1, wafer)
    return " ".join([*map(sentence, said), _settling(summary)])


def _settling(summary: Summary) -> str:
    """Per axis, the worse one given: a fast axis would hide a slow one in a median over both."""
    micro: dict[str, list[dict[str, Any]]] = {}
    for move in summary["moves"]:
        if move["kind"] == "micro" and move.get("completed", True):
            micro.setdefault(move["axis"], []).append(move)
    if not micro:
        return "No micro-move was completed."

    def worse(values: Mapping[str, Sequence[float | None]]) -> tuple[float | None, str]:
        known = {axis: [v for v in of if v is not None] for axis, of in values.items()}
        medians = {axis: median(of) for axis, of in known.items() if of}
        most = max(medians.values(), default=None)
        named = [axis for axis, value in medians.items() if value == most]
        return most, f" ({', '.join(named)})" if len(named) < len(micro) else ""

    times = []
    for key in window_keys(summary):
        time, axes = worse({a: [m["settling"][key] for m in of] for a, of in micro.items()})
        times.append(f"{window_name(key)} in {milliseconds(time)}\u00a0ms{axes}")
    error, axes = worse({a: [m["peak_error"] for m in of] for a, of in micro.items()})
    where = " on the worse axis" if len(micro) > 1 else ""
    return (
        f"Median settling{where}: {', '.join(times)}; median peak error "
        f"{micrometres(error)}\u00a0µm{axes} ({sum(map(len, micro.values()))} micro-moves)."
    )


def window_keys(summary: Summary) -> tuple[str, ...]:
    """Keys of the settling windows, tightest first."""
    keys = {key for move in summary["moves"] for key in move["settling"]}
    return tuple(sorted(keys, key=float))


def friction_map_used(summary: Summary) -> str:
    """Which friction map the run went by, in words."""
    if summary.get("map") is None:
        if summary["compensation"] != "estimated":
            return f"none (compensation {summary['compensation']})"
        return "none"
    comment = summary.get("map_comment")
    return f"map {summary['map']}" + (f" ({comment})" if comment else "")


def _facts(summary: Summary, recording: Recording | None) -> dict[str, str | None]:
    """Circumstances of the run."""
    started = summary.get("started") or ("" if recording is None else recording.started)
    observers = summary.get("observer", {})
    effects = summary.get("effects", ())
    return {
        "Started": date(started),
        "Stage": f"virtual, seed {summary['seed']}" if summary["simulated"] else "real",
        "Compensation": summary["compensation"],
        "Friction map": friction_map_used(summary),
        "Observer": "; ".join(
            f"{axis}: gain {own['gain']:.3g}, time constant {own['time_constant'] * 1e3:.1f} ms"
            if own["on"]
            else f"{axis}: none ({own['reason']})"
            for axis, own in observers.items()
        ),
        "Learned feedforward": learned_feedforward(summary),
        "Compensated effects": ", ".join(
            f"{e['axis']} {e['effect']}" for e in effects if e["compensated"]
        ),
        "Lot": summary["lot"],
        **{key.capitalize(): summary.get(key) for key in ("wafer", "operator", "comment")},
    }


def learned_feedforward(summary: Summary) -> str:
    """What each axis has learned to feed forward; empty in a run that could not learn it."""
    axes = []
    for axis, learned in summary.get("feedforward", {}).items():
        words = {
            "mass": percent(learned["mass"], 1, signed=True),
            "lead": f"{1e3 * learned['lead']:+.2f} ms",
            "coupling": percent(learned["coupling"], 1, signed=True),
        }
        shown = ", ".join(f"{name} {text}" for name, text in words.items() if learned[name])
        axes.append(f"{axis}: {shown or 'as in the machine file'}")
    return "; ".join(axes)


def _happened(summary: Summary) -> list[Fact]:
    """What happened in the run."""
    found = []
    if summary["fault"] and interruption(summary) is None:
        found.append(Fact(str(summary["fault"]), "bad"))
    resumed = summary.get("resumed")
    if resumed:
        unit = "sites" if any(move["site"] for move in summary["moves"]) else "moves"
        text = f"continues after the first {resumed['done']} {unit} of {resumed['run']}"
        found.append(Fact(text, "good"))
    for retry in summary.get("retries", ()):
        where = "a move" if retry["site"] is None else f"site {retry['site']}"
        text = f"{where} restarted (attempt {retry['attempt']}): {retry['fault']}"
        found.append(Fact(text, "warning"))
    for step in summary.get("steps", ()):
        where = "everywhere" if step["everywhere"] else f"at {place(step['place'])} mm"
        change = percent(step["change"], signed=True)
        text = f"friction of axis {step['axis']} stepped by {change} {where}, {step['time']:.1f} s"
        found.append(Fact(text, "warning"))
    moves = summary["moves"]
    unsettled = [move for move in moves if not move["settled"]]
    if moves and not unsettled:
        found.append(Fact("every move settled", "good"))
    if unsettled:
        names = [f"{_site(move)}{move['axis']} {move['kind']}" for move in unsettled]
        more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
        text = (
            f"{len(unsettled)} of {len(moves)} single-axis moves were still outside "
            f"{window_name(window_keys(summary)[0])} when the next one began: "
            f"{', '.join(names[:_NAMED])}{more}"
        )
        found.append(Fact(text, "warning"))
    return found


def _site(entry: Mapping[str, Any]) -> str:
    """Moves in a list of moves belong to no site."""
    return f"site {entry['site']} " if entry["site"] else ""


def _limitations(summary: Summary, notices: Sequence[str]) -> list[Fact]:
    """What the run went without, and what was noticed on the way."""
    texts = [
        f"not compensated: {e['axis']} {e['effect']}: {e['text']}"
        for e in summary.get("effects", ())
        if not e["compensated"]
    ]
    texts += [*notices, *(found["text"] for found in summary.get("watchdog", ()))]
    if "history" in summary and not any("history" in text for text in notices):
        filed, made = summary["history"]["filed"], summary["history"]["estimates"]
        texts.append(f"the history has {filed} of {made} estimates")
    return [Fact(text, "warning") for text in dict.fromkeys(texts)]


def _cycle(summary: Summary) -> Fact:
    """Punctuality, more of it where there is a cycle ledger."""
    cycle, ledger = summary["cycle"], summary.get("punctuality")
    lacked = cycle["missed"] or cycle["late"]
    text = f"SYNC period {milliseconds(cycle['period'])} ms: "
    text += (
        f"{cycle['missed']} TPDOs missed, {cycle['late']} SYNCs late"
        if lacked
        else "every TPDO came, no SYNC was late"
    )
    if ledger is not None:
        if ledger["late_in_a_row"] > 1:
            text += f" (at most {ledger['late_in_a_row']} in a row)"
        told = {"tardy": "TPDOs after their window", "doubled": "received twice"}
        text += "".join(f", {ledger[key]} {what}" for key, what in told.items() if ledger.get(key))
        came = [a["max"] for a in ledger.get("arrival", {}).values() if a["max"] is not None]
        if came and not summary["simulated"]:  # in virtual time they come with their SYNC
            text += f"; the latest TPDO came {milliseconds(max(came))} ms after its SYNC"
    return Fact(text, "warning" if lacked else "good")


def _limits(summary: Summary) -> Section:
    """Sites that miss the limits."""
    failed = [site for site in summary.get("limits", {}).get("sites", ()) if not site["passed"]]
    facts = [Fact(f"site {s['site']}: {'; '.join(s['failures'])}", "bad") for s in failed]
    return Section("Sites that miss the limits", facts)


def _results(
    summary: Summary, recording: Recording | None, first_update: Mapping[str, int] | None
) -> Section:
    """Moves by axis, kind and the friction behind their offsets, without interrupted ones."""
    mode, keys = str(summary["compensation"]), window_keys(summary)
    numbers = [] if recording is None else [number for number, _ in single_axis_moves(recording)]
    groups: dict[tuple[str, int, str], list[Mapping[str, Any]]] = {}
    for k, move in enumerate(summary["moves"]):
        if move.get("completed", True):
            model = _MODELS.get(mode, "estimated")
            if mode == "estimated" and first_update is not None:
                first = first_update.get(move["axis"], math.inf)
                model = "updated" if numbers[k] >= first else "initial"
            group = (move["axis"], _KINDS.index(move["kind"]), model)
            groups.setdefault(group, []).append(move)
    rows: list[Sequence[Cell]] = []
    for (axis, kind, model), moves in sorted(groups.items()):
        peaks = [m["peak_error"] for m in moves if m["peak_error"] is not None]
        row = [axis, _KINDS[kind], model, str(len(moves))]
        row += [micrometres(of(peaks) if peaks else None) for of in (median, max)]
        for key in keys:
            times = np.array([m["settling"][key] for m in moves])
            figures = (np.median(times), times.mean(), np.percentile(times, 90))
            row += [milliseconds(float(figure)) for figure in figures]
        unsettled = sum(not m["settled"] for m in moves)
        rows.append([*row, Fact(str(unsettled), "warning" if unsettled else "")])
    titles = ["Axis", "Move", "Friction", "Moves", "Peak, µm", "largest, µm"]
    for key in keys:
        titles += [f"{window_name(key)}, ms", "mean", "90 %"]
    note = (
        "Medians. Peak: largest difference between setpoint and encoder while the setpoint "
        "moves. ±: settling to that window, from the setpoint's arrival to the last sample outside "
        "it; a move still outside when the next one begins counts with the whole time. Friction: "
        "of the force offsets."
    )
    table = Table([*titles, "Not settled"], rows, on_page=("largest, µm", "mean", "90 %"))
    return Section("Moves (medians)", table=table, note=note)


def single_axis_moves(recording: Recording) -> list[tuple[int, str]]:
    """Number in the recording and axis of each move in the summary, in its order."""
    return [
        (number, axis)
        for number, move in enumerate(recording.moves)
        for axis in recording.axes
        if abs(move.distance(axis)) >= RESOLUTION
    ]


def _friction(summary: Summary) -> Section:
    """The last accepted value of each parameter, and why others kept their initial one."""
    entries: dict[str, list[Mapping[str, Any]]] = {}
    for entry in summary["friction"]:
        entries.setdefault(entry["axis"], []).append(entry)
    rows, facts = [], []
    for axis, of_axis in sorted(entries.items()):
        accepted = [e for e in of_axis if e["accepted"]]
        latest: dict[str, Mapping[str, Any]] = {}
        for entry in accepted:
            latest |= entry["parameters"]
        count = f"{len(accepted)} of {len(of_axis)}"
        for name, figure in latest.items():
            value, sigma = with_sigma(figure["value"], figure["sigma"])
            rows.append((axis, name.replace("_", " "), value, sigma, figure["unit"], count))
        facts += [Fact(text) for text in _unchanged(axis, of_axis, accepted)]
    titles = ("Axis", "Parameter", "Last accepted", "± 1 sigma", "Unit", "Estimates accepted")
    return Section("Friction at the end of the run", facts, Table(titles, rows), most=100)


def _unchanged(
    axis: str, entries: Sequence[Mapping[str, Any]], accepted: Sequence[Mapping[str, Any]]
) -> list[str]:
    """Parameters about which no move was informative, and why."""
    lines = []
    for name in entries[0]["parameters"]:
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
        lines.append(f"{name.replace('_', ' ')} of axis {axis} kept its initial value: {why}")
    return lines


def _refused(summary: Summary) -> Section:
    """Estimates that were not used, with the reason."""
    refused = [entry for entry in summary["friction"] if not entry["accepted"]]
    title = f"{len(refused)} of {len(summary['friction'])} friction estimates were refused"
    facts = [Fact(f"{_site(e)}axis {e['axis']}: {e['reason'] or 'no reason'}") for e in refused]
    return Section(title, facts)


def _every_move(summary: Summary) -> Section:
    """Each move of each axis, for pages."""
    keys = window_keys(summary)
    rows: list[Sequence[Cell]] = []
    for move in summary["moves"]:
        row = [DASH if move["site"] is None else str(move["site"]), move["axis"], move["kind"]]
        row += [micrometres(move[key]) for key in ("distance", "peak_error")]
        row += [milliseconds(move["settling"].get(key)) for key in keys]
        rows.append([*row, Fact("yes") if move["settled"] else Fact("no", "warning")])
    titles = ["Site", "Axis", "Move", "Distance, µm", "Peak error, µm"]
    titles += [*(f"{window_name(key)}, ms" for key in keys), "Settled"]
    return Section("Every move", table=Table(titles, rows), on_page=True)
