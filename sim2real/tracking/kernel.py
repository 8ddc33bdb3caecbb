"""The compiled loop of the tracking filter: simulate one SYNC period, correct, propagate.

The state of the simulation is corrected in place by the innovation; the covariance follows the
linearised error equations of `sim2real.tracking.error_states`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from hil_sim.plant import advance, command
from sim2real.tracking.error_states import (
    STATES,
    discretise,
    fill_rate_matrix,
    propagate_covariance,
    transfer_slip,
)
from stagedata import F64, BoolArray
from stagedata.compiled import kernel

_TRUST = 0.03
"""Relative standard deviation of each change of the model's friction force: uncertainty about
elements that slip at a rest or at an onset is process noise, not a finding."""
_DRIFT = 1.7e-4
"""Random walk of the friction force per SYNC period, in Coulomb forces."""
_INTEGRAL, _MAX_SIGMAS = 4e-3, 3.0
"""Share of the force actual's deviation that the controller's integral follows per SYNC, and the
standard deviations at which that deviation is clipped: the integral wanders by 2 mN in a second,
while the force is rounded to 18 mN of standard deviation."""
_DERIVATIVE_SHARE = 0.4
"""Share of the derivative gain that a velocity error excites within one SYNC period; used for the
covariance only."""
_CREEP, _HELD = 1e-4, 0.3
"""Standard deviations of what is not known where a recording begins: of the velocity [m/s], and of
the friction force, in Coulomb forces."""
_POSITION_NOISE, _VELOCITY_NOISE = 1e-22, 1e-15
"""Process noise per SYNC period [m^2, m^2/s^2]: it keeps the covariance positive."""


class Recorded(NamedTuple):
    """What was sent and sampled at K SYNCs.

    Attributes:
        demand, offset: setpoints, float64[K, A] [m, N].
        position, force: actual values, float64[K, A] [m, N].
        valid: bool[K, A].
    """

    demand: F64
    offset: F64
    position: F64
    force: F64
    valid: BoolArray


class Deviations(NamedTuple):
    """Standard deviations, and how long the friction level keeps its value, float64[A] each.

    Attributes:
        wander: of the factor on the Coulomb level [1].
        retention: correlation of that factor from one SYNC to the next [1].
        position: of the measured position [m].
        force: of the force actual value [N].
    """

    wander: F64
    retention: F64
    position: F64
    force: F64


class Tracked(NamedTuple):
    """Results at each SYNC, float64[K, A]; x, v and level are those after its correction.

    Attributes:
        innovation: measured minus simulated position [m].
        motor: simulated force actual [N].
        x, v: position [m] and velocity [m/s].
        level: factor on the Coulomb level [1].
    """

    innovation: F64
    motor: F64
    x: F64
    v: F64
    level: F64


@kernel()
def _begin(covariance, p, position, wander):  # type: ignore[no-untyped-def]
    """Set the covariance of what is not known where a recording begins."""
    covariance[0, 0] = position**2
    covariance[1, 1] = _CREEP**2
    covariance[2, 2] = (_HELD * p.coulomb) ** 2
    covariance[4, 4] = wander**2


@kernel(error_model="python", nogil=True)
def track(mechanics, recorded, deviations, is_fresh, tracked, filter_arrays):  # type: ignore[no-untyped-def]
    """Track every axis over K SYNCs; all results are written in place.

    Args:
        mechanics: `Mechanics` at the first SYNC; left at the last.
        recorded: `Recorded`.
        deviations: `Deviations`.
        is_fresh: whether gains and transitions are computed; else `filter_arrays.gain` is used as
            it is and its other arrays are not touched.
        tracked: `Tracked`.
        filter_arrays: `Gains`, axes as the second dimension.
    """
    m = mechanics
    axes = m.plant.shape[0]
    covariance = np.zeros((axes, STATES, STATES))
    quiet = np.zeros((axes, 2, 0))
    slipped = np.zeros(axes)
    friction = np.zeros(axes)
    samples = np.zeros(axes, dtype=np.int64)
    for a in range(axes):
        _begin(covariance[a], m.plant[a], deviations.position[a], deviations.wander[a])
    for k in range(recorded.demand.shape[0]):
        for a in range(axes):
            s = m.state[a]
            innovation = recorded.position[k, a] - s.position
            tracked.innovation[k, a] = innovation
            tracked.motor[k, a] = s.motor_force
            spread = covariance[a, 0, 0] + deviations.position[a] ** 2
            if is_fresh:
                filter_arrays.deviation[k, a] = math.sqrt(spread)
            if recorded.valid[k, a]:
                if is_fresh:
                    _update_covariance(covariance[a], spread, filter_arrays.gain[k, a])
                _correct(m, a, innovation, filter_arrays.gain[k, a], slipped[a])
                s.encoder = recorded.position[k, a]
                # Positions between SYNCs are not logged: the integral of the loop drifts off.
                # At first it is not known: it is the mean of what the force shows.
                excess = recorded.force[k, a] - s.motor_force
                if samples[a] * _INTEGRAL > 1.0:
                    most = _MAX_SIGMAS * deviations.force[a]
                    m.loop[a].integral += _INTEGRAL * min(max(excess, -most), most)
                elif samples[a] > 0:
                    m.loop[a].integral += excess / samples[a]
                samples[a] += 1
            tracked.x[k, a] = s.position
            tracked.v[k, a] = s.velocity
            tracked.level[k, a] = s.wander
            friction[a] = s.friction
            command(m.loop[a], recorded.demand[k, a], recorded.offset[k, a], m.ticks)
        advance(m, quiet, 0, m.ticks)
        for a in range(axes):
            before = slipped[a]
            slipped[a], tangent = _slip_state(m, a)
            if is_fresh:
                _propagate(
                    m, a, (before, slipped[a], tangent, friction[a]), deviations,
                    filter_arrays, k, covariance[a],
                )  # fmt: skip


@kernel(error_model="python", nogil=True)
def _update_covariance(covariance, spread, gain):  # type: ignore[no-untyped-def]
    """Kalman gain float64[5] [1/m of innovation] and P <- P - K S K', both in place.

    Args:
        covariance: of the error states, float64[5, 5].
        spread: variance S of the innovation [m^2].
        gain: written, float64[5].
    """
    for i in range(STATES):
        gain[i] = covariance[i, 0] / spread
    for i in range(STATES):
        for j in range(STATES):
            covariance[i, j] -= gain[i] * spread * gain[j]


@kernel(error_model="python", nogil=True)
def _correct(mechanics, a, innovation, gain, slipped):  # type: ignore[no-untyped-def]
    """Correct the state of simulated axis `a` by an innovation.

    Args:
        mechanics: `Mechanics`, changed in place.
        a: number of the axis.
        innovation: measured minus simulated position [m].
        gain: float64[5], per metre.
        slipped: share of the Coulomb force that slipping elements hold [1].
    """
    m = mechanics
    s = m.state[a]
    first = m.plant[a].first_element
    last = first + m.plant[a].elements
    s.position += gain[0] * innovation
    s.velocity += gain[1] * innovation
    s.wander += gain[4] * innovation
    sticking = 0
    for i in range(first, last):
        if not m.slipping[i]:
            sticking += 1
    total = 0.0
    for i in range(first, last):
        if m.slipping[i]:
            m.forces[i] += gain[3] * innovation * m.shares[i] / slipped
        else:
            m.forces[i] += gain[2] * innovation / sticking
        total += m.forces[i]
    s.friction = total


@kernel(error_model="python", nogil=True)
def _slip_state(mechanics, a):  # type: ignore[no-untyped-def]
    """Share of the Coulomb force that slips [1] and tangent stiffness of what sticks [N/m]."""
    m = mechanics
    p = m.plant[a]
    slipped = 0.0
    tangent = 0.0
    for i in range(p.first_element, p.first_element + p.elements):
        if m.slipping[i]:
            slipped += m.shares[i]
        else:
            tangent += p.element_stiffness
    return slipped, tangent


@kernel(error_model="python", nogil=True)
def _propagate(mechanics, a, friction, deviations, filter_arrays, k, covariance):  # type: ignore[no-untyped-def]
    """Propagate the covariance of axis `a` from SYNC k to k + 1; write transition and responses.

    Args:
        mechanics: `Mechanics` at SYNC k + 1.
        a: number of the axis.
        friction: (slipping share before and after the period [1], tangent stiffness [N/m], friction
            force before [N]).
        deviations: `Deviations`.
        filter_arrays: `Gains` of all axes, row k written.
        k: number of the SYNC.
        covariance: float64[5, 5], changed in place.
    """
    m = mechanics
    p = m.plant[a]
    s = m.state[a]
    before, slipped, tangent, held = friction
    matrix = np.zeros((STATES, STATES))
    noise = np.zeros(STATES)
    # A drive that ticks once per SYNC sees measured positions only: its loop damps no state error.
    closed = 1.0 if m.ticks > 1 else 0.0
    extra = p.static_ratio * math.exp(-abs(s.velocity) / p.stribeck_velocity)
    relaxation = p.relaxation_rate / (1.0 + extra)
    goal = p.coulomb * (1.0 + extra) * s.direction
    fill_rate_matrix(
        matrix, p.mass, p.viscous,
        (closed * m.control[a].kp, closed * _DERIVATIVE_SHARE * m.control[a].kd),
        tangent, relaxation, goal * slipped, slipped * p.coulomb * extra / p.stribeck_velocity,
    )  # fmt: skip
    transition = filter_arrays.transition[k, a]
    force, level = filter_arrays.force[k, a], filter_arrays.level[k, a]
    discretise(
        matrix, m.period * m.ticks, transition, force, level, relaxation * goal * slipped, p.mass
    )
    transfer_slip(transition, force, level, before, slipped, goal)
    transition[4, 4] = deviations.retention[a]
    noise[0] = _POSITION_NOISE
    noise[1] = _VELOCITY_NOISE
    unsure = (_TRUST * (s.friction - held)) ** 2 + (_DRIFT * p.coulomb) ** 2
    noise[2] = (1.0 - slipped) * unsure
    noise[3] = slipped * unsure
    noise[4] = deviations.wander[a] ** 2 * (1.0 - deviations.retention[a] ** 2)
    propagate_covariance(covariance, transition, noise)
