"""What a move shows its planned force to lack: mass, lead and coupling.

What the planned offset lacks on the way, the observer's correction and the drive's integrator make
up for. A mass that is wrong shows as a force in proportion to the demanded acceleration, a force
that comes late as one in proportion to the jerk, a force from another axis as one in proportion to
its acceleration. A constant, a step with the motion and a slope over the velocity are friction's or
something else's. Those are basis functions, as in iterative learning control; the moves are not
repeated here, so their weights are tracked by a Kalman filter instead.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.compiled import kernel, machine_code
from estimation.least_squares import cholesky_inverse
from estimation.observer.design import Design
from estimation.observer.lacking_force import Figures, find_lacking
from estimation.observer.model import LACK

F64 = NDArray[np.float64]

MASS, LEAD, COUPLING = range(3)
"""Share of the mass; lead [s]; share of the mass that the other axis' acceleration moves."""
KEPT = 0.9
"""Weight of a move relative to the next one: the figures may change."""
EXPLAINED = 0.25
"""A figure is fed forward if it leaves at most this share of what later moves lack."""
SIGNIFICANT = 3.0
"""And if it is so many of its standard deviations more than BIAS: two moves may agree by chance."""
BIAS = np.array([5e-4, 5e-5, 5e-4])
"""What moves may show that lack nothing: up to 0.05 % of the mass, and 30 us of lead on the virtual
stage, whose integration step is 20 us early."""
MOST = np.array([0.3, 1e-3, 0.3])
"""What is more than this, either way, is something else: SYNCs off the drive's control ticks look
like half of the mass. Also the spread before the first move, 1 sigma."""
_AT_START = np.diag(MOST**-2.0)
_REST = 5.0
"""Time constants of the rest after a move that are evaluated with it."""
_RESPONSE = 12.0
"""Length of the observer's response, in time constants."""


class Course(NamedTuple):
    """One axis through a move, one value per SYNC without a gap, shape (K,).

    Attributes:
        demand: setpoint sent [m].
        position: sampled when it was sent [m].
        correction: force offset sent less the planned one [N].
        across: setpoint of the other axis [m]; zeros where there is no other.
    """

    demand: F64
    position: F64
    correction: F64
    across: F64


@dataclass(frozen=True, slots=True)
class FeedforwardError:
    """What a move lacked.

    Attributes:
        value: `MASS`, `LEAD`, `COUPLING`, (3,).
        information: inverse of its covariance, (3, 3).
    """

    value: F64
    information: F64


class FeedforwardErrors:
    """Finds them for one axis.

    Args:
        design: of the axis' observer.
        mass: that is fed forward [kg].
    """

    def __init__(self, design: Design, mass: float) -> None:
        own, constant = design.figures, design.time_constant / design.figures.period
        self._figures = Figures(
            mass, own.coulomb, own.period, own.drive.ki, own.drive.control_period / own.period,
            _REST * constant, MOST, _response(design, round(_RESPONSE * constant)),
        )  # fmt: skip
        self._value, self._information = np.empty(3), np.empty((3, 3))
        rest = np.zeros(2)
        self._find = machine_code(  # compiled, or loaded, before anything moves
            find_lacking, rest, rest, rest, rest, self._figures, self._value, self._information
        )

    def find(self, course: Course) -> FeedforwardError | None:
        """What the planned offsets of a move have lacked; None where it says nothing."""
        demand, position, correction, across = map(np.ascontiguousarray, course)
        if self._find(
            demand, position, correction, across, self._figures, self._value, self._information
        ):
            return FeedforwardError(self._value.copy(), self._information.copy())
        return None


class LearnedFeedforward:
    """What is fed forward besides the planned force: recursive least squares over the moves.

    A figure is fed forward once it is certain and has explained moves that it was not learned from.
    Cogging, which acts elsewhere on every move, may look like any of them, but like another value
    each time.

    Attributes:
        value: `MASS`, `LEAD`, `COUPLING`, (3,).
        fed: of `value`, what is fed forward, (3,).
    """

    def __init__(self) -> None:
        self.value: F64 = np.zeros(3)
        self.fed: F64 = np.zeros(3)
        self._information: F64 = _AT_START.copy()
        self._before: F64 = np.zeros(3)
        self._after: F64 = np.zeros(3)
        rest = np.zeros(3), np.zeros((3, 3))
        state = (np.zeros(3), _AT_START.copy(), np.zeros(3), np.zeros(3), np.zeros(3))
        self._weigh = machine_code(weigh, *rest, *state, _AT_START, MOST, BIAS)

    def take(self, error: FeedforwardError) -> None:
        """Learn from a move that was made with `fed`: what it lacked comes on top."""
        self._weigh(
            error.value, error.information, self.value, self._information, self.fed, self._before,
            self._after, _AT_START, MOST, BIAS,
        )  # fmt: skip


@kernel()
def weigh(  # type: ignore[no-untyped-def]
    error, shown, value, information, fed, before, after, at_start, most, bias
):
    """Take in what a move lacked (10 arguments: what is known, and limits, as arrays).

    Args:
        error: what it lacked, (3,).
        shown: inverse of the covariance of that, (3, 3).
        value: changed, as are all up to `after`; (3,).
        information: inverse of the covariance of `value`, (3, 3).
        fed: of `value`, what is fed forward, (3,).
        before: mean squares of what moves lacked without a feedforward, weighted, (3,).
        after: the same of what the values known before each move leave, (3,).
        at_start: `information` before the first move, (3, 3).
        most: `MOST`.
        bias: `BIAS`.
    """
    lacked, pull = np.empty(3), np.zeros(3)
    for i in range(3):
        lacked[i] = fed[i] + error[i]
        seen, known = shown[i, i], information[i, i]
        weight = seen * known / (seen + known)  # of both the move's uncertainty and the value's
        before[i] = KEPT * before[i] + weight * lacked[i] ** 2
        after[i] = KEPT * after[i] + weight * (lacked[i] - value[i]) ** 2
    for i in range(3):
        for j in range(3):
            pull[i] += shown[i, j] * (lacked[j] - value[j])
            information[i, j] *= KEPT
            information[i, j] += (1.0 - KEPT) * at_start[i, j] + shown[i, j]
    covariance = information.copy()
    cholesky_inverse(covariance)
    for i in range(3):
        for j in range(3):
            value[i] += covariance[i, j] * pull[j]
        explains = after[i] < EXPLAINED * before[i]
        certain = abs(value[i]) > bias[i] + SIGNIFICANT * math.sqrt(covariance[i, i])
        plausible = abs(value[i]) <= most[i]
        fed[i] = value[i] if explains and certain and plausible else 0.0


def _response(design: Design, length: int) -> F64:
    """How the correction answers a force that is lacking for one SYNC, (length,).

    By the observer's own model: the filter's error about a force that is there from now on dies out
    as the filter does, and the correction follows at its own pace, one SYNC later.
    """
    model, states = design.model, len(design.model.gain)
    reads = np.zeros((1, states))
    reads[0, 0] = 1.0
    error_map = model.transition @ (np.eye(states) - np.outer(model.gain, reads))
    unknown = np.zeros(states)
    unknown[LACK] = 1.0
    step, correction = np.zeros(length + 1), 0.0
    for k in range(length):
        correction += design.gain * (1.0 - unknown[LACK] - correction)
        unknown = error_map @ unknown
        step[k + 1] = correction
    response: F64 = np.diff(step)
    shifted: F64 = np.concatenate(([0.0], response[:-1])) / response.sum()
    return shifted
