"""Tables I and II with zone A's initial element force fixed, so that it does not follow Fc.

The paper's counts of evaluations per iteration, parameters + 2, leave no room for it as an unknown.
How p >= 0 is kept decides where one window ends, so both ways are computed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from stagectl.paper import published
from stagectl.paper.fit import METHODS, Fit
from stagectl.paper.tables import Case, Tables, as_json, compute
from stagectl.paper.window import Bounds, Initial

INITIAL_NAMES: dict[Initial, str] = {
    "reference": "reference slip force",
    "measured": "measured u - m a - sigma_v v",
}
BOUNDS_NAMES: dict[Bounds, str] = {"bounded": "bounded", "shortened": "shortened"}
CONDITIONS: dict[Bounds, str] = {
    "bounded": "each step is the minimiser within the bounds",
    "shortened": "a step that would leave the bounds is shortened as a whole",
}
_ON_BOUND = 1e-4  # of the reference value; a halved step ends somewhat above the bound


@dataclass(frozen=True, slots=True)
class FixedForce:
    """Tables I and II for one initial force and one way to keep p >= 0."""

    initial: Initial
    bounds: Bounds
    tables: Tables


def compute_fixed(
    case: Case, progress: Callable[[], None] = lambda: None
) -> tuple[FixedForce, ...]:
    """All combinations; `progress` is called after each."""
    found = []
    for bounds in BOUNDS_NAMES:
        for initial in INITIAL_NAMES:
            options = replace(case.options, initial=initial, bounds=bounds)
            found.append(FixedForce(initial, bounds, compute(replace(case, options=options))))
            progress()
    return tuple(found)


def on_bound(fit: Fit) -> tuple[str, ...]:
    """Parameters that end on their bound 0."""
    return tuple(
        name
        for name in published.PARAMETERS
        if fit.value[name] < _ON_BOUND * published.REFERENCE[name]
    )


def times_fewer(tables: Tables) -> dict[str, float]:
    """Evaluations of one window over those of two, by alignment of the force."""
    one, two = (tables[method] for method in METHODS)
    return {force: sum(one[force].evaluations) / sum(two[force].evaluations) for force in one}


def fixed_as_json(fixed: tuple[FixedForce, ...]) -> list[dict[str, Any]]:
    """Plain numbers, SI units."""
    return [{"initial": v.initial, "bounds": v.bounds, "tables": as_json(v.tables)} for v in fixed]
