"""Force offsets for a motion whose setpoints and force offsets the drive interpolates.

From SYNC to SYNC the drive ramps both. Force offsets for the mass therefore are the second
derivatives of the cubic spline through the setpoints: a ramped acceleration between these takes the
axis from setpoint to setpoint. Samples of the planned acceleration miss the corners of the profile,
each by up to jerk times Ts^2/8 in velocity. And the demand runs along chords of the motion, on
average (Ts^2 - Tc^2)/12 times the acceleration off it; what the position loop makes of that is
taken off the force offset. On the reference stage each was some 50 nm at the end of a move.
"""

from __future__ import annotations

import math

import numpy as np

from estimation.observer import DriveLoop
from estimation.trajectory import Trajectory
from stagedata import F64


def mass_feedforward(
    mass: float, trajectory: Trajectory, samples: int, period: float, ahead: float
) -> F64:
    """Mass times acceleration of a motion from rest, shape (samples,) [N].

    What would be due before the first sample goes into that.

    Args:
        mass: moved [kg].
        trajectory: of the demand; sample k is at time k period, k = 1..samples.
        samples: how many.
        period: of the samples, Ts [s].
        ahead: how much earlier the force is wanted [s].
    """
    early = math.ceil(max(ahead, 0.0) / period) + 2
    rows = np.arange(samples + early + 4, dtype=np.float64)
    time = ahead + period * (rows - 1.0 - early)
    path = trajectory.sample(time)[0] - trajectory.position[0]
    bend = (path[2:] - 2.0 * path[1:-1] + path[:-2]) / period**2
    spline = (8.0 * bend[1:-1] - bend[2:] - bend[:-2]) / 6.0
    spline[early : early + 1] += sum(spline[:early].tolist())
    result: F64 = mass * spline[early:]
    return result


def chord_force(drive: DriveLoop, trajectory: Trajectory, samples: int, period: float) -> F64:
    """What the position loop adds because its demand is interpolated, shape (samples,) [N].

    Args:
        drive: its position loop.
        trajectory: as of `mass_feedforward`.
        samples: how many.
        period: of the samples [s].
    """
    off = (period**2 - drive.control_period**2) / 12.0
    number = np.arange(samples + 1, dtype=np.float64)
    _, velocity, acceleration = trajectory.sample(period * (number[:-1] + 1.0))
    edges = trajectory.sample(period * (number + 0.5) - drive.derivative_time)[2]
    jerk = np.diff(edges) / period
    return (off * drive.kp) * acceleration + (off * drive.ki) * velocity + (off * drive.kd) * jerk


def against_lag(force: F64, lag: float, period: float, moving: bool = False) -> F64:
    """Force offsets that bring about a force in spite of the current loop's lag, same shape [N].

    The inverse of a first-order lag is the force plus the lag times its rate. To send the force
    earlier by the lag makes up for a delay: with 0.6 ms it leaves 150 nm at the end of a move.

    Args:
        force: wanted at every sample, relative to the sample before the first, shape (K,) [N].
        lag: time constant of the current loop [s].
        period: of the samples [s].
        moving: at the sample before the first the axis moves, its offset with the lag made up for.
    """
    around = np.concatenate(([0.0], force))
    rate = np.append(
        (around[2:] - around[:-2]) / (2.0 * period), (around[-1:] - around[-2:-1]) / period
    )
    first = force[0] / period if moving else 0.0
    return force + lag * (rate - first)
