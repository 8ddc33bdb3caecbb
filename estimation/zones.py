"""Kinematics and zones of a move: onset, zone A (all elements slip), zone B (after the reversal).

Central differences: no lag, and no filter that would bias the estimate. Zone borders come from
positions with hysteresis, never from the sign of a noisy velocity. Zone A is entered late rather
than early: an early start ruins the Coulomb figure, a late one costs little.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from estimation.gms import Friction

F64 = NDArray[np.float64]

REVERSAL_BAND = 20e-9
"""Motion back by this much is a reversal [m]."""
STILL_BAND = 5e-9
"""Less than this from sample to sample is rest [m]."""
SLIP_MARGIN = 6.0
"""Zone A begins after so many breakaway travels (2 would do, were the model right) ..."""
SLIP_PART, SLIP_LEAST = 0.25, 1.1
"""... but not after more than this part of the move, as long as that is past the breakaway: a soft
contact needs millimetres ..."""
SLIP_VELOCITIES = 4.0
"""... and above so many Stribeck velocities."""

REST, STICK, SLIDE = 0, 1, 2
"""Zone codes: not moving; onset or zone B; zone A."""


def split(position: F64, friction: Friction, period: float) -> NDArray[np.int8]:
    """Zone code of each inner sample of a point-to-point move.

    Args:
        position: sampled from rest [m], shape (K,), K >= 3.
        friction: as known before the move.
        period: of the samples [s].

    Returns:
        REST, STICK or SLIDE for samples 1..K-2, shape (K - 2,).
    """
    count = len(position) - 2
    velocity, zone = np.empty(count), np.zeros(count, dtype=np.int8)
    valid = np.ones(len(position), dtype=np.bool_)
    differences(position, valid, period, velocity, np.empty(count), np.empty(count, dtype=np.bool_))
    mark_zones(position, velocity, friction.breakaway_travel, friction.stribeck_velocity, zone)
    return zone


@numba.njit(cache=True)
def differences(position, valid, period, velocity, acceleration, usable):  # type: ignore[no-untyped-def]
    """Central first and second differences at samples 1..K-2, and where all three are valid."""
    for k in range(velocity.shape[0]):
        velocity[k] = (position[k + 2] - position[k]) / (2.0 * period)
        acceleration[k] = (position[k + 2] - 2.0 * position[k + 1] + position[k]) / period**2
        usable[k] = valid[k] and valid[k + 1] and valid[k + 2]


@numba.njit(cache=True)
def mark_zones(position, velocity, breakaway, stribeck_velocity, zone):  # type: ignore[no-untyped-def]
    """Fill the zone codes; `breakaway` is the travel after which all elements slip [m]."""
    count = velocity.shape[0]
    origin = position[0]
    farthest = 0.0
    for k in range(count):
        travel = position[k + 1] - origin
        if abs(travel) > abs(farthest):
            farthest = travel
    heading = 1.0 if farthest >= 0.0 else -1.0
    first = last = -1
    for k in range(count):
        if abs(position[k + 1] - position[k]) > STILL_BAND:
            if first < 0:
                first = k
            last = k
    if first < 0:
        return
    least = max(min(SLIP_MARGIN * breakaway, SLIP_PART * abs(farthest)), SLIP_LEAST * breakaway)
    summit, begun, turned = 0.0, False, False
    for k in range(first, last + 1):
        along = (position[k + 1] - origin) * heading
        begun = begun or along > REVERSAL_BAND
        summit = max(summit, along)
        turned = turned or (begun and summit - along > REVERSAL_BAND)
        sliding = (
            not turned
            and along > least
            and velocity[k] * heading > SLIP_VELOCITIES * stribeck_velocity
        )
        zone[k] = SLIDE if sliding else STICK
