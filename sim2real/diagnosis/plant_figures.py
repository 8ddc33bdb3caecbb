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
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sim2real.attribution import AxisResult
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
from stagedata import F64

_UNITS = ("kg", "N", "N s/m", "N/m", "1", "m/s", "N/s")
"""Units of `BASE`."""
_AT_BOUND = MAX_SIGMAS * (1.0 - 1e-6)
_KNOWN = math.sqrt(0.5)
"""Largest sigma of a figure that is known, in tolerances."""


def settle_figures(
    result: AxisResult, unknown: Collection[str] = ()
) -> tuple[AxisModel, tuple[FigureChange, ...]]:
    """The model with the figures that a twin gets, and what changes in the machine file.

    Args:
        result: of the axis' search.
        unknown: figures that the machine file leaves unknown: they have no value to stay at, and
            are not among the changes.
    """
    model, covariance, tolerance = result.best.model, result.covariance(), result.spread[:STEP]
    deviation = model.base[:STEP] / tolerance
    at_bound = np.abs(deviation) >= _AT_BOUND
    lost = np.array([key in unknown for key in BASE])
    kept = at_bound & ~lost
    while True:
        moved = _beside(covariance, deviation, kept)
        sigma = _sigmas(result, covariance, moved, kept)
        poor = ~(sigma <= _KNOWN) & ~kept & ~lost  # nor is one whose sigma is no number
        beyond = (np.abs(moved) >= _AT_BOUND) & ~kept & ~lost
        if not (poor | beyond).any():
            break
        # One after another: beside a figure that stays, others may be known.
        doubt = np.nan_to_num(sigma, nan=math.inf)
        worst = np.where(beyond, math.inf, np.where(poor, doubt, -math.inf))
        kept[int(np.argmax(worst))] = True
    base = model.base.copy()
    base[:STEP] = np.clip(moved, -MAX_SIGMAS, MAX_SIGMAS) * tolerance
    changes = [_change(result, j, base, sigma[j]) for j in np.flatnonzero(~(kept | lost)).tolist()]
    changes += [
        _change(result, j, model.base, None) for j in np.flatnonzero(at_bound & ~lost).tolist()
    ]
    return replace(model, base=base), tuple(c for c in changes if c.new != c.old)


def _beside(covariance: F64, deviation: F64, kept: NDArray[np.bool_]) -> F64:
    """Deviations where those kept are 0, float64[STEP]: the others as they are likeliest then.

    Effects keep their values, which are reported.
    """
    moved = np.where(kept, 0.0, deviation)
    if kept.any():
        given = np.ones(len(covariance), dtype=np.bool_)
        given[:STEP] = kept
        change = np.zeros(len(given))
        change[:STEP] = moved - deviation
        inverse = invert_scaled(covariance[np.ix_(given, given)])
        along = covariance[np.ix_(~given, given)] @ inverse @ change[given]
        moved[~given[:STEP]] += along
    return np.asarray(moved)


def _sigmas(result: AxisResult, covariance: F64, deviation: F64, kept: NDArray[np.bool_]) -> F64:
    """One sigma of each figure beside those kept, in tolerances, float64[STEP].

    As for the parameters of causes (`attribution.causes`): of the fit, of the model's inaccuracy,
    and of the friction's wander.
    """
    variance = np.diag(covariance)[:STEP].copy()
    if kept.any():
        own = np.flatnonzero(kept)
        across = covariance[:STEP, own]
        inverse = invert_scaled(covariance[np.ix_(own, own)])
        variance -= np.einsum("ij,jk,ik->i", across, inverse, across)
    own_part = result.scatter * np.sqrt(np.maximum(variance, 0.0))
    wander = np.zeros(STEP)
    wander[BASE.index("coulomb")] = WANDER_SHARE * result.axis.wander
    return np.asarray(
        np.sqrt(own_part**2 + (RELATIVE * deviation) ** 2 + (wander / result.spread[:STEP]) ** 2)
    )


def _change(result: AxisResult, j: int, base: F64, sigma: float | None) -> FigureChange:
    """A figure that changes, `sigma` in tolerances; None: its fit ends at its bound."""
    tolerance = float(result.spread[j])
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
    old, new = (plant_figure(axis, key) for axis in (result.axis, with_base(result.axis, alone)))
    unit = result.axis.unit_of(_UNITS[j])
    return FigureChange(
        result.axis.name, key, old, new, relative * abs(old), unit, sigma is not None, why
    )
