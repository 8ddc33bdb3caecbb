"""Tables I and II reproduced: one window and two, with the force as logged and aligned."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

from stagectl.paper import published
from stagectl.paper.fit import METHODS, Fit
from stagectl.paper.signals import Alignment, Borders, Move, Processing, prepare
from stagectl.paper.simulate import Record, Setup, simulate
from stagectl.paper.window import Options

ALIGNMENTS: tuple[Alignment, ...] = ("logged", "aligned")
Tables = dict[str, dict[Alignment, Fit]]
"""By method ("one_window", "two_windows"), then by alignment of the force."""

record = lru_cache(maxsize=4)(simulate)


@dataclass(frozen=True, slots=True)
class Case:
    """Choices of everything that the paper leaves open."""

    setup: Setup = field(default_factory=Setup)
    processing: Processing = field(default_factory=Processing)
    borders: Borders = field(default_factory=Borders)
    options: Options = field(default_factory=Options)

    def record(self) -> Record:
        """The move, simulated."""
        return record(self.setup)

    def move(self) -> Move:
        """The signals of the move."""
        return prepare(self.record(), self.processing, self.borders)

    def fit(self, method: str) -> Fit:
        """Fit the move by one of `METHODS`."""
        return METHODS[method](self.move(), self.options)

    def with_force(self, force: Alignment) -> Case:
        """This case with the force as logged or aligned."""
        return replace(self, processing=replace(self.processing, force=force))


def compute(case: Case) -> Tables:
    """Both methods on the force as logged and aligned."""
    return {
        method: {force: case.with_force(force).fit(method) for force in ALIGNMENTS}
        for method in METHODS
    }


def error(fit: Fit, name: str) -> float:
    """Estimate over reference value, minus 1."""
    return fit.value[name] / published.REFERENCE[name] - 1


def as_json(tables: Tables) -> dict[str, Any]:
    """Plain numbers, SI units; iterations and evaluations of all windows together.

    A sigma is None where the fit says nothing of that parameter.
    """
    return {
        method: {
            force: {
                **{
                    name: {
                        "value": fit.value[name],
                        "sigma": fit.sigma[name] if math.isfinite(fit.sigma[name]) else None,
                    }
                    for name in published.PARAMETERS
                },
                "mse": fit.mse,
                "iterations": sum(fit.iterations),
                "evaluations": sum(fit.evaluations),
            }
            for force, fit in fits.items()
        }
        for method, fits in tables.items()
    }
