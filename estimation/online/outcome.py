"""The result of the update by one move, as the kernels return it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stagedata import F64

ACCEPTED, HOLES, DISTURBED, STILL, UNSOLVED, MISFIT, MISSED, BOUND, JUMP, SCALE = range(10)
"""Verdicts: accepted, or why not. Too many samples missing; force disturbed by late setpoints
in most of the motion; nothing to solve; no solution; residual too large; the model misses too much
in the moves so far; a figure on its bound; a figure that jumps; another force per acceleration."""


class Outcome(NamedTuple):
    """The result of one move; figures are relative to the start model, as in `belief`.

    Attributes:
        verdict: ACCEPTED, or why not.
        figure: that the verdict is about, or -1.
        number: that goes with the verdict; for STILL one of `prepare.TOO_LITTLE` ...
        misfit: rms of the whitened residual.
        slide: samples of zone A that were used.
        stick: the same of the stick zones.
        onset_seen: it was not hidden by samples that are missing or saturated.
        mean: belief after the move, shape (STATES,).
        covariance: of it.
        before: variances before the move, shape (STATES,).
        found: what the solve found, accepted or not, shape (STATES,).
        gain: standard deviations before over after, shape (STATES,).
        held: figures that were asked for and stay at their prior, shape (LEVEL,).
        sliding: Fc (1 + w) and its variance, expected before the move, and found, shape (4,).
        unmodelled: mean square of the unmodelled force found in it, and the share of that force
            that the move determines.
        wander: the same of the level.
        missed: mean square of what is left of the force.
        innovations: of the friction figures, see `judge.normalised_innovations`.
        scatter: how far the move's figures were from those of the axis, see `scatter.temper`.
    """

    verdict: int
    figure: int
    number: float
    misfit: float
    slide: int
    stick: int
    onset_seen: bool
    mean: F64
    covariance: F64
    before: F64
    found: F64
    gain: F64
    held: NDArray[np.bool_]
    sliding: F64
    unmodelled: tuple[float, float]
    wander: tuple[float, float]
    missed: float
    innovations: F64
    scatter: F64
