"""Runs everything: tables, claims, and the sensitivity to what the paper leaves open.

For that, one choice at a time is changed in the given case.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from stagectl.paper import claims, tables
from stagectl.paper.claims import Claim
from stagectl.paper.fit import Fit
from stagectl.paper.published import PARAMETERS, REFERENCE
from stagectl.paper.tables import ALIGNMENTS, CONDITIONS, INITIAL_NAMES, Case, FixedForce, Tables

NOISY_RUNS = 100
QUICK_RUNS = 20


Variation = tuple[str, str, dict[str, Any]]
"""Group, choice, and the changes that `Case.changed` takes."""


@dataclass(frozen=True, slots=True)
class Row:
    """One choice and its estimate.

    Attributes:
        group: what was varied; choice: to what.
        fit: of two windows; None where there is none.
        problem: why there is none.
    """

    group: str
    choice: str
    fit: Fit | None
    problem: str = ""


def vary(case: Case, progress: Callable[[], None] = lambda: None) -> tuple[Row, ...]:
    """All rows; `progress` is called after each."""
    rows = []
    for group, choice, changes in variations():
        try:
            rows.append(Row(group, choice, case.changed(**changes).fit("two_windows")))
        except ValueError as error:
            rows.append(Row(group, choice, None, str(error)))
        progress()
    return tuple(rows)


def variations() -> Iterator[Variation]:
    """What is changed, row by row."""
    yield from _with_both_forces(
        "sample rate", "setup", {f"{k} kHz": {"rate": 1000 * k} for k in (20, 10, 4, 1)}
    )
    profiles = {name: {"profile": name} for name in ("sine", "jerk-limited")}
    yield from _with_both_forces("profile", "setup", profiles)
    gains: dict[str, Any] = {f"{b:.0f} Hz": {"bandwidth": b} for b in (50.0, 100.0, 200.0)}
    gains["acceleration feedforward"] = {"feedforward": True}
    yield from _with_both_forces("gains", "setup", gains)
    filters: dict[str, Any] = {
        f"{cut_off:.0f} Hz, {words}": {"cut_off": cut_off, "filter_force": filtered}
        for filtered, words in ((True, "force too"), (False, "force not"))
        for cut_off in (50.0, 100.0, 200.0, 500.0)
    }
    filters |= {"none": {"cut_off": None}, "order 1": {"order": 1}, "order 4": {"order": 4}}
    yield from _each("filter", "processing", filters)
    onsets = {f"{mm} mm": {"onset": mm * 1e-3} for mm in (1, 2, 3, 6)}
    yield from _each("start of zone A", "borders", onsets)
    for turned, words, shifts in (
        (True, "elements stick", (-10, -5, -2, -1, 1, 5)),
        (False, "elements slip on", (-10, -5, -2, -1)),
    ):
        for shift in shifts:
            changes = {"borders": {"shift": shift * 1e-3}, "options": {"turned": turned}}
            yield "border of A and B", f"{shift:+d} ms, {words}", changes
    durations = {f"{ms} ms": {"stick": ms * 1e-3} for ms in (5, 10, 20, 100)}
    yield from _each("duration of zone B", "borders", durations)
    initials = {initial: {"initial": initial} for initial in ("tied", "free")}
    yield from _with_both_forces("initial forces", "options", initials)
    starts = {
        f"{factor:g} times": {name: factor * value for name, value in REFERENCE.items()}
        for factor in (0.1, 2.0, 3.0)
    }
    mixed = dict(zip(PARAMETERS, (1.0, 40.0, 3.0, 300.0), strict=True))
    starts["Fc 0.5, C 10, sigma_v 3, sigma0 0.3 times"] = mixed
    yield from _each("first iterate", "options", {k: {"start": s} for k, s in starts.items()})


def _each(group: str, part: str, choices: Mapping[str, Any]) -> Iterator[Variation]:
    for choice, changed in choices.items():
        yield group, choice, {part: changed}


def _with_both_forces(group: str, part: str, choices: Mapping[str, Any]) -> Iterator[Variation]:
    for force in ALIGNMENTS:
        for choice, changed in choices.items():
            yield group, f"{choice}, {force}", {part: changed, "processing": {"force": force}}


@dataclass(frozen=True, slots=True)
class Study:
    """Outcome.

    Attributes:
        case: the choices made.
        tables: one window and two, logged and aligned.
        fixed: the same with zone A's initial force fixed.
        claims: the six of the paper.
        sensitivity: empty where it was left out.
    """

    case: Case
    tables: Tables
    fixed: tuple[FixedForce, ...]
    claims: tuple[Claim, ...]
    sensitivity: tuple[Row, ...]


def run(
    case: Case, quick: bool = False, progress: Callable[[int, int], None] = lambda done, total: None
) -> Study:
    """Simulate, fit, judge.

    Args:
        case: choices.
        quick: fewer noisy runs, no sensitivity.
        progress: called with steps done and in all.

    Raises:
        ValueError: a case that cannot be simulated or estimated from.
    """
    runs = QUICK_RUNS if quick else NOISY_RUNS
    varied = 0 if quick else sum(1 for _ in variations())
    total = 1 + len(CONDITIONS) * len(INITIAL_NAMES) + runs + varied
    done = 0

    def step() -> None:
        nonlocal done
        done += 1
        progress(done, total)

    found = tables.compute(case)
    step()
    fixed = tables.compute_fixed(case, step)
    judged = claims.judge(case, found, fixed, runs, step)
    rows = () if quick else vary(case.with_force("aligned"), step)
    return Study(case, found, fixed, judged, rows)
