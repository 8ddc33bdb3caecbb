"""Where things stand in the arrays that a move is solved on: unknowns, and rows of samples.

No computation: the names that `zones`, `rows`, `slip_maps` and `window` share.
"""

from __future__ import annotations

from estimation.belief import LEVEL

SUBSTEPS = 4
"""Of the friction model inside a sample that is not far above the Stribeck velocity."""

# Unknowns behind the figures of `belief`: force of the elements [N] at rest before the move, behind
# the last turn, and when zone A begins; error of the first position [standard deviations], from
# which all travel is counted. The residual has a column between them and the level's knots.
REST_FORCE, TURN_FORCE, SLIP_FORCE, ORIGIN, RESIDUAL, KNOTS = range(LEVEL, LEVEL + 6)
OFFSETS = 4

# Tables, one row of samples each: of the data (`zones`), then what a pass leaves.
(
    T_POSITION, T_VELOCITY, T_ACCELERATION, T_FORCE, T_SHARE, T_AT, T_SHARP, T_UNTIL, T_STUCK,
    T_SCALE, T_LEVEL, T_HAZE, T_DECAY, T_GOAL, T_DECAY_BY_RATE, T_GOAL_BY_RATE, T_DECAY_BY_ALPHA,
    T_GOAL_BY_ALPHA, T_SLOPE, T_CURVE,
) = range(20)  # fmt: skip
TABLES = T_CURVE + 2 * SUBSTEPS
"""From T_DECAY on what depends on the shape (C/Fc and alpha) and the motion only, kept while they
stay: what a sample does to the force of all elements while they slip, F <- decay F + goal Fc; slope
of exp(-|v/vs|^delta) by v/vs at the sample; that curve and the decay of each substep."""
# What of these is valid, and whether the sample is far above the Stribeck velocity.
MAPPED, CURVED, FAST = 1, 2, 4
