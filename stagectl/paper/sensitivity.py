"""Sensitivity of the two-window estimate to what the paper leaves open.

One choice at a time is changed in the given case.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from stagectl.paper.fit import Fit
from stagectl.paper.published import PARAMETERS, REFERENCE
from stagectl.paper.tables import ALIGNMENTS, Case

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


def compute(case: Case, progress: Callable[[], None] = lambda: None) -> tuple[Row, ...]:
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
    yield from _move()
    yield from _filter()
    yield from _zones()
    yield from _solver()


def _move() -> Iterator[Variation]:
    varied: tuple[tuple[str, tuple[tuple[str, dict[str, Any]], ...]], ...] = (
        ("sample rate", tuple((f"{k} kHz", {"rate": k * 1000}) for k in (20, 10, 4, 1))),
        ("profile", tuple((name, {"profile": name}) for name in ("sine", "jerk-limited"))),
        ("gains", (
            *((f"{b:.0f} Hz", {"bandwidth": b}) for b in (50.0, 100.0, 200.0)),
            ("acceleration feedforward", {"feedforward": True}),
        )),
    )  # fmt: skip
    for group, choices in varied:
        for force in ALIGNMENTS:
            for choice, setup in choices:
                changes = {"setup": setup, "processing": {"force": force}}
                yield group, f"{choice}, {force}", changes


def _filter() -> Iterator[Variation]:
    for filtered, words in ((True, "force too"), (False, "force not")):
        for cut_off in (50.0, 100.0, 200.0, 500.0):
            processing = {"cut_off": cut_off, "filter_force": filtered}
            yield "filter", f"{cut_off:.0f} Hz, {words}", {"processing": processing}
    yield "filter", "none", {"processing": {"cut_off": None}}
    for order in (1, 4):
        yield "filter", f"order {order}", {"processing": {"order": order}}


def _zones() -> Iterator[Variation]:
    for onset in (1, 2, 3, 6):
        yield "start of zone A", f"{onset} mm", {"borders": {"onset": onset * 1e-3}}
    for turned, words, shifts in (
        (True, "elements stick", (-10, -5, -2, -1, 1, 5)),
        (False, "elements slip on", (-10, -5, -2, -1)),
    ):
        for shift in shifts:
            changes: dict[str, Any] = {
                "borders": {"shift": shift * 1e-3},
                "options": {"turned": turned},
            }
            yield "border of A and B", f"{shift:+d} ms, {words}", changes
    for stick in (5, 10, 20, 100):
        yield "duration of zone B", f"{stick} ms", {"borders": {"stick": stick * 1e-3}}


def _solver() -> Iterator[Variation]:
    for force in ALIGNMENTS:
        for initial in ("tied", "free"):
            changes: dict[str, Any] = {
                "options": {"initial": initial},
                "processing": {"force": force},
            }
            yield "initial forces", f"{initial}, {force}", changes
    for factor in (0.1, 2.0, 3.0):
        start = {name: factor * value for name, value in REFERENCE.items()}
        yield "first iterate", f"{factor:g} times", {"options": {"start": start}}
    mixed = dict(zip(PARAMETERS, (1.0, 40.0, 3.0, 300.0), strict=True))
    choice = "Fc 0.5, C 10, sigma_v 3, sigma0 0.3 times"
    yield "first iterate", choice, {"options": {"start": mixed}}
