"""The reason for the verdict of a diagnosis without the controller, in words."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from sim2real.diagnosis.examination import Examination
from sim2real.diagnosis.verdict import name_causes
from sim2real.findings import EXPLAINED, INSUFFICIENT, NO_GAP, Cause
from sim2real.fitting import implausibility
from sim2real.free_loop import FreeSearch
from sim2real.gap import combined_floors
from sim2real.open_loop import FIGURES
from sim2real.scoring.constants import CLOSED, STRANGE
from sim2real.shrinkage import FLOOR_LEVEL


def give_reason(
    verdict: str,
    causes: Sequence[Cause],
    searches: Mapping[str, FreeSearch],
    share: float | None,
    examined: Examination,
) -> str:
    """The reason for a verdict, in one sentence.

    Args:
        verdict: of the report.
        causes: that are named.
        searches: axis -> its search.
        share: of the gap that the causes close, where it is known.
        examined: the recordings.
    """
    highest = min(own.cutoff for motion in examined.motions for own in motion.axes.values())
    mode = (
        f"{examined.open_loop}, so forces are compared along the measured motion, "
        f"up to {highest:.3g} Hz"
    )
    gap = f"the gap in force is {combined_floors(examined.gap or {}):.3g} times the floor"
    if verdict in (NO_GAP, INSUFFICIENT):
        fitted = [f for figures in examined.unknown.values() for f in figures if f in FIGURES]
        if fitted:
            names = " and ".join(dict.fromkeys(fitted))
            return f"{mode}; with {names} as fitted {gap}: noise, and repeatability of friction"
        return f"{mode}; {gap}: within the machine file's tolerance and repeatability"
    if causes:
        verb = "closes" if len(causes) == 1 else "close"
        closed = "" if share is None else f" {verb} {100 * share:.0f} % of it on held-out moves"
        rest = "" if verdict == EXPLAINED else "; the residual still has structure"
        return f"{mode}; {gap}; {name_causes(causes)}{closed}{rest}"
    name, best = max(searches.items(), key=lambda item: item[1].closed)
    if best.steps:
        names = ", ".join(best.steps[-1].effects)
        return (
            f"{mode}; {gap}; the closest match on {name} ({names}) closes "
            f"{100 * best.closed:.0f} % of it on held-out moves, {_why_not(best)}"
        )
    return f"{mode}; {gap}, and no effect of the library shrinks it on held-out moves"


def _why_not(found: FreeSearch) -> str:
    """Why effects that were found are not given as causes."""
    strange = [
        term.name
        for term in found.best.model.terms
        if implausibility(term, found.loop.axis) > STRANGE
    ]
    if found.closed < CLOSED:
        return "too little to be its cause"
    if strange:
        return f"but no real machine shows values like those of {' and '.join(strange)}"
    left = math.sqrt(found.loop.gap(found.best.residual) / FLOOR_LEVEL)
    return f"but {left:.3g} times the floor is left: what acts may be in no list"
