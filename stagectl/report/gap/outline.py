"""What a gap and its diagnosis say."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from sim2real import findings
from sim2real.empirical_force import EmpiricalForce
from sim2real.gap import (
    LARGEST_OF_PERFECT,
    PERFECT_MODEL,
    Measured,
    RepeatCheck,
    combined_floors,
)
from stagectl.report.formats import DASH, digits, listed, percent, sentence, with_sigma
from stagectl.report.outline import Fact, Outline, Section, Table

_MOST_PLACES = 6
_MOST_CANDIDATES = 12
OVER_WORDS = {
    "velocity": "over velocity",
    "position": "over position",
    "position_direction": "over position that changes sign with direction",
    "reversal_path": "over the path since the last reversal",
    "force": "over motor force",
    "acceleration": "over acceleration",
    "time": "over time",
    "frequency": "of a dynamic system",
    "other_axis": "over the motion of the other axis",
}
_TIMES = {
    "": "",
    "force": " that grows with the motor force",
    "friction": " that changes sign with the direction",
    "history": ", with hysteresis,",
    "reading": "",
}
_OF_FORCE = " of the gap in force"
_CLOSED_OF = {"": "", "innovations": " of the one-step prediction errors"}
_VERDICTS = {
    "no_gap": Fact("No gap", "good"),
    "explained": Fact("Explained", "good"),
    "partly_explained": Fact("Partly explained", "warning"),
    "unexplained": Fact("Unexplained", "bad"),
    "insufficient": Fact("Insufficient", "warning"),
}


def diagnosis_outline(
    report: findings.GapReport, machine: str, measured: Sequence[Measured] = ()
) -> Outline:
    """All that a diagnosis says.

    Args:
        report: of the diagnosis.
        machine: name of the machine.
        measured: the gap of each recording.
    """
    next_moves = () if report.next_experiment is None else (Fact(report.next_experiment.why),)
    repeats = repeat_lines([m.repeats for m in measured])
    return Outline(
        "Sim-to-real gap",
        f"of {machine}",
        [_VERDICTS[report.verdict]],
        headline(report),
        sentence(report.reason),
        facts={"Recordings": ", ".join(report.recordings), "Clock": report.clock},
        figures=_figures(report),
        notices=_notices(report),
        sections={
            "gap": gap_section(report.gap or {}, f"Gap of {machine} (rms)", repeats=repeats),
            "where": Section(
                "Where the gap is",
                tuple(Fact(cell.text, share=cell.share) for cell in report.where),
                label="where",
                note="Share of the gap's energy above the floor, over all axes and signals. Cells "
                "overlap: every sample has a phase, a position and a time.",
                most=_MOST_PLACES,
            ),
            "causes": Section("Causes", list(map(_cause, report.causes)), label="cause"),
            "unlisted": Section(
                "Forces that no effect of the library has",
                [_over_coordinate(found, report.gap or {}) for found in report.unlisted],
                label="unlisted",
                note="Over which coordinate of the motion the missing force is a curve, and how "
                "much of the gap in force along the motion the curve closes on moves that took no "
                "part in its fit.",
            ),
            "steps": _steps(report),
            "empirical": _empirical(report),
            "figures": Section(
                "Plant figures",
                list(map(_changed, report.figures)),
                label="figure",
                note="Figures of the machine file that a twin changes within their tolerance, and "
                "those whose fit ends at its bound, which it keeps. All others stay as they are: "
                "these recordings know less of them than the machine file does.",
            ),
            "alike": Section(
                "Cannot be told apart",
                tuple(
                    Fact(f"{g.axis}: {', '.join(g.effects)}: {g.why}") for g in report.confusable
                ),
                label="alike",
            ),
            "next": Section("Most informative next experiment", next_moves, label="next"),
            "candidates": _candidates(report),
        },
    )


def _notices(report: findings.GapReport) -> list[Fact]:
    """Faults of channels, and what the machine file leaves unknown, as fitted."""
    notices = [
        Fact(f"{f.text} (corrected)" if f.applied else f.text, "good" if f.applied else "warning")
        for f in report.channels
    ]
    notices += [
        Fact(
            f"{f.axis}: {f.figure}: unknown in the machine file, "
            + (f"{f.value:.4g} ± {f.sigma:.2g} {f.unit} fitted" if f.value else "0 fits best")
        )
        for f in report.fitted
    ]
    return notices


def headline(report: findings.GapReport) -> str:
    """The verdict in one sentence."""
    names = [c.effect.replace("_", " ") for c in report.causes]
    axes = [c.axis for c in report.causes]
    if len(set(axes)) == 1:
        named = f"{listed(names)} on {axes[0]}"
    else:
        named = listed([f"{n} on {axis}" for n, axis in zip(names, axes, strict=True)])
    named = named[:1].upper() + named[1:]
    verb = "accounts" if len(report.causes) == 1 else "together account"
    size = "" if report.gap_closed is None else f"{percent(report.gap_closed)} of "
    share = report.gap_closed_elsewhere
    checked = (
        "" if share is None
        else f", on the recordings of --check for {percent(max(share, 0.0))}"
    )  # fmt: skip
    coordinate = ""
    if report.unlisted:
        first = report.unlisted[0]
        closes = f"closes {percent(first.gap_closed)}{_CLOSED_OF[first.seen_in] or _OF_FORCE}"
        coordinate = f"; on {first.axis} {first.what} {OVER_WORDS[first.over]} {closes}"
    match report.verdict:
        case "no_gap":
            if report.gap and combined_floors(report.gap) > LARGEST_OF_PERFECT:
                return "The machine file describes this stage within its tolerance."
            return "The machine file describes this stage down to the noise floor."
        case "explained":
            return f"{named} {verb} for {size}the gap{checked}."
        case "partly_explained":
            size = size or "part of "
            return f"{named} {verb} for {size}the gap{checked}; the rest is unexplained."
        case "unexplained":
            return f"There is a gap, but no known effect explains it{coordinate}."
        case _:
            return "These recordings cannot support a diagnosis."


def gap_section(
    gap: Mapping[str, Mapping[str, findings.GapFigures]],
    title: str,
    *names: str,
    repeats: Sequence[str] = (),
) -> Section:
    """Gaps and floors in µm and N, of axes that turn in µrad and N m.

    Args:
        gap: axis -> signal -> figures.
        title: of the table.
        names: of `nominal` and `explained`; "gap" and "explained" by default.
        repeats: how repeated moves scatter.
    """
    both = any(f.explained is not None for signals in gap.values() for f in signals.values())
    gaps = (names or ("gap", "explained"))[: 2 if both else 1]
    titles = ("axis", "signal", *gaps, "floor", *(f"{name} / floor" for name in gaps))
    rows = []
    for axis, signals in gap.items():
        for signal, of in signals.items():
            scale, unit = findings.SHOWN_AS[of.unit]
            values = [of.nominal, *([of.explained] if both else [])]
            shown = [
                DASH if v is None else f"{digits(v * scale)} {unit}" for v in (*values, of.floor)
            ]
            ratios = [DASH if v is None or of.floor <= 0 else f"{v / of.floor:.1f}" for v in values]
            rows.append((axis, signal, *shown, *ratios))
    note = (
        "Rms of recorded minus simulated. Floor: what a perfect model would still leave, due to "
        "encoder noise and the friction's own scatter, in an average run."
    )
    facts = [Fact(text) for text in (PERFECT_MODEL, *repeats)] if rows else []
    return Section(title, facts, Table(titles, rows), note=note)


def repeat_lines(repeats: Sequence[Mapping[str, Mapping[str, RepeatCheck]]]) -> list[str]:
    """The scatter of repeated moves compared with the floor, one line per axis that has any."""
    lines = []
    for of in repeats:
        for axis, signals in of.items():
            parts = [f"{signal} {check.ratio:.1f} x" for signal, check in signals.items()]
            moves = next(iter(signals.values())).moves
            lines.append(
                f"{axis}: {moves} repeated moves scatter by {', '.join(parts)} "
                "what the machine file's repeatability predicts"
            )
    return lines


def _figures(report: findings.GapReport) -> list[tuple[str, str]]:
    """The key figures: value and meaning."""
    figures = []
    if report.gap:
        floors = combined_floors(report.gap)
        if math.isfinite(floors):
            figures.append((f"{floors:.3g} \u00d7 floor", "gap of the machine file"))
    if report.gap_closed is not None:
        interval = ""
        if report.gap_closed_interval is not None:
            low, high = (100 * end for end in report.gap_closed_interval)
            interval = f" ({low:.0f}{DASH}{high:.0f} %)"
        meaning = f"of the gap closed, on held-out moves{interval}"
        figures.append((percent(report.gap_closed), meaning))
    if report.empirical and report.gap_closed_by_twin is not None:
        share = percent(report.gap_closed_by_twin)
        figures.append((share, "of the gap closed by the twin, with what no effect explains"))
    if report.gap_closed_elsewhere is not None:
        share = percent(report.gap_closed_elsewhere)
        figures.append((share, "closed on the recordings of --check"))
    if report.causes:
        probable = report.causes[0]
        name = probable.effect.replace("_", " ")
        figures.append((percent(probable.probability), f"probability of {name}"))
    return figures


def _cause(cause: findings.Cause) -> Fact:
    """A cause with its figures, what reopens without it, and its remedy."""
    figures = []
    for key, p in cause.parameters.items():
        value, sigma = with_sigma(p.value, p.sigma)
        figures.append(f"{key} {value} ± {sigma} {p.unit if p.unit != '1' else ''}".strip())
    details = []
    if cause.gap_closed is not None:
        ends = cause.gap_closed_interval
        interval = "" if ends is None else f" ({ends[0]:.2f} to {ends[1]:.2f})"
        details.append(
            f"share of the gap that reopens without it: {cause.gap_closed:.2f}{interval}"
        )
    if cause.remedy:
        details.append(cause.remedy)
    text = f"{cause.axis}: {cause.effect}, p = {cause.probability:.2f}"
    text += f": {', '.join(figures)}" if figures else ""
    return Fact(text, details=details, share=cause.probability)


def _over_coordinate(found: findings.Unlisted, gap: findings.Gap) -> Fact:
    """A coordinate that a force depends on, and those that could take its place."""
    low, high = found.gap_closed_interval
    what = f"{found.what} {OVER_WORDS[found.over]}{_TIMES[found.times]}"
    if found.period:
        unit = "mm" if gap[found.axis]["force"].unit == "N" else "mrad"
        what += f", repeating every {1e3 * found.period:.3g} {unit},"
    closed = f"{percent(found.gap_closed)} ({percent(low)} to {percent(high)})"
    text = (
        f"{found.axis}: {what} that no effect of the library has; closes {closed}"
        f"{_CLOSED_OF[found.seen_in]}, p = {found.probability:.2f}"
    )
    if found.alike:
        others = listed([OVER_WORDS[over] for over in found.alike])
        text += f"; these moves cannot tell it from one {others}"
    return Fact(text, share=found.probability)


def _steps(report: findings.GapReport) -> Section:
    facts = []
    for step in report.steps:
        text = f"{step.axis}: {', '.join(step.added)}: {percent(step.gap_closed)} on held-out moves"
        if step.elsewhere is not None:
            text += f"; {percent(step.elsewhere)} on the recordings of --check"
        facts.append(Fact(text, share=step.gap_closed))
    note = (
        "Share of the axis' gap that all effects up to this step close, on moves that took no part "
        "in their fit; on recordings of --check with the figures found here."
    )
    return Section("Step by step", facts, label="step", note=note, most=100)


def _empirical(report: findings.GapReport) -> Section:
    facts = tuple(
        Fact(
            f"{f.axis}: {_described(f)} {percent(f.gap_closed)} of what is left on held-out "
            "strokes; it describes the gap but names no cause"
        )
        for f in report.empirical
    )
    return Section("What no effect explains", facts, label="empirical")


def _described(force: EmpiricalForce) -> str:
    parts = {
        "position": (*force.always, *force.against),
        "direction": force.against,
        "velocity": force.over_velocity,
        "motor force": force.motor_force,
        "the path since a reversal": force.path,
        "motor force, with hysteresis": force.turned,
    }
    over = [name for name, values in parts.items() if any(values)]
    described = [f"a smooth force over {listed(over)}"] if over else []
    if force.gain_at:
        described.append("a factor on the motor force over position")
    if force.misread:
        described.append("an error of the encoder over position")
    return f"{' and '.join(described)} {'close' if len(described) > 1 else 'closes'}"


def _changed(change: findings.FigureChange) -> Fact:
    """A plant figure that the twin changes, or a warning of one that it keeps."""
    unit = "" if change.unit == "1" else f" {change.unit}"
    name = f"{change.axis}: {change.figure}"
    old, new, sigma = change.texts()
    if change.written:
        return Fact(f"{name} {old} → {new} ± {sigma}{unit}: {change.why}")
    text = f"{name} stays {old}{unit}, fitted {new}: {change.why}"
    return Fact(text, "warning", label="warning")


def _candidates(report: findings.GapReport) -> Section:
    ranked = sorted(report.candidates, key=lambda c: -c.probability)
    facts = tuple(
        Fact(
            f"{c.axis}: {c.effect.replace('_', ' ')}, p = {c.probability:.3f}"
            + ("" if c.gap_closed is None else f", gap closed {c.gap_closed:.2f}"),
            share=c.probability,
        )
        for c in ranked
    )
    note = "Gap closed: by the effect alone; of a cause, what reopens without it."
    return Section("Candidates", facts, note=note, most=_MOST_CANDIDATES, on_page=True)
