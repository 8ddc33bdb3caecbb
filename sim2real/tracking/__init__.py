"""A simulation kept on the recorded course by an extended Kalman filter.

`tracker` runs it and returns the innovations, `kernel` is its compiled loop, and `error_states` is
the linearised error model that its covariance and gains come from.
"""

from sim2real.tracking.error_states import Gains, innovation_response
from sim2real.tracking.tracker import Track, Tracker, needs_other_axes, require_presliding

__all__ = [
    "Gains",
    "Track",
    "Tracker",
    "innovation_response",
    "needs_other_axes",
    "require_presliding",
]
