"""How far a model shrinks the free-run gap, also on moves that took no part in its fit.

`closed_loop` computes the gap of one axis under a model, `held_out` the residuals on moves that a
fit did not see, and `bootstrap` the share of the gap closed there, with its interval.
"""

from sim2real.shrinkage.bootstrap import combined_energy, share_closed, share_given_back
from sim2real.shrinkage.closed_loop import FLOOR_LEVEL, axis_gap
from sim2real.shrinkage.held_out import FOLDS, HeldOut

__all__ = [
    "FLOOR_LEVEL",
    "FOLDS",
    "HeldOut",
    "axis_gap",
    "combined_energy",
    "share_closed",
    "share_given_back",
]
