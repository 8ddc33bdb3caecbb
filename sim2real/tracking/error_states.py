"""The linearised error model of the tracking filter: how state errors grow, decay and mix.

Error states, recorded minus simulated: position [m], velocity [m/s], force of the sticking and of
the slipping friction elements [N], factor on the Coulomb level [1].

Kernels work on float64 arrays in place; a rate matrix or transition is [5, 5], an input [5].

Source: docs/decisions/0012-tracked-innovations.md.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from stagedata import F64
from stagedata.compiled import kernel

STATES = 5


class Gains(NamedTuple):
    """The filter along a recording of K samples; computed in one run and reused for models near it.

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


@kernel(error_model="python", nogil=True)
def propagate_covariance(covariance, transition, noise):  # type: ignore[no-untyped-def]
    """P <- T P T' + diag(noise), in place.

    Args:
        covariance: P, float64[5, 5], symmetric, in squares of the states' units.
        transition: T, float64[5, 5].
        noise: variances of the process noise over the step, float64[5].
    """
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


@kernel(error_model="python", nogil=True)
def fill_rate_matrix(matrix, mass, viscous, loop, tangent, relaxation, goal, slope):  # type: ignore[no-untyped-def]
    """Rate matrix of the error states under the closed loop, with sticking and slipping friction.

    Args:
        matrix: written, float64[5, 5] [state per state and second].
        mass: [kg].
        viscous: damping [N s/m].
        loop: (proportional gain [N/m], damping [N s/m]) of the controller; zeros where it is open.
        tangent: stiffness of the sticking elements [N/m].
        relaxation: rate at which slipping elements approach their limit [1/s].
        goal: limit of the slipping elements, with the sign of the velocity [N].
        slope: decrease of that limit with speed, over the Stribeck velocity [N s/m].
    """
    kp, damping = loop
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


@kernel(error_model="python", nogil=True)
def transfer_slip(transition, force, level, before, slipped, goal):  # type: ignore[no-untyped-def]
    """Move error states between sticking and slipping elements after a period.

    An element starts to slip at its limit, whatever its force was before: its force error is gone
    and the error of the level takes effect at once. Elements that stick again keep their error.

    Args:
        transition: of the error states, float64[5, 5], changed in place.
        force: response to a unit force, float64[5], changed in place.
        level: response to a unit level, float64[5], changed in place.
        before: share of the Coulomb force held by slipping elements before the period [1].
        slipped: that share after it [1].
        goal: limit of all elements together, with the sign of the velocity [N].
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


@kernel(error_model="python", nogil=True)
def discretise(matrix, duration, transition, force, level, goal_rate, mass):  # type: ignore[no-untyped-def]
    """Transition over `duration` in four second-order steps, and responses to unit inputs.

    Args:
        matrix: rate matrix, float64[5, 5] [1/s].
        duration: [s].
        transition: written, float64[5, 5].
        force: written, float64[5], response to 1 N on the carriage.
        level: written, float64[5], response to a relative change of 1 of the Coulomb level.
        goal_rate: rate of the slipping force per relative change of the level [N/s].
        mass: [kg].
    """
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


@kernel(error_model="python", nogil=True)
def _respond(transition, inputs, gain, deviation, signal):  # type: ignore[no-untyped-def]
    """Normalised innovations that an unmodelled input leaves.

    Args:
        transition: float64[K, 5, 5].
        inputs: error states per unit of the input, float64[K, 5].
        gain: float64[K, 5], per metre.
        deviation: float64[K] [m].
        signal: the input, float64[K].

    Returns:
        float64[K], innovation over its standard deviation.
    """
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


def innovation_response(gains: Gains, per_unit: F64, signal: F64) -> F64:
    """Normalised innovations that an input leaves in a model without it, float64[K].

    Args:
        gains: of the tracked run.
        per_unit: `gains.force` or `gains.level`.
        signal: the input at each SYNC, float64[K] [N or 1].
    """
    found: F64 = _respond(
        gains.transition, per_unit, gains.gain, gains.deviation, np.ascontiguousarray(signal)
    )
    return found
