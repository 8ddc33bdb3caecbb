"""The error equations of the tracking filter: how what it does not know yet grows and fades.

States, recorded minus simulated: position [m], velocity [m/s], force of the sticking and of the
slipping friction elements [N], factor on the Coulomb level [1].
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

STATES = 5


@dataclass(frozen=True, slots=True, eq=False)
class Gains:
    """The filter along a recording, kept from one run to serve the next ones near it.

    Attributes:
        gain: float64[K, 5], Kalman gain, per metre of innovation.
        deviation: float64[K], standard deviation of the innovation [m].
        transition: float64[K, 5, 5], of the error states from after SYNC k to SYNC k + 1.
        force: float64[K, 5], error states at SYNC k + 1 per newton on the carriage from SYNC k on.
        level: float64[K, 5], the same per relative change of the Coulomb level.
    """

    gain: F64
    deviation: F64
    transition: F64
    force: F64
    level: F64


@numba.njit(cache=True, nogil=True)
def propagate(covariance, transition, noise):  # type: ignore[no-untyped-def]
    """P <- T P T' + diag(noise), in place."""
    product = np.zeros((STATES, STATES))
    for i in range(STATES):
        for j in range(STATES):
            total = 0.0
            for n in range(STATES):
                total += transition[i, n] * covariance[n, j]
            product[i, j] = total
    for i in range(STATES):
        for j in range(i + 1):
            total = 0.0
            for n in range(STATES):
                total += product[i, n] * transition[j, n]
            covariance[i, j] = total
            covariance[j, i] = total
        covariance[i, i] += noise[i]


@numba.njit(cache=True, nogil=True)
def rates(matrix, mass, viscous, kp, damping, tangent, relaxation, goal, slope):  # type: ignore[no-untyped-def]
    """Rate matrix of the error states: closed loop, friction of sticking and slipping elements."""
    matrix[:] = 0.0
    matrix[0, 1] = 1.0
    matrix[1, 0] = -kp / mass
    matrix[1, 1] = -(viscous + damping) / mass
    matrix[1, 2] = -1.0 / mass
    matrix[1, 3] = -1.0 / mass
    matrix[2, 1] = tangent
    matrix[3, 1] = -relaxation * slope
    matrix[3, 3] = -relaxation
    matrix[3, 4] = relaxation * goal


@numba.njit(cache=True, nogil=True)
def catch(transition, force, level, before, slipped, goal):  # type: ignore[no-untyped-def]
    """What elements that began or ceased to slip within a period do to the error states.

    An element starts to slip at its limit, whatever its force was before: the level counts at once
    and the error it had is gone. Elements that stick again keep theirs.
    """
    if slipped > before:
        kept = max(0.0, 1.0 - (slipped - before) / (1.0 - before))
        for j in range(STATES):
            transition[2, j] *= kept
        force[2] *= kept
        level[2] *= kept
        transition[3, 4] += goal * (slipped - before)
        level[3] += goal * (slipped - before)
    elif slipped < before:
        share = 1.0 - slipped / before
        for j in range(STATES):
            moved = share * transition[3, j]
            transition[2, j] += moved
            transition[3, j] -= moved
        moved = share * force[3]
        force[2] += moved
        force[3] -= moved
        moved = share * level[3]
        level[2] += moved
        level[3] -= moved


@numba.njit(cache=True, nogil=True)
def exponential(matrix, duration, transition, force, level, goal_rate, mass):  # type: ignore[no-untyped-def]
    """Transition over `duration` by four steps of second order; and of unit inputs within it."""
    h = duration / 4.0
    step = np.zeros((STATES, STATES))
    for i in range(STATES):
        for j in range(STATES):
            square = 0.0
            for n in range(STATES):
                square += matrix[i, n] * matrix[n, j]
            step[i, j] = h * matrix[i, j] + 0.5 * h * h * square
        step[i, i] += 1.0
    b = np.zeros((2, STATES))
    for i in range(STATES):
        b[0, i] = 0.5 * h * h * matrix[i, 1] / mass
        b[1, i] = 0.5 * h * h * matrix[i, 3] * goal_rate
    b[0, 1] += h / mass
    b[1, 3] += h * goal_rate
    work = np.zeros((STATES, STATES))
    transition[:] = 0.0
    for i in range(STATES):
        transition[i, i] = 1.0
        force[i] = 0.0
        level[i] = 0.0
    column = np.zeros(STATES)
    for _ in range(4):
        for i in range(STATES):
            for j in range(STATES):
                total = 0.0
                for n in range(STATES):
                    total += step[i, n] * transition[n, j]
                work[i, j] = total
        transition[:] = work
        for which in range(2):
            target = force if which == 0 else level
            for i in range(STATES):
                total = b[which, i]
                for n in range(STATES):
                    total += step[i, n] * target[n]
                column[i] = total
            for i in range(STATES):
                target[i] = column[i]


@numba.njit(cache=True, nogil=True)
def _respond(transition, inputs, gain, deviation, signal):  # type: ignore[no-untyped-def]
    """Innovations over their deviation that an unmodelled input leaves behind."""
    error = np.zeros(STATES)
    moved = np.zeros(STATES)
    out = np.zeros(signal.shape[0])
    for k in range(signal.shape[0]):
        seen = error[0]
        out[k] = seen / deviation[k]
        for i in range(STATES):
            error[i] -= gain[k, i] * seen
        for i in range(STATES):
            total = inputs[k, i] * signal[k]
            for n in range(STATES):
                total += transition[k, i, n] * error[n]
            moved[i] = total
        error[:] = moved
    return out


def respond(gains: Gains, per_unit: F64, signal: F64) -> F64:
    """Innovations over their deviation that an input leaves in a model that lacks it, float64[K].

    Args:
        gains: of the tracked run.
        per_unit: `gains.force` or `gains.level`.
        signal: the input at each SYNC [N or 1].
    """
    found: F64 = _respond(
        gains.transition, per_unit, gains.gain, gains.deviation, np.ascontiguousarray(signal)
    )
    return found
