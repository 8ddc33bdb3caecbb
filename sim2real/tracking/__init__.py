"""A simulation kept on the recorded course by an extended Kalman filter.

`tracker` runs it and returns the innovations, `kernel` is its compiled loop, and `error_states` is
the linearised error model that its covariance and gains come from.
"""

from sim2real.tracking.error_states import Gains as Gains
from sim2real.tracking.error_states import innovation_response as innovation_response
from sim2real.tracking.tracker import Track as Track
from sim2real.tracking.tracker import Tracker as Tracker
from sim2real.tracking.tracker import require_presliding as require_presliding
