"""Tables I and II reproduced: one window and two, with the force as logged and aligned.

Also with zone A's initial element force fixed, so that it does not follow Fc: the paper's counts of
evaluations per iteration, parameters + 2, leave no room for it as an unknown. How p >= 0 is kept
decides where one window ends, so both ways are computed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

from stagectl.paper.fit import METHODS, Fit
from stagectl.paper.published import PARAMETERS, REFERENCE
from stagectl.paper.signals import (
    Alignment,
    Borders,
    Move,
    Processing,
    prepare,
)
from stagectl.paper.simulate import Record, Setup, simulate
from stagectl.paper.window import Bounds, Initial, Options

ALIGNMENTS: tuple[Alignment, ...] = ("logged", "aligned")
Tables = dict[str, dict[Alignment, Fit]]
"""By method ("one_window", "two_windows"), then by alignment of the force."""

INITIAL_NAMES: dict[Initial, str] = {
    "reference": "reference slip force",
    "measured": "measured u - m a - sigma_v v",
}
CONDITIONS: dict[Bounds, str] = {
    "bounded": "each step is the minimiser within the bounds",
    "shortened": "a step that would leave the bounds is shortened as a whole",
}
_ON_BOUND = 1e-4  # of the reference value; a halved step ends somewhat above the bound

_record = lru_cache(maxsize=4)(simulate)


@dataclass(frozen=True, slots=True)
class Case:
    """Choices of everything that the paper leaves open."""

    setup: Setup = field(default_factory=Setup)
    processing: Processing = field(default_factory=Processing)
    borders: Borders = field(default_factory=Borders)
    options: Options = field(default_factory=Options)

    def record(self) -> Record:
        """The move, simulated."""
        return _record(self.setup)

    def move(self) -> Move:
        """The signals of the move."""
        return prepare(self.record(), self.processing, self.borders)

    def fit(self, method: str) -> Fit:
        """Fit the move by one of `METHODS`."""
        return METHODS[method](self.move(), self.options)

    def changed(self, **parts: Mapping[str, Any]) -> Case:
        """This case with other choices, by attribute: `changed(borders={"shift": 1e-3})`.

        Raises:
            ValueError: a choice that cannot be simulated.
        """
        made = {name: replace(getattr(self, name), **new) for name, new in parts.items()}
        return replace(self, **made)

    def with_force(self, force: Alignment) -> Case:
        """This case with the force as logged or aligned."""
        return self.changed(processing={"force": force})


@dataclass(frozen=True, slots=True)
class FixedForce:
    """Tables I and II for one initial force and one way to keep p >= 0."""

    initial: Initial
    bounds: Bounds
    tables: Tables


def compute(case: Case) -> Tables:
    """Both methods on the force as logged and aligned."""
    return {
        method: {force: case.with_force(force).fit(method) for force in ALIGNMENTS}
        for method in METHODS
    }


def compute_fixed(
    case: Case, progress: Callable[[], None] = lambda: None
) -> tuple[FixedForce, ...]:
    """All initial forces and ways to keep the bounds; `progress` is called after each."""
    found = []
    for bounds in CONDITIONS:
        for initial in INITIAL_NAMES:
            fixed = case.changed(options={"initial": initial, "bounds": bounds})
            found.append(FixedForce(initial, bounds, compute(fixed)))
            progress()
    return tuple(found)


def error(fit: Fit, name: str) -> float:
    """Estimate over reference value, minus 1."""
    return fit.value[name] / REFERENCE[name] - 1


def on_bound(fit: Fit) -> tuple[str, ...]:
    """Parameters that end on their bound 0."""
    return tuple(name for name in PARAMETERS if fit.value[name] < _ON_BOUND * REFERENCE[name])


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
    found: dict[str, Any] = {}
    for name, sigma in fit.sigma.items():
        said = sigma if math.isfinite(sigma) else None
        found[name] = {"value": fit.value[name], "sigma": said}
    counts = {"iterations": sum(fit.iterations), "evaluations": sum(fit.evaluations)}
    return {**found, "mse": fit.mse, **counts}
