"""Zones of a move, from its positions alone: at rest, sticking (at least in part), sliding.

Zone A, where all slides, is entered late rather than early: an early start ruins the Coulomb
figure, a late one costs little.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimation.friction import breakaway_travel
from estimation.kinematics import differences, find_turns
from stagedata import F64, FrictionFigures
from stagedata.compiled import kernel

SLIP_MARGIN = 6.0
"""Zone A begins after this many breakaway travels (2 would do if the model were right) ..."""
SLIP_PART = 0.25
"""... but not after more than this share of the move."""
FAR_LONGER = 5.0
"""Zone A is in the first motion in one direction, unless a later one is this many times as long."""
SLIP_VELOCITIES = 4.0
"""Zone A is only where the speed is above this many Stribeck velocities."""

REST, STICK, SLIDE = 0, 1, 2
"""Zone codes: at rest; onset or zone B; zone A."""


def split(
    position: F64, friction: FrictionFigures, period: float, noise: float = 1e-9
) -> NDArray[np.int8]:
    """Zone code of each inner sample of a point-to-point move.

    Args:
        position: sampled from rest [m], shape (K,), K >= 3.
        friction: as known before the move.
        period: of the samples [s].
        noise: rms of a sampled position [m].

    Returns:
        REST, STICK or SLIDE for samples 1..K-2, shape (K - 2,).
    """
    count = len(position) - 2
    velocity, zone = np.empty(count), np.zeros(count, dtype=np.int8)
    heading = np.zeros(count, dtype=np.int8)
    share, at, sharp = np.empty(count), np.empty(count), np.empty(count)
    valid = np.ones(len(position), dtype=np.bool_)
    differences(position, valid, period, velocity, np.empty(count), np.empty(count, dtype=np.bool_))
    find_turns(position, noise, heading, share, at, sharp)
    mark_zones(
        position, velocity, heading, breakaway_travel(friction), friction.stribeck_velocity, zone
    )
    return zone


@kernel()
def mark_zones(position, velocity, heading, breakaway, stribeck_velocity, zone):  # type: ignore[no-untyped-def]
    """Write the zone codes, shape (K,).

    `position` [m], shape (K + 2,); `velocity` [m/s] and `heading`, shape (K,); `breakaway`: travel
    after which all slides [m]; `stribeck_velocity` [m/s].
    """
    count = velocity.shape[0]
    # The first way in one direction, unless a later one is far longer: that was noise, or a kick.
    first = turned = k = 0
    farthest = 0.0
    while k < count:
        start, k = k, k + 1
        while k < count and heading[k] == heading[start]:
            k += 1
        along = (position[k] - position[start]) * heading[start]
        if along > FAR_LONGER * farthest and heading[start] != 0:
            first, turned, farthest = start, k, along
    origin = position[first]
    # A quarter of the move at most, as long as that is past the breakaway.
    travel = max(min(SLIP_MARGIN * breakaway, SLIP_PART * farthest), 1.1 * breakaway)
    for k in range(count):
        zone[k] = STICK if heading[k] != 0 else REST
    if heading[first] != 0:
        _mark_slide(
            position[first + 1 : turned + 1], velocity[first:turned], float(heading[first]), origin,
            travel, SLIP_VELOCITIES * stribeck_velocity, zone[first:turned],
        )  # fmt: skip


@kernel()
def _mark_slide(position, velocity, direction, origin, travel, speed, zone):  # type: ignore[no-untyped-def]
    """Where a motion is past `travel` and faster than `speed`."""
    for k in range(zone.shape[0]):
        far = (position[k] - origin) * direction > travel
        zone[k] = SLIDE if far and velocity[k] * direction > speed else STICK
