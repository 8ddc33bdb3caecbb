"""Where the horizon splits: onset, zone A (all elements slip), zone B (stick after the reversal).

Borders come from positions with hysteresis, never from the sign of a noisy velocity. Zone A is
entered late rather than early: an early start ruins the Coulomb figure, a late one costs little.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation.gms import Friction
from estimation.kinematics import Kinematics

REVERSAL_BAND = 20e-9
"""Motion back by this much is a reversal [m]."""
SLIP_MARGIN = 6.0
"""Zone A begins after so many breakaway travels (2 would do, were the model right)."""
SLIP_VELOCITIES = 4.0
"""... and above so many Stribeck velocities."""


@dataclass(frozen=True, slots=True)
class Zones:
    """Which samples belong to which zone; boolean, shape (K,).

    Attributes:
        slide: zone A: all elements slip, until the first reversal.
        stick: the onset before all elements slip, and zone B behind the first reversal or stop.
        moving: samples from the onset to the last motion.
    """

    slide: NDArray[np.bool_]
    stick: NDArray[np.bool_]
    moving: NDArray[np.bool_]


def split(motion: Kinematics, start: float, friction: Friction) -> Zones:
    """Split a point-to-point move that began at rest at `start` [m].

    Args:
        motion: of the move, settling included, shape (K,).
        start: position at rest before it [m].
        friction: as known before the move.
    """
    travel = motion.position - start
    count = len(travel)
    heading = 1.0 if travel[int(np.argmax(np.abs(travel)))] >= 0 else -1.0
    along = travel * heading
    summit = np.maximum.accumulate(along)
    index = np.arange(count)
    left = along > REVERSAL_BAND
    turned = (summit - along > REVERSAL_BAND) & (
        index > (int(np.argmax(left)) if left.any() else count)
    )
    forward = int(np.argmax(turned)) if turned.any() else count
    slide = (
        (index < forward)
        & (along > SLIP_MARGIN * friction.breakaway_travel)
        & (motion.velocity * heading > SLIP_VELOCITIES * friction.stribeck_velocity)
    )
    changed = np.abs(np.diff(motion.position, prepend=start)) > REVERSAL_BAND / 4
    active = np.nonzero(changed)[0]
    moving = np.zeros(count, dtype=np.bool_)
    if len(active):
        moving[active[0] : active[-1] + 1] = True
    return Zones(slide, moving & ~slide, moving)
