"""The observer's model of an axis and its steady-state Kalman gain.

The position shows disturbance and integrator only as their difference, which is what the force
offset has to add: `LACK` = disturbance - integrator. In these coordinates (motor force and outputs
on their way less the integrator, too) the integrator drives nothing and is left out.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_discrete_are

from estimation.observer.loop import (
    DEVIATION,
    FORCE,
    INTEGRAL,
    SLOPE,
    VELOCITY,
    Carriage,
    DriveLoop,
    period_maps,
)
from stagedata import F64

LACK = 4
"""State of the model: disturbance less integrator [N]; those before it are as in
`estimation.observer.loop`, force and the outputs behind it less the integrator."""


class ObserverModel(NamedTuple):
    """One SYNC period of the model, state (N,); offsets as in `PeriodMaps`.

    Attributes:
        transition: (N, N).
        ramp_from, ramp_to: (N,).
        kick: effect of what the drive reads too much through a period [m], (N,).
        gain: Kalman's in the steady state, of a sample's deviation [m], (N,).
        covariance: of the prediction, in the steady state, (N, N).
        spread: of the deviation around its prediction, 1 sigma [m].
        force_ratio: motor force over force offset.
    """

    transition: F64
    ramp_from: F64
    ramp_to: F64
    kick: F64
    gain: F64
    covariance: F64
    spread: float
    force_ratio: float


def make_model(
    drive: DriveLoop, carriage: Carriage, period: float, walk: float, noise: float
) -> ObserverModel:
    """The model of a carriage, its modes left out.

    Args:
        drive: its loop.
        carriage: as assumed.
        period: Ts [s].
        walk: of the disturbance per period, 1 sigma [N].
        noise: of a sampled position [m rms].
    """
    rigid = Carriage(carriage.mass, carriage.stiffness, carriage.viscous)
    maps = period_maps(drive, rigid, period)
    states = len(maps.transition)
    full = np.zeros((states + 1, states + 1))
    full[:states, :states], full[:states, -1], full[-1, -1] = maps.transition, maps.disturbance, 1.0
    change = np.eye(states + 1)
    change[[FORCE, *range(INTEGRAL + 1, states)], INTEGRAL] = -1.0
    change[-1, INTEGRAL] = -drive.force_ratio
    order = [DEVIATION, VELOCITY, FORCE, SLOPE, states, *range(INTEGRAL + 1, states)]
    transition = (change @ full @ np.linalg.inv(change))[np.ix_(order, order)]
    ramp_from, ramp_to, kick = (
        (change @ np.append(effect, 0.0))[order]
        for effect in (maps.ramp_from, maps.ramp_to, maps.noise.sum(axis=1))
    )
    drift = np.zeros_like(transition)
    drift[LACK, LACK] = walk**2
    reads = np.zeros((len(order), 1))
    reads[DEVIATION] = 1.0
    covariance = solve_discrete_are(transition.T, reads, drift, np.array([[noise**2]]))
    spread = float(covariance[DEVIATION, DEVIATION]) + noise**2
    return ObserverModel(
        transition, ramp_from, ramp_to, kick, covariance[:, DEVIATION] / spread, covariance,
        spread**0.5, drive.force_ratio,
    )  # fmt: skip
