"""Recursive filters of measured signals.

`scipy.signal.lfilter` does the same; to import it takes a second of processor time, more than all
filtering of most diagnoses.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from stagedata import F64
from stagedata.compiled import kernel


def filtered(
    numerator: Sequence[float] | F64, denominator: Sequence[float] | F64, values: F64
) -> F64:
    """Values behind a filter b(z)/a(z) that was at rest at 0 before them.

    Args:
        numerator: b, in rising powers of the delay, at most as many as of the denominator.
        denominator: a, two or more.
        values: float64[T] or float64[n, T].

    Returns:
        Shaped as the values.
    """
    a = np.asarray(denominator, dtype=np.float64)
    b = np.zeros(len(a))
    b[: len(numerator)] = numerator
    out = np.array(values, dtype=np.float64, order="C", ndmin=2)
    _filter_rows(b / a[0], a / a[0], out)
    return out.reshape(np.shape(values))


@kernel(error_model="python")
def _filter_rows(b: F64, a: F64, values: F64) -> None:
    """Filter each row of values float64[n, T] in place (direct form II, transposed)."""
    last = len(a) - 1
    for row in range(len(values)):
        state = np.zeros(last)
        for t in range(values.shape[1]):
            taken = values[row, t]
            given = b[0] * taken + state[0]
            for k in range(last - 1):
                state[k] = state[k + 1] + b[k + 1] * taken - a[k + 1] * given
            state[last - 1] = b[last] * taken - a[last] * given
            values[row, t] = given
