"""Where things stand in the arrays that a move is solved on: unknowns, and rows of samples.

No computation: the names that `zones`, `rows`, `slip_maps` and `window` share.
"""

from __future__ import annotations

from estimation.friction.elements import ELEMENT_ROWS
from estimation.online.belief import LEVEL

SUBSTEPS = 4
"""Of the friction model inside a sample that is not far above the Stribeck velocity."""

# Unknowns behind the figures of `belief`: force of the elements [N] at rest before the move, behind
# the last turn, and when zone A begins; error of the first position [standard deviations], from
# which all travel is counted. The residual has a column between them and the level's knots.
REST_FORCE, TURN_FORCE, SLIP_FORCE, ORIGIN, RESIDUAL, KNOTS = range(LEVEL, LEVEL + 6)
OFFSETS = 4
MOST_KNOTS = 8
MOST = LEVEL + OFFSETS + MOST_KNOTS + 1
"""Most columns of one solve, the residual's included."""

# Tables, one row of samples each: of the data (`zones`), then what a pass leaves.
(
    T_POSITION, T_VELOCITY, T_ACCELERATION, T_FORCE, T_SHARE, T_AT, T_SHARP, T_UNTIL, T_STUCK,
    T_SCALE, T_LEVEL, T_HAZE, T_DECAY, T_GOAL, T_KEPT, T_GAINED, T_SINCE, T_DECAY_BY_RATE,
    T_GOAL_BY_RATE, T_DECAY_BY_ALPHA, T_GOAL_BY_ALPHA, T_SLOPE, T_CURVE,
) = range(23)  # fmt: skip
TABLES = T_CURVE + 2 * SUBSTEPS
"""From T_DECAY on what depends on the shape (C/Fc and alpha) and the motion only, kept while they
stay: what a sample does to the force of all elements while they slip, F <- decay F + goal Fc; the
same from the sample T_SINCE on, F <- kept F + gained Fc; slope of exp(-|v/vs|^delta) by v/vs at the
sample; that curve and the decay of each substep."""
# What of these is valid, and whether the sample is far above the Stribeck velocity.
MAPPED, CURVED, FAST = 1, 2, 4

# Marks, one row of samples each: whether the sample is sound, and its force upset; of the inner
# sample k (sample k + 1) the direction of motion, the zone, whether it can be used, what of the
# tables is valid (MAPPED, CURVED, FAST), and whether the present solve uses it.
M_GOOD, M_UPSET, M_HEADING, M_ZONE, M_USABLE, M_READY, M_USE = range(7)
MARKS = 7

# Room of one update, in few arrays: an argument of a compiled call costs 0.05 us, an array made in
# one some 0.2 us. First what the solves keep besides samples, then the elements, then the samples.
SPARE = 6 * MOST + 5 * MOST * MOST + (LEVEL + 1) ** 2 + MOST


def floats_for(samples: int, elements: int) -> int:
    """Room of a move: the above, tables, columns of unknowns and weights."""
    return SPARE + ELEMENT_ROWS * (elements + 1) + (TABLES + KNOTS + MOST_KNOTS + 4) * samples


def marks_for(samples: int) -> int:
    """The same of the marks, behind which the solves' columns are named."""
    return MARKS * samples + MOST
