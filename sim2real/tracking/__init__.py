"""A simulation kept on the recorded course by an extended Kalman filter.

`tracker` runs it and returns the innovations, `kernel` is its compiled loop, and `error_states` is
the linearised error model that its covariance and gains come from.
"""

from sim2real.tracking.error_states import (
    STATES,
    Gains,
    discretise,
    fill_rate_matrix,
    innovation_response,
    propagate_covariance,
)
from sim2real.tracking.tracker import Track, Tracker, needs_other_axes, require_presliding

__all__ = [
    "STATES",
    "Gains",
    "Track",
    "Tracker",
    "discretise",
    "fill_rate_matrix",
    "innovation_response",
    "needs_other_axes",
    "propagate_covariance",
    "require_presliding",
]
