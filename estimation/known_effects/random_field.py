"""The friction map that a seed stands for: docs/formats/effects.md, "The field of friction_map".

Evaluated along a path at points much closer than the correlation length, and linearly between.
"""

from __future__ import annotations

import math

import numpy as np

from estimation.known_effects.terms import F64, Surface

WAVES = 300
DOMAIN = 0x4D4150
"""First word of the generator's seed."""
_FINER = 25.0
"""Points evaluated per correlation length."""


def random_field(amplitude: float, length: float, seed: int) -> Surface:
    """The factor 1 + amplitude g over the positions of both axes.

    Args:
        amplitude: largest deviation from 1.
        length: correlation length [m].
        seed: of the field.
    """
    generator = np.random.default_rng([DOMAIN, seed])
    along, across = generator.normal(0.0, 1.0 / length, (2, WAVES))
    phase = generator.uniform(0.0, 2.0 * math.pi, WAVES)

    def factor(own: F64, other: F64) -> F64:
        own, other = (np.atleast_1d(np.asarray(x, np.float64)) for x in (own, other))
        gone = np.append(0.0, np.cumsum(np.hypot(np.diff(own), np.diff(other))))
        points = min(len(gone), 2 + int(_FINER * gone[-1] / length))
        nodes = np.linspace(0.0, gone[-1], points)
        near = np.searchsorted(gone, nodes[1:-1])
        rows = np.unique(np.concatenate(([0], near, [len(gone) - 1])))
        angle = np.outer(own[rows], along) + np.outer(other[rows], across) + phase
        normal = math.sqrt(2.0 / WAVES) * np.cos(angle).sum(axis=1)
        level = np.array([math.erf(value / math.sqrt(2.0)) for value in normal])
        return np.asarray(np.interp(np.arange(len(gone)), rows, 1.0 + amplitude * level))

    return factor
