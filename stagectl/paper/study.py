"""Runs everything: tables, claims, and the sensitivity to what the paper leaves open.

For that, one choice at a time is changed in the given case.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from stagectl.paper import claims, tables
from stagectl.paper.case import Case
from stagectl.paper.claims import Claim
from stagectl.paper.fit import Fit, fit
from stagectl.paper.published import REFERENCE
from stagectl.paper.tables import ALIGNMENTS, CONDITIONS, INITIAL_NAMES, Fixed, Tables

NOISY_RUNS = 100
QUICK_RUNS = 20


Variation = tuple[str, str, Mapping[str, Any]]
"""Group, choice, and what it changes in the case."""


class Row(NamedTuple):
    """What was varied (`group`), to what (`choice`), and the fit of two windows or why none."""

    group: str
    choice: str
    fit: Fit | str


def vary(case: Case, progress: Callable[[], None] = lambda: None) -> tuple[Row, ...]:
    """All rows; `progress` is called after each."""
    rows = []
    for group, choice, changes in variations():
        try:
            rows.append(Row(group, choice, fit(replace(case, **changes), "two_windows")))
        except ValueError as error:
            rows.append(Row(group, choice, str(error)))
        progress()
    return tuple(rows)


def variations() -> Iterator[Variation]:
    """What is changed, row by row."""
    rates = {f"{k} kHz": {"rate": 1000 * k} for k in (20, 10, 4, 1)}
    yield from _with_both_forces("sample rate", rates)
    profiles = {name: {"profile": name} for name in ("sine", "jerk-limited")}
    yield from _with_both_forces("profile", profiles)
    gains: dict[str, Any] = {f"{b:.0f} Hz": {"bandwidth": b} for b in (50.0, 100.0, 200.0)}
    gains["acceleration feedforward"] = {"feedforward": True}
    yield from _with_both_forces("gains", gains)
    filters: dict[str, Any] = {
        f"{cut_off:.0f} Hz, {words}": {"cut_off": cut_off, "filter_force": filtered}
        for filtered, words in ((True, "force too"), (False, "force not"))
        for cut_off in (50.0, 100.0, 200.0, 500.0)
    }
    filters |= {"none": {"cut_off": None}, "order 1": {"order": 1}, "order 4": {"order": 4}}
    yield from _each("filter", filters)
    yield from _each("start of zone A", {f"{mm} mm": {"onset": mm * 1e-3} for mm in (1, 2, 3, 6)})
    borders = {
        f"{shift:+d} ms, {words}": {"shift": shift * 1e-3, "turned": turned}
        for turned, words, shifts in (
            (True, "elements stick", (-10, -5, -2, -1, 1, 5)),
            (False, "elements slip on", (-10, -5, -2, -1)),
        )
        for shift in shifts
    }
    yield from _each("border of A and B", borders)
    durations = {f"{ms} ms": {"stick": ms * 1e-3} for ms in (5, 10, 20, 100)}
    yield from _each("duration of zone B", durations)
    initials = {initial: {"initial": initial} for initial in ("tied", "free")}
    yield from _with_both_forces("initial forces", initials)
    starts = {
        f"{factor:g} times": {"start": tuple(factor * value for value in REFERENCE.values())}
        for factor in (0.1, 2.0, 3.0)
    }
    starts["Fc 0.5, C 10, sigma_v 3, sigma0 0.3 times"] = {"start": (1.0, 40.0, 3.0, 300.0)}
    yield from _each("first iterate", starts)


def _each(group: str, choices: Mapping[str, Mapping[str, Any]]) -> Iterator[Variation]:
    return ((group, choice, changes) for choice, changes in choices.items())


def _with_both_forces(group: str, choices: Mapping[str, Mapping[str, Any]]) -> Iterator[Variation]:
    for force in ALIGNMENTS:
        for choice, changes in choices.items():
            yield group, f"{choice}, {force}", {**changes, "force": force}


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
    fixed: Fixed
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
    rows = () if quick else vary(replace(case, force="aligned"), step)
    return Study(case, found, fixed, judged, rows)
