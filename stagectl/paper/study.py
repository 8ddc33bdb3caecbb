"""Runs everything: tables, claims, sensitivity, and the samples for the plots."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from stagectl.paper import claims, sensitivity, tables
from stagectl.paper.claims import Claim
from stagectl.paper.sensitivity import Row
from stagectl.paper.tables import CONDITIONS, INITIAL_NAMES, Case, FixedForce, Tables

NOISY_RUNS = 100
QUICK_RUNS = 20


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
    varied = 0 if quick else sum(1 for _ in sensitivity.variations())
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
    rows = () if quick else sensitivity.compute(case.with_force("aligned"), step)
    return Study(case, found, fixed, judged, rows)
