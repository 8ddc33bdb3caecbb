"""Where things stand in the vectors that an update works on: constants, figures, beliefs, result.

No computation; the tables of the samples are in `move_tables`.
"""

from __future__ import annotations

from estimation.online.belief import LEVEL
from estimation.online.move_tables import KNOTS, MOST_KNOTS

# Constants of an axis, as a vector for the kernels.
(
    C_PERIOD, C_POSITION_NOISE, C_FORCE_NOISE, C_MODEL_ERROR, C_WANDER, C_CORRELATION, C_PEAK,
    C_SLIP_SPREAD, C_STEP, C_VS, C_DELTA, C_COMPLETE, C_MISFIT, C_JUMP, C_JUMP_SHARE, C_LEAST,
    C_TYPICAL,
) = range(17)  # fmt: skip
CONSTANTS = 17
"""Last: what misfit this axis' moves usually have."""
# Rows of an axis' table of figures.
F_UNIT, F_LOWER, F_UPPER, F_DRIFT = range(4)
"""Last: standard deviation by which each drifts from move to move."""
FIGURE_ROWS = 4
AXIS = CONSTANTS + FIGURE_ROWS * LEVEL
"""Constants, figures and nu_i come as one vector: each argument of a compiled call costs time."""

# What the kernels report.
(
    R_SLIDE, R_STICK, R_CHI_A, R_CHI_B, R_BOUND, R_EVALUATIONS, R_FAILED, R_SAMPLES, R_KNOWN,
    R_REST_FORCE, R_END, R_FAR, R_TOLD, R_STEADY, R_WHY, R_CODES,
) = range(16)  # fmt: skip
REPORT_SIZE = 16
"""Also what is passed on: Coulomb force in force before the move and force measured at rest [N],
up to which row the move is used, whether it goes FULL_SLIP, whether it can tell sigma0, and the
share of the motion in which the force was not upset; why there is nothing to solve; resolution that
stretches of the force may share an error of [N]."""
MUTE, UNBEGUN = 1.0, 2.0
"""Of R_WHY: it moves, but its force says nothing there; how its elements stood is not known."""

# Which figures are solved for: usually, in moves that do not go far, in those that settle at once.
USUAL, SHORT, CALM = range(3)

# Verdicts.
ACCEPTED, HOLES, SHAKEN, STILL, UNSOLVED, MISFIT, BOUND, JUMP = range(8)

# What an update leaves, behind that report: verdict, the figure that it is about, a
# number that goes with it, misfit and level; then by figure: mean, spread, spread before, gain,
# whether it stays at its prior, and the mean that was found; then the sliding level and its
# variance, before and as found; the covariance.
U_VERDICT, U_FIGURE, U_NUMBER, U_MISFIT, U_LEVEL = range(REPORT_SIZE, REPORT_SIZE + 5)
U_MEAN = REPORT_SIZE + 5
U_SPREAD, U_BEFORE, U_GAIN, U_HELD, U_FOUND = (U_MEAN + i * (LEVEL + 1) for i in range(1, 6))
U_SLIDING = U_FOUND + LEVEL + 1
U_COVARIANCE = U_SLIDING + 4
UPDATE_SIZE = U_COVARIANCE + (LEVEL + 1) ** 2

# Beliefs of one move, end to end: mean before it and after it, their covariances, the unknowns,
# the figures that the elements were last led through with, and the solution.
B_BEFORE, B_FOUND, B_SPREAD = 0, LEVEL + 1, 2 * (LEVEL + 1)
B_UNCERTAIN = B_SPREAD + (LEVEL + 1) ** 2
B_UNKNOWNS = B_UNCERTAIN + (LEVEL + 1) ** 2
B_LED = B_UNKNOWNS + KNOTS + MOST_KNOTS
B_SOLVED = B_LED + LEVEL
BELIEFS = B_SOLVED + LEVEL
