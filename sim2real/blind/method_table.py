"""The diagnosis and other methods on the same sealed stages, in rows of one table."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from sim2real.blind.outcome import Outcome
from sim2real.blind.score import Pair, confident, true_pairs


@dataclass(frozen=True, slots=True)
class _Answer:
    """What a method named, what its model closed on the second run, and its processor time."""

    true: set[Pair]
    named: set[Pair]
    closed: float | None
    processor: float


def compare_methods(outcomes: Sequence[Outcome], methods: Sequence[str]) -> list[list[str]]:
    """Rows of text: what is counted, this diagnosis, then each method.

    Args:
        outcomes: of trials that all methods were asked about.
        methods: their names.
    """
    tables = [[(o.kind, _own(o)) for o in outcomes]]
    tables += [[(o.kind, _other(o, method)) for o in outcomes] for method in methods]
    rows: list[list[str]] = []
    counted: tuple[tuple[str, tuple[str, ...], Callable[[_Answer], bool]], ...] = (
        ("one effect: named", ("one",), lambda a: a.true <= a.named),
        ("one effect: named, and nothing else", ("one",), lambda a: a.true == a.named),
        ("two effects: both named", ("two",), lambda a: a.true <= a.named),
        ("two effects: both, and nothing else", ("two",), lambda a: a.true == a.named),
        ("several on one axis: all named", ("several",), lambda a: a.true <= a.named),
        ("several on one axis: all, and nothing else", ("several",), lambda a: a.true == a.named),
        ("no effect, or of no family: nothing named", ("none", "outside"), lambda a: not a.named),
    )
    for text, kinds, holds in counted:
        each = [[holds(a) for kind, a in table if kind in kinds] for table in tables]
        if each[0]:
            rows.append([text, *(f"{sum(found)} of {len(found)}" for found in each)])
    acting = ("one", "two", "several")
    closed = [[a.closed or 0.0 for kind, a in table if kind in acting] for table in tables]
    if closed[0]:
        rows.append(
            ["gap closed on the second run, median", *(f"{np.median(c):.2f}" for c in closed)]
        )
    spent = [[a.processor for _, a in table] for table in tables]
    rows.append(["processor seconds, median", *(f"{np.median(each):.0f}" for each in spent)])
    return rows


def _own(outcome: Outcome) -> _Answer:
    return _Answer(true_pairs(outcome), confident(outcome), outcome.second, outcome.processor)


def _other(outcome: Outcome, method: str) -> _Answer:
    said = outcome.baselines[method]
    return _Answer(true_pairs(outcome), set(said.named), said.second, said.processor)
