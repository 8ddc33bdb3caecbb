"""The similarity of effects in a recording: the cosine between their signatures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

Pairs = dict[tuple[str, str], float]
"""(effect, effect) -> 0 (distinguishable) to 1 (identical)."""


def signature_similarity(
    signatures: Mapping[str, NDArray[np.float64]], names: Sequence[str]
) -> Pairs:
    """Absolute cosine of each pair of signatures, 0 to 1.

    Args:
        signatures: effect -> its part of the residual that base parameters cannot take up,
            float64[R], all in one unit.
        names: effects to compare; those without a signature are left out.
    """
    units = {}
    for name in names:
        if name in signatures:
            size = float(np.linalg.norm(signatures[name]))
            if np.isfinite(size) and size > 0.0:
                units[name] = signatures[name] / size
    return {
        (one, other): min(abs(float(units[one] @ units[other])), 1.0)
        for one, other in combinations(units, 2)
    }
