"""Tables I and II reproduced: one window and two, with the force as logged and aligned.

Also with zone A's initial element force fixed, so that it does not follow Fc: the paper's counts of
evaluations per iteration, parameters + 2, leave no room for it as an unknown. How p >= 0 is kept
decides where one window ends, so both ways are computed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import product
from typing import Any

from stagectl.paper.case import Alignment, Bounds, Case, Initial
from stagectl.paper.fit import METHODS, Fit, fit
from stagectl.paper.published import PARAMETERS, REFERENCE

ALIGNMENTS: tuple[Alignment, ...] = ("logged", "aligned")
Tables = dict[str, dict[Alignment, Fit]]
"""By method ("one_window", "two_windows"), then by alignment of the force."""
Fixed = Mapping[tuple[Bounds, Initial], Tables]
"""By the way to keep p >= 0, and the initial force."""

INITIAL_NAMES: dict[Initial, str] = {
    "reference": "reference slip force",
    "measured": "measured u - m a - sigma_v v",
}
CONDITIONS: dict[Bounds, str] = {
    "bounded": "each step is the minimiser within the bounds",
    "shortened": "a step that would leave the bounds is shortened as a whole",
}
_ON_BOUND = 1e-4  # of the reference value; a halved step ends somewhat above the bound


def compute(case: Case) -> Tables:
    """Both methods on the force as logged and aligned."""
    return {
        method: {force: fit(replace(case, force=force), method) for force in ALIGNMENTS}
        for method in METHODS
    }


def compute_fixed(case: Case, progress: Callable[[], None] = lambda: None) -> Fixed:
    """With zone A's initial force fixed; `progress` is called after each."""
    found: dict[tuple[Bounds, Initial], Tables] = {}
    for bounds, initial in product(CONDITIONS, INITIAL_NAMES):
        found[bounds, initial] = compute(replace(case, bounds=bounds, initial=initial))
        progress()
    return found


def error(fit: Fit, name: str) -> float:
    """Estimate over reference value, minus 1."""
    return fit.value[name] / REFERENCE[name] - 1


def on_bound(fit: Fit) -> tuple[str, ...]:
    """Parameters that end on their bound 0."""
    return tuple(name for name in PARAMETERS if fit.value[name] < _ON_BOUND * REFERENCE[name])


def one_window_ends(fixed: Fixed, bounds: Bounds) -> list[tuple[str, ...]]:
    """`on_bound` of all fits of one window with the bounds kept this way."""
    found = [tables["one_window"] for (kept, _), tables in fixed.items() if kept == bounds]
    return [on_bound(fits[force]) for fits in found for force in ALIGNMENTS]


def times_fewer(tables: Tables) -> dict[Alignment, float]:
    """Evaluations of one window over those of two, by alignment of the force."""
    one, two = (tables[method] for method in METHODS)
    return {force: sum(one[force].evaluations) / sum(two[force].evaluations) for force in one}


def as_json(tables: Tables) -> dict[str, Any]:
    """Plain numbers, SI units; iterations and evaluations of all windows together.

    A sigma is None where the fit says nothing of that parameter.
    """
    return {
        method: {force: _figures(fit) for force, fit in fits.items()}
        for method, fits in tables.items()
    }


def _figures(fit: Fit) -> dict[str, Any]:
    return {
        **{
            name: {"value": fit.value[name], "sigma": sigma if math.isfinite(sigma) else None}
            for name, sigma in fit.sigma.items()
        },
        "mse": fit.mse,
        "iterations": sum(fit.iterations),
        "evaluations": sum(fit.evaluations),
    }
