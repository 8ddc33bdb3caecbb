"""The reason for the verdict of a diagnosis, in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from sim2real.attribution import AxisResult
from sim2real.diagnosis.examination import Examination
from sim2real.findings import EXPLAINED, INSUFFICIENT, NO_GAP, SHOWN_AS, Cause
from sim2real.fitting import implausibility
from sim2real.free_loop import FreeSearch
from sim2real.gap import combined_floors
from sim2real.open_loop import FIGURES
from sim2real.scoring.constants import CLOSED, STRANGE

_FAR_OFF = {"position": 0.1, "force": 0.5}
"""Ratio of a signal's gap to its own standard deviation from which the gap is large, however large
the floor is: the floor of a model that is far off is not reliable."""
_TRAVELLED = 1e-4
"""Smallest standard deviation of an axis' demand at which this ratio is examined [m]."""


def give_reason(
    verdict: str,
    causes: Sequence[Cause],
    results: Mapping[str, AxisResult],
    share: float | None,
    examined: Examination,
    *,
    whole: bool,
) -> str:
    """The reason for a verdict, in one sentence.

    Args:
        verdict: of the report.
        causes: that are named.
        results: axis -> what its search found.
        share: of the gap that the causes close, where it is known.
        examined: the recordings.
        whole: whether nothing but noise is left.
    """
    mode, gap = "", "the combined gap"
    if examined.open_loop is not None:
        highest = min(own.cutoff for motion in examined.motions for own in motion.axes.values())
        gap = "the gap in force"
        mode = (
            f"{examined.open_loop}, so forces are compared along the measured motion, "
            f"up to {highest:.3g} Hz; "
        )
        whole = verdict == EXPLAINED
    gap += f" is {combined_floors(examined.gap or {}):.3g} times the floor"
    if verdict in (NO_GAP, INSUFFICIENT):
        fitted = [f for figures in examined.unknown.values() for f in figures if f in FIGURES]
        if fitted:
            names = " and ".join(dict.fromkeys(fitted))
            return f"{mode}with {names} as fitted {gap}: noise, and repeatability of friction"
        return f"{mode}{gap}: within the machine file's tolerance and repeatability"
    if causes:
        verb = "closes" if len(causes) == 1 else "close"
        # Where structure is left, not all of it is closed.
        most = 1.0 if whole else 0.99
        closed = f" {verb} {100 * min(share or 0.0, most):.0f} % of it on held-out moves"
        closed = "" if share is None else closed
        rest = "" if whole else "; the residual still has structure"
        return f"{mode}{gap}; {name_causes(causes)}{closed}{rest}"
    curves = [each for result in results.values() for each in result.unlisted]
    if curves:
        best = max(curves, key=lambda each: each.probability)
        over = "motor force" if best.over == "force" else best.over.replace("_", " ")
        of = "prediction errors" if best.seen_in else "gap in force on held-out moves"
        return (
            f"{mode}{gap}; on {best.axis} no effect of the library explains it as well as "
            f"{best.what} over {over}, which closes {100 * best.gap_closed:.0f} % of the {of}"
        )
    if examined.open_loop is None:
        far_off = describe_far_off(examined)
        return f"{gap}, and no effect of the library explains it" + (far_off and f"; {far_off}")
    searches = {name: result.free for name, result in results.items() if result.free is not None}
    name, nearest = max(searches.items(), key=lambda item: item[1].closed)
    if nearest.steps:
        names = ", ".join(nearest.steps[-1].effects)
        return (
            f"{mode}{gap}; the closest match on {name} ({names}) closes "
            f"{100 * nearest.closed:.0f} % of it on held-out moves, {_why_not(nearest)}"
        )
    return f"{mode}{gap}, and no effect of the library shrinks it on held-out moves"


def _why_not(search: FreeSearch) -> str:
    """Why effects that were found are not given as causes."""
    strange = [
        term.name
        for term in search.best.model.terms
        if implausibility(term, search.loop.axis) > STRANGE
    ]
    if search.closed < CLOSED or not strange:
        return "too little to be its cause"
    return f"but no real machine shows values like those of {' and '.join(strange)}"


def name_causes(causes: Sequence[Cause]) -> str:
    """Causes in a sentence: a on x, b on y and c on y."""
    *others, last = (f"{cause.effect} on {cause.axis}" for cause in causes)
    return f"{', '.join(others)} and {last}" if others else last


def describe_far_off(examined: Examination) -> str:
    """In words, the signals whose gap is a large part of the recorded signal; "" if there are none.

    A model that far off makes other motions than the stage, and its floor, which is taken from
    them, may be as large as the gap.
    """
    texts = []
    for axis, signals in (examined.gap or {}).items():
        demands = [m.replay.recording.axes[axis].position_demand for m in examined.measured]
        if max(float(np.std(demand)) for demand in demands) < _TRAVELLED:
            continue
        measured = [m.replay.measured()[axis] for m in examined.measured]
        valid = [m.replay.valid(axis) for m in examined.measured]
        for signal, figures in signals.items():
            logged = [m[signal][v] for m, v in zip(measured, valid, strict=True)]
            varies = float(np.sqrt(np.mean([np.var(values) for values in logged])))
            if figures.nominal > _FAR_OFF[signal] * varies:
                scale, unit = SHOWN_AS[figures.unit]
                texts.append(
                    f"the {signal} of {axis} is simulated {figures.nominal * scale:.3g} {unit} rms "
                    f"off, and varies by {varies * scale:.3g} {unit}"
                )
    return ", and ".join(texts)
