"""Groups of moves, by direction and length: what several of them show is not one path's alone."""

from __future__ import annotations

import math

OCTAVES = 8
GROUPS = 4 * OCTAVES
_SHORTEST = 1e-3
"""End of the first octave of lengths [m]."""


def move_group(travel: float, rested: bool = False) -> int:
    """Group of a move, 0..`GROUPS` - 1.

    Args:
        travel: of the axis, or where it rested, of the other one, with its sign [m].
        rested: whether it rested.
    """
    octave = math.floor(math.log2(max(abs(travel), _SHORTEST) / _SHORTEST))
    return min(octave, OCTAVES - 1) + OCTAVES * (travel < 0.0) + 2 * OCTAVES * rested
