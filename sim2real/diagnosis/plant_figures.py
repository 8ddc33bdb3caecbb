"""Which of the machine file's plant figures a diagnosis changes: those that its recordings know.

The fit moves all figures within their tolerance, also those that the moves say nothing of: an axis
that rests shows no mass. Such a figure stays as the machine file has it, and the others are taken
as they are beside it. A recording knows a figure where it tells at least as much of it as the
machine file does: where one sigma is at most the tolerance over the square root of two.

A figure whose fit ends at its bound is not known either, since a larger deviation would fit better:
something else acts like it. It stays, and is reported as a warning.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hil_sim.settings import AxisSettings
from sim2real.attribution import AxisResult
from sim2real.axis_units import unit_on
from sim2real.findings import FigureChange
from sim2real.fitting import (
    BASE,
    MAX_SIGMAS,
    NUISANCES,
    STEP,
    AxisModel,
    invert_scaled,
    plant_figure,
    with_base,
)
from sim2real.scoring.constants import RELATIVE, WANDER_SHARE

F64 = NDArray[np.float64]

_UNITS = ("kg", "N", "N s/m", "N/m", "1", "m/s", "N/s")
"""Units of `BASE`."""
_AT_BOUND = MAX_SIGMAS * (1.0 - 1e-6)
_KNOWN = math.sqrt(0.5)
"""Largest sigma of a figure that is known, in tolerances."""


@dataclass(frozen=True, slots=True, eq=False)
class FittedFigures:
    """The figures of one axis as fitted.

    Attributes:
        axis: by the machine file.
        model: the final one.
        covariance: of the base parameters in tolerances, then of the effects' coordinates,
            float64[P, P].
        tolerance: relative standard deviations of the base parameters, float64[STEP].
        scatter: scatter of figures over stages, over what the covariance gives.
    """

    axis: AxisSettings
    model: AxisModel
    covariance: F64
    tolerance: F64
    scatter: float = 1.0


def figures_of(result: AxisResult) -> FittedFigures:
    """The figures of a search."""
    spread = result.spread[:STEP].copy()
    return FittedFigures(
        result.axis, result.best.model, result.covariance(), spread, result.scatter
    )


def settle_figures(
    fitted: FittedFigures, unknown: Collection[str] = ()
) -> tuple[AxisModel, tuple[FigureChange, ...]]:
    """The model with the figures that a twin gets, and what changes in the machine file.

    Args:
        fitted: of the axis.
        unknown: figures that the machine file leaves unknown: they have no value to stay at, and
            are not among the changes.
    """
    deviation = fitted.model.base[:STEP] / fitted.tolerance
    at_bound = np.abs(deviation) >= _AT_BOUND
    lost = np.array([key in unknown for key in BASE])
    kept = at_bound & ~lost
    while True:
        moved = _beside(fitted, deviation, kept)
        sigma = _sigmas(fitted, moved, kept)
        poor = ~(sigma <= _KNOWN) & ~kept & ~lost  # nor is one whose sigma is no number
        beyond = (np.abs(moved) >= _AT_BOUND) & ~kept & ~lost
        if not (poor | beyond).any():
            break
        # One after another: beside a figure that stays, others may be known.
        doubt = np.nan_to_num(sigma, nan=math.inf)
        worst = np.where(beyond, math.inf, np.where(poor, doubt, -math.inf))
        kept[int(np.argmax(worst))] = True
    base = fitted.model.base.copy()
    base[:STEP] = np.clip(moved, -MAX_SIGMAS, MAX_SIGMAS) * fitted.tolerance
    changes = [_change(fitted, j, base, sigma[j]) for j in np.flatnonzero(~(kept | lost)).tolist()]
    changes += [
        _change(fitted, j, fitted.model.base, None)
        for j in np.flatnonzero(at_bound & ~lost).tolist()
    ]
    return replace(fitted.model, base=base), tuple(c for c in changes if c.new != c.old)


def _beside(fitted: FittedFigures, deviation: F64, kept: NDArray[np.bool_]) -> F64:
    """Deviations where those kept are 0, float64[STEP]: the others as they are likeliest then.

    Effects keep their values, which are reported.
    """
    moved = np.where(kept, 0.0, deviation)
    if kept.any():
        given = np.ones(len(fitted.covariance), dtype=np.bool_)
        given[:STEP] = kept
        change = np.zeros(len(given))
        change[:STEP] = moved - deviation
        inverse = invert_scaled(fitted.covariance[np.ix_(given, given)])
        along = fitted.covariance[np.ix_(~given, given)] @ inverse @ change[given]
        moved[~given[:STEP]] += along
    return np.asarray(moved)


def _sigmas(fitted: FittedFigures, deviation: F64, kept: NDArray[np.bool_]) -> F64:
    """One sigma of each figure beside those kept, in tolerances, float64[STEP].

    As for the parameters of causes (`attribution.causes`): of the fit, of the model's inaccuracy,
    and of the friction's wander.
    """
    variance = np.diag(fitted.covariance)[:STEP].copy()
    if kept.any():
        own = np.flatnonzero(kept)
        across = fitted.covariance[:STEP, own]
        inverse = invert_scaled(fitted.covariance[np.ix_(own, own)])
        variance -= np.einsum("ij,jk,ik->i", across, inverse, across)
    own_part = fitted.scatter * np.sqrt(np.maximum(variance, 0.0))
    wander = np.zeros(STEP)
    wander[BASE.index("coulomb")] = WANDER_SHARE * fitted.axis.wander
    return np.asarray(
        np.sqrt(own_part**2 + (RELATIVE * deviation) ** 2 + (wander / fitted.tolerance) ** 2)
    )


def _change(fitted: FittedFigures, j: int, base: F64, sigma: float | None) -> FigureChange:
    """A figure that changes, `sigma` in tolerances; None: its fit ends at its bound."""
    tolerance = float(fitted.tolerance[j])
    relative = (MAX_SIGMAS if sigma is None else float(sigma)) * tolerance
    why = (
        f"the fit ends at its bound of {MAX_SIGMAS:g} tolerances: these moves do not determine it, "
        "or something else acts like it"
    )
    if sigma is not None:
        why = (
            f"known to {100 * relative:.2g} % with these recordings, "
            f"to {100 * tolerance:.2g} % without"
        )
    alone = np.zeros(NUISANCES)
    alone[j] = base[j]
    key = BASE[j]
    old, new = (plant_figure(axis, key) for axis in (fitted.axis, with_base(fitted.axis, alone)))
    unit = unit_on(fitted.axis, _UNITS[j])
    return FigureChange(
        fitted.axis.name, key, old, new, relative * abs(old), unit, sigma is not None, why
    )
