"""Signals of the move for an estimator: position, velocity, acceleration, force, and the zones.

Central differences, then a Butterworth filter forward and backward, over the whole record before
the zones are cut from it. The force goes through the same filter; otherwise sigma0 and C are wrong.

Force "as logged" is the command of the sample. It is held until the next one, so on average it acts
half a sample after the position. "Aligned" is the mean of the commands before and after the sample.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, sosfiltfilt

from stagectl.paper.case import Case
from stagectl.paper.simulate import simulate
from stagedata import F64


@dataclass(frozen=True, slots=True)
class Move:
    """The samples of a move and its zones.

    Attributes:
        period: [s].
        time: since the demand started to move [s], shape (K,).
        demand [m], position [m], velocity [m/s], acceleration [m/s^2], force [N]: shape (K,).
        slide, turn, end: zone A is samples slide..turn-1, zone B turn..end-1.
    """

    period: float
    time: F64
    demand: F64
    position: F64
    velocity: F64
    acceleration: F64
    force: F64
    slide: int
    turn: int
    end: int


def prepare(case: Case) -> Move:
    """Simulate, differentiate, align, filter, and find the zones.

    Raises:
        ValueError: the move cannot be simulated, or has no zone A or B.
    """
    record = simulate(case)
    period = 1.0 / record.rate
    x, u = record.position, record.force
    velocity = (x[2:] - x[:-2]) / (2 * period)
    acceleration = (x[2:] - 2 * x[1:-1] + x[:-2]) / period**2
    force = u[1:-1] if case.force == "logged" else 0.5 * (u[:-2] + u[1:-1])
    if case.cut_off is not None and case.cut_off < record.rate / 2:
        sections = butter(case.order, case.cut_off, output="sos", fs=record.rate)
        velocity = sosfiltfilt(sections, velocity)
        acceleration = sosfiltfilt(sections, acceleration)
        if case.filter_force:
            force = sosfiltfilt(sections, force)
    time, demand, position = (v[1:-1] for v in (record.time, record.demand, x))
    # Noise at rest could look like motion, so the search begins once the stage has moved.
    travelled = position - x[0] > (1e-3 if case.onset is None else case.onset)
    began = travelled if case.onset is not None else travelled & record.slipping[1:-1]
    if not began.any():
        raise ValueError("the move has no zone A: not all elements slip")
    slide = int(np.argmax(began))
    back = velocity[slide:] <= 0
    if not back.any():
        raise ValueError("the move has no zone B: the velocity never goes through zero")
    turn = slide + int(np.argmax(back)) + round(case.shift * record.rate)
    end = turn + round(case.stick * record.rate)
    if not (slide + 4 < turn < end <= len(position)):
        raise ValueError(f"the zones leave the record: samples {slide}, {turn}, {end}")
    return Move(period, time, demand, position, velocity, acceleration, force, slide, turn, end)
