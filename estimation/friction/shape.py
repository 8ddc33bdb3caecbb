"""What the shape of the hysteresis leaves open of sigma0.

The law has N equal springs that slip one after another (`estimation.friction.gms`); a stage need
not have the same number, or springs of any number. From rest to where all slip, its curve of force
over displacement is then another one, and the law fits it best with another sigma0. As long as the
curves differ by no more than what the model is taken to miss anyway, no move tells them apart.

With the displacement in units of Fs/sigma0 and the force in units of Fs, the curve of N elements is
    f_N(u) = sum_i min(u/N, nu_i),  nu_i = 2i/(N(N+1)),
and f_N(s u) fits f_M(u) best, by least squares over 0..2, with a factor s on sigma0.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from estimation.friction.gms import element_shares
from stagedata import F64, MAX_ELEMENTS

_DISPLACEMENT = np.linspace(0.0, 2.0, 201)
"""Up to where the last of very many elements slips, in Fs/sigma0."""
_STEPS = 8
"""Of Gauss-Newton, for each factor."""


def stiffness_doubt(elements: int, error: float) -> float:
    """Standard deviation of sigma0, relative, as the shape of the hysteresis leaves it open.

    A curve that is a share of the way to that of another N is off by that share of both: sigma0,
    and the rms of the force. The share is as large as the rms may be; sigma0 may be anywhere up to
    the largest deviation among all N, either way: a rectangular distribution.

    Args:
        elements: N of the law.
        error: rms of what the model may miss, over Fs.
    """
    factor, misfit = _other_shapes(elements)
    share = np.minimum(error / np.maximum(misfit, 1e-12), 1.0)
    return float(np.abs(share * (factor - 1.0)).max()) / math.sqrt(3.0)


@cache
def _other_shapes(elements: int) -> tuple[F64, F64]:
    """Factor on sigma0 and rms left over Fs, of curves of 1..`MAX_ELEMENTS`, (`MAX_ELEMENTS`,)."""
    curves = np.array([_curve(n, _DISPLACEMENT) for n in range(1, MAX_ELEMENTS + 1)])
    factor = np.ones(MAX_ELEMENTS)
    shares = element_shares(elements)
    for _ in range(_STEPS):
        stretched = factor[:, None] * _DISPLACEMENT
        sticking = stretched[..., None] / elements < shares
        slope = _DISPLACEMENT * sticking.mean(axis=-1)
        missing = curves - _curve(elements, stretched)
        factor += (slope * missing).sum(axis=1) / (slope**2).sum(axis=1)
    left = curves - _curve(elements, factor[:, None] * _DISPLACEMENT)
    return factor, np.asarray(np.sqrt(np.mean(left**2, axis=1)))


def _curve(elements: int, displacement: F64) -> F64:
    """f_N, same shape."""
    springs = np.minimum(displacement[..., None] / elements, element_shares(elements))
    return np.asarray(springs.sum(axis=-1))
