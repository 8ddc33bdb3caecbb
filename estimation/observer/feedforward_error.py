"""What a move shows its planned force to lack: mass, lead and coupling.

What the planned offset lacks on the way, the observer's correction and the drive's integrator make
up for. A mass that is wrong shows as a force in proportion to the demanded acceleration, a force
that comes late as one in proportion to the jerk, a force from another axis as one in proportion to
its acceleration. A constant, a step with the motion and slopes over velocity and travel are
friction's or something else's. Those are basis functions, as in iterative learning control; the
moves are not repeated here: `learned_feedforward` weighs what they have in common.

See docs/reference/observer.md, learning from whole moves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from estimation.observer.design import Design
from estimation.observer.lacking_force import Course, Figures, find_lacking
from estimation.observer.model import LACK
from stagedata import F64
from stagedata.compiled import machine_code

MASS, LEAD, COUPLING = range(3)
"""Share of the mass; lead [s]; share of the mass that the other axis' acceleration moves."""
SCALE = np.array([0.3, 1e-3, 0.3])
"""Units that the three are found in: what they may well be."""
_REST = 5.0
"""Time constants of the rest after a move that are evaluated with it."""
_RESPONSE = 12.0
"""Length of the observer's response, in time constants."""


@dataclass(frozen=True, slots=True)
class FeedforwardError:
    """What a move lacked.

    Attributes:
        value: `MASS`, `LEAD`, `COUPLING`, (3,).
        information: inverse of its covariance, (3, 3).
        travel: of the axis, or where it rested, of the other one, with its sign [m].
        rested: whether it rested.
    """

    value: F64
    information: F64
    travel: float
    rested: bool


class FeedforwardErrors:
    """Finds them for one axis.

    Args:
        design: of the axis' observer.
        mass: that is fed forward [kg].
    """

    def __init__(self, design: Design, mass: float) -> None:
        own, constant = design.figures, design.time_constant / design.figures.period
        drive = own.drive
        slope = drive.kp / drive.kd if drive.kd else math.inf
        response = _response(design, round(_RESPONSE * constant))
        self._figures = Figures(
            mass, own.coulomb, own.period, drive.ki, slope,
            (drive.control_period - own.age) / own.period, _REST * constant, SCALE, response,
        )  # fmt: skip
        self._value, self._information = np.empty(3), np.empty((3, 3))
        rest = Course(*[np.zeros(2)] * 5)
        self._find = machine_code(  # compiled, or loaded, before anything moves
            find_lacking, rest, 1.0, self._figures, self._value, self._information
        )

    def find(self, course: Course, planned: float = 1.0) -> FeedforwardError | None:
        """What the planned offsets of a move have lacked; None where it says nothing.

        Args:
            course: of the axis.
            planned: force per acceleration that was fed forward, over the mass.
        """
        course = Course(*map(np.ascontiguousarray, course))
        if self._find(course, planned, self._figures, self._value, self._information):
            demand, across = course.demand, course.across
            rested = not (demand != demand[0]).any()
            travel = float(across[-1] - across[0] if rested else demand[-1] - demand[0])
            return FeedforwardError(self._value.copy(), self._information.copy(), travel, rested)
        return None


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
