"""The nodes at which an effect is tried: plausible ranges, the travel, waves of what is left."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from hil_sim.effects import Effect, Parameter
from hil_sim.settings import AxisSettings
from sim2real.fitting import Term

Values = tuple[float, ...]
"""Of an effect's parameters, in their order."""

_SHARES = (0.25, 0.5, 0.9)
"""Sizes, as shares of a plausible side, of an effect that has nothing else and must be
simulated."""


@dataclass(frozen=True, slots=True)
class Grid:
    """How finely parameters are tried.

    Attributes:
        places: number of places along the travel, for an effect that also has a shape or another
            place; a single place that merely shifts the effect is found by least squares.
        shapes: number of values of the first shape, for an effect without a place.
        few: number of values of a shape after a place; of a second shape to first order (a second
            shape that has to be simulated is tried in mid-range only).
        beyond: factor by which a logarithmic shape is tried beyond its plausible range.
    """

    places: int
    shapes: int
    few: int
    beyond: float


FIRST_ORDER = Grid(24, 48, 3, 1.25)
"""The grid where a signature costs no simulation."""
SIMULATED = Grid(12, 6, 3, 1.5)
"""The grid where each signature takes a simulation."""

Waves = Callable[[Effect, Parameter], "list[float] | None"]
"""Pitches [m] or frequencies [Hz] at which what is left has its peaks; None where the plausible
range has to be tried."""


def effect_nodes(
    effect: Effect, axis: AxisSettings, travelled: tuple[float, float], grid: Grid, waves: Waves
) -> Iterator[Values]:
    """Values of all parameters to try.

    Args:
        effect: to be tried.
        axis: it acts on.
        travelled: lowest and highest position [m].
        grid: how finely.
        waves: of what is left.
    """
    formed = sum(p.role in ("place", "shape") for p in effect.parameters)
    lone = len(effect.parameters) == 1 and grid is SIMULATED
    grids: list[list[float]] = []
    before: set[str] = set()
    for parameter in effect.parameters:
        found: list[float] | None = None
        if parameter.role == "phase":
            found = [0.0]
        elif parameter.role == "size":
            found = _sizes(parameter, axis, lone)
        elif parameter.role == "place":
            count = grid.places if formed > 1 else 1
            edge = (travelled[1] - travelled[0]) / count / 2.0
            found = list(np.linspace(travelled[0] + edge, travelled[1] - edge, count))
        else:
            found = waves(effect, parameter)
            if found is None:
                found = _shapes(parameter, axis, grid, before)
        before.add(parameter.role)
        grids.append(found)
    yield from itertools.product(*grids)


def typical(effect: Effect, axis: AxisSettings) -> Term:
    """An effect in the middle of its plausible ranges."""
    return Term(effect, tuple(midrange(p, axis) for p in effect.parameters))


def midrange(parameter: Parameter, axis: AxisSettings) -> float:
    """The middle of a parameter's plausible range."""
    low, high = parameter.ranges(axis)[-1]
    return math.sqrt(low * high) if parameter.log else 0.5 * (low + high)


def _shapes(parameter: Parameter, axis: AxisSettings, grid: Grid, before: set[str]) -> list[float]:
    low, high = parameter.ranges(axis)[0]
    if "shape" in before:
        count = grid.few if grid is FIRST_ORDER else 1
    else:
        count = grid.few if "place" in before else grid.shapes
    if count == 1:
        return [midrange(parameter, axis)]
    if parameter.log:
        return list(np.geomspace(low / grid.beyond, high * grid.beyond, count))
    return list(np.linspace(low, high, count))


def _sizes(parameter: Parameter, axis: AxisSettings, several: bool) -> list[float]:
    """Sizes to try on each plausible side of the neutral value: the middle, or several."""
    neutral = parameter.neutral_on(axis)
    found: list[float] = []
    for low, high in parameter.ranges(axis):
        sides = [(low, high)]
        if neutral is not None and low < neutral < high:
            sides = [(neutral, low), (neutral, high)]
        for first, last in sides:
            for share in _SHARES if several else (0.5,):
                if parameter.log:
                    found.append(first * (last / first) ** share)
                else:
                    found.append(first + share * (last - first))
    return found
