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
from numpy.typing import NDArray

from estimation.observer import DriveLoop
from estimation.trajectory import Trajectory
from estimation.trajectory_samples import sample_pieces
from stagedata.compiled import kernel

F64 = NDArray[np.float64]


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
    force = np.empty(samples)
    accelerate(trajectory.pieces, mass, period, ahead, force)
    return force


def chord_force(drive: DriveLoop, trajectory: Trajectory, samples: int, period: float) -> F64:
    """What the position loop adds because its demand is interpolated, shape (samples,) [N].

    Args:
        drive: its position loop.
        trajectory: as of `mass_feedforward`.
        samples: how many.
        period: of the samples [s].
    """
    off, force = (period**2 - drive.control_period**2) / 12.0, np.empty(samples)
    gains = off * drive.kp, off * drive.ki, off * drive.kd
    follow_chords(trajectory.pieces, gains, drive.derivative_time, period, force)
    return force


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
    sent = np.empty(len(force))
    lead(force, lag, period, moving, sent)
    return sent


@kernel()
def accelerate(trajectory, mass, period, ahead, force):  # type: ignore[no-untyped-def]
    """`mass_feedforward`, written to `force`, (K,); `trajectory` as of `sample_pieces`."""
    early = math.ceil(max(ahead, 0.0) / period) + 2
    count = force.shape[0] + early + 4
    time, path, unused = np.empty(count), np.empty(count), np.empty(count)
    for k in range(count):
        time[k] = ahead + period * (k - 1 - early)
    sample_pieces(trajectory, time, path, unused, unused)
    origin = trajectory[1][0]
    for k in range(count):
        path[k] -= origin
    bend = np.empty(count - 2)
    for k in range(count - 2):
        bend[k] = (path[k + 2] - 2.0 * path[k + 1] + path[k]) / period**2
    due = 0.0
    for k in range(count - 4):
        spline = (8.0 * bend[k + 1] - bend[k + 2] - bend[k]) / 6.0
        if k < early:
            due += spline
        else:
            force[k - early] = mass * (spline + due)
            due = 0.0


@kernel()
def follow_chords(trajectory, gains, behind, period, force):  # type: ignore[no-untyped-def]
    """`chord_force`, written to `force`, (K,).

    Args:
        trajectory: as of `sample_pieces`.
        gains: of acceleration [kg], velocity [N s/m] and jerk [N s^3/m].
        behind: by how much the jerk comes later [s].
        period: of the samples [s].
        force: shape (K,).
    """
    count = force.shape[0]
    time, velocity, acceleration = np.empty(count + 1), np.empty(count + 1), np.empty(count + 1)
    edge, unused = np.empty(count + 1), np.empty(count + 1)
    for k in range(count + 1):
        time[k] = period * (k + 0.5) - behind
    sample_pieces(trajectory, time, unused, unused, edge)
    for k in range(count + 1):
        time[k] = period * (k + 1)
    sample_pieces(trajectory, time, unused, velocity, acceleration)
    for k in range(count):
        jerk = (edge[k + 1] - edge[k]) / period
        force[k] = gains[0] * acceleration[k] + gains[1] * velocity[k] + gains[2] * jerk


@kernel()
def lead(force, lag, period, moving, sent):  # type: ignore[no-untyped-def]
    """`against_lag`, written to `sent`, (K,)."""
    count = force.shape[0]
    before, first = 0.0, force[0] / period if moving else 0.0
    for k in range(count):
        if k + 1 < count:
            rate = (force[k + 1] - before) / (2.0 * period)
        else:
            rate = (force[k] - before) / period
        sent[k] = force[k] + lag * (rate - first)
        before = force[k]
