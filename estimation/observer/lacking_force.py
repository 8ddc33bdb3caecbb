"""What of a move's corrections goes with its acceleration, its jerk and the other axis, compiled.

Least squares; what goes with none of them is projected out: a constant, a step with the motion, a
slope over the travel (a spring's, or a clock's that is off) and one over the velocity. The
correction shows forces filtered, so the paths are filtered alike.

Positions that are late look like a mass, too, by the drive's kd, but with a slope over the velocity
by its kp: a move whose slope is nearer to that than to none says nothing. SYNCs off the drive's
control ticks look like half of the mass: where much is lacking, the measured force must side with
it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from estimation.observer.made_when_sampled import made_when_sampled
from stagedata import F64
from stagedata.compiled import kernel

LEAST = 1.0
"""Moves whose acceleration takes less than this multiple of Fc show friction rather than mass."""
FEWEST = 20
"""Samples of a move that say anything."""
_INDEPENDENT = 2.0
"""Independent values per move of the disturbances that the basis does not contain."""
_SIGNIFICANT = 3.0
"""Standard deviations from which a move shows a mass of its own."""
_SEPARABLE = 1e-6
"""Shares of a sum of squares that the least squares tell apart: axes that accelerate alike do not
show mass and coupling apart, and each gets a half of what they show."""
_SPEED, _OWN, _LACKED, _MEASURED = 3, 4, 7, 8
"""Column of the velocity, and the first one of the figures', behind step, constant and travel; what
is explained; and the measured force."""


class Figures(NamedTuple):
    """Of one axis.

    Attributes:
        mass: that is fed forward [kg].
        coulomb: Fc [N].
        period: Ts [s].
        integral_gain: of the drive [N/(m s)].
        slope_of_late: of its gains kp/kd [1/s].
        first_tick: share of a step of the demand that is made when the position is sampled.
        rest: so many samples after the motion count.
        scale: of the three figures: share of the mass, lead [s], share of the mass, (3,).
        response: how the correction answers a force that is lacking for one SYNC, (L,).
    """

    mass: float
    coulomb: float
    period: float
    integral_gain: float
    slope_of_late: float
    first_tick: float
    rest: float
    scale: F64
    response: F64


class Course(NamedTuple):
    """One axis through a move, one value per SYNC without a gap, shape (K,).

    Attributes:
        demand: setpoint sent [m].
        position: sampled when it was sent [m].
        correction: force offset sent less the planned one [N].
        across: setpoint of the other axis [m]; zeros where there is no other.
        force: measured [N].
    """

    demand: F64
    position: F64
    correction: F64
    across: F64
    force: F64


@kernel()
def find_lacking(course, planned, figures, value, information):  # type: ignore[no-untyped-def]
    """What the planned offsets of a move have lacked; False where it says nothing.

    Args:
        course: `Course`.
        planned: force per acceleration that was fed forward, over the mass.
        figures: `Figures`.
        value: written, (3,), in the units of `figures.scale`.
        information: written: inverse of its covariance, (3, 3).
    """
    end = _end_of(course.demand, course.across, figures)
    if end < FEWEST:
        return False
    columns = _columns(course, figures, end)
    count, samples = columns.shape
    products = np.empty((count, count))
    for i in range(count):
        for j in range(i + 1):
            products[i, j] = products[j, i] = (columns[i] * columns[j]).sum()
    for i in range(_OWN):
        _eliminate(products, i)
    own = products[_OWN:_LACKED, _OWN:_LACKED].copy()
    total = own[0, 0] + own[1, 1] + own[2, 2]
    for i in range(_OWN, _LACKED):
        products[i, i] += _SEPARABLE * total
    for i in range(_OWN, _LACKED):
        _eliminate(products, i)
    square = products[_LACKED, _LACKED] / samples
    if not (square > 0.0 and total > 0.0):
        return False
    scale = figures.scale
    speed = products[_SPEED, _LACKED]
    for i in range(2, -1, -1):
        row = products[_OWN + i]
        rest = row[_LACKED]
        for j in range(i + 1, 3):
            rest -= row[_OWN + j] * value[j]
        value[i] = rest / row[_OWN + i]
        speed -= products[_SPEED, _OWN + i] * value[i]
    row = products[_OWN]
    lacked = scale[0] * row[_LACKED] / row[_OWN]
    if row[_OWN] > 0.0:
        beyond = scale[0] * row[_MEASURED] / row[_OWN] - planned
        if abs(lacked) > scale[0] and abs(beyond - lacked) >= abs(beyond):
            return False
        noise = scale[0] * math.sqrt(square * samples / _INDEPENDENT / row[_OWN])
        late = lacked * figures.mass * figures.slope_of_late * products[_SPEED, _SPEED]
        if abs(lacked) > _SIGNIFICANT * noise and abs(speed - late) < abs(speed):
            return False
    for i in range(3):
        for j in range(3):
            information[i, j] = own[i, j] / (scale[i] * scale[j] * square * samples / _INDEPENDENT)
    for i in range(3):
        value[i] *= scale[i]
    return True


@kernel()
def _end_of(demand, across, figures):  # type: ignore[no-untyped-def]
    """Samples up to the rest after a move; 0 where it says nothing. Arguments as above."""
    last, moves, bend = -1, False, 0.0
    for k in range(1, demand.shape[0]):
        step = demand[k] - demand[k - 1]
        if step != 0.0 or across[k] != across[k - 1]:
            last, moves = k - 1, moves or step != 0.0
        if k > 1:
            bend = max(bend, abs(step - (demand[k - 1] - demand[k - 2])))
    shows = figures.mass * bend / figures.period**2 >= LEAST * figures.coulomb
    if last < 0 or (moves and not shows):
        return 0
    return min(int(last + figures.rest), demand.shape[0])


@kernel()
def _columns(course, figures, end):  # type: ignore[no-untyped-def]
    """Basis, lacking and measured force, (9, end - 4): no ends, where derivatives are not known.

    Step, constant, travel and velocity; force [N] of the three figures in units of `figures.scale`;
    what was lacking [N]; the measured force, filtered alike [N]. Arguments as above.
    """
    demand, position, correction, across, force = course
    period, scale = figures.period, figures.scale
    before, other, sliding = np.empty(end), np.empty(end), np.zeros(end)
    integrator, deviated = np.empty(end), 0.0
    for k in range(end):
        before[k], other[k] = demand[max(k - 1, 0)], across[max(k - 1, 0)]
        if k > 0 and demand[k] != demand[k - 1] and k + 1 < end:
            sliding[k + 1] = 1.0
        coming = demand[min(k + 1, end - 1)] - demand[k]
        made = made_when_sampled(demand[k] - before[k], coming, figures.first_tick)
        deviated += position[k] - before[k] - made
        integrator[k] = -figures.integral_gain * period * deviated
    path, other = _seen(before, figures.response), _seen(other, figures.response)
    sliding = _seen(sliding, figures.response)
    integrator = _seen(integrator, figures.response)
    measured = _seen(force[:end], figures.response)
    columns = np.empty((_MEASURED + 1, end - 4))
    for n in range(end - 4):
        k = n + 2
        steps = path[k + 1] - path[k - 1]
        further = path[k + 2] - path[k - 2]
        columns[0, n] = sliding[k]
        columns[1, n] = 1.0
        columns[2, n] = path[k] - path[0]
        columns[_SPEED, n] = 0.5 * steps / period
        columns[_OWN, n] = scale[0] * figures.mass * _bend(path, k) / period**2
        columns[_OWN + 1, n] = scale[1] * figures.mass * (0.5 * further - steps) / period**3
        columns[_OWN + 2, n] = scale[2] * figures.mass * _bend(other, k) / period**2
        columns[_LACKED, n] = correction[k] - correction[0] + integrator[k]
        columns[_MEASURED, n] = measured[k]
    return columns


@kernel()
def _bend(path, k):  # type: ignore[no-untyped-def]
    """Second difference of a path, shape (K,), at sample k."""
    return path[k + 1] - 2.0 * path[k] + path[k - 1]


@kernel()
def _seen(force, response):  # type: ignore[no-untyped-def]
    """A lacking force as the correction shows it, (K,), at rest before the first sample.

    `force`, (K,); `response`, (L,).
    """
    count = force.shape[0]
    seen, change = np.full(count, force[0]), force - force[0]
    if not change.any():  # as of an axis that rests
        return seen
    for j in range(min(response.shape[0], count)):
        share = response[j]
        for k in range(j, count):
            seen[k] += share * change[k - j]
    return seen


@kernel()
def _eliminate(products, pivot):  # type: ignore[no-untyped-def]
    """Take from the columns behind column `pivot` what goes with it.

    `products` of the columns with each other, (9, 9), are changed.
    """
    count = products.shape[0]
    if not products[pivot, pivot] > 0.0:
        return
    for i in range(pivot + 1, count):
        share = products[i, pivot] / products[pivot, pivot]
        for j in range(pivot + 1, count):
            products[i, j] -= share * products[pivot, j]
