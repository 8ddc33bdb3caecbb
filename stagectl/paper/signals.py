"""Signals of the move for an estimator: position, velocity, acceleration, force, and the zones.

Central differences, then a Butterworth filter forward and backward, over the whole record before
the zones are cut from it. The force goes through the same filter; otherwise sigma0 and C are wrong.

Force "as logged" is the command of the sample. It is held until the next one, so on average it acts
half a sample after the position. "Aligned" is the mean of the commands before and after the sample.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from stagectl.paper.simulate import Record

F64 = NDArray[np.float64]
Alignment = Literal["logged", "aligned"]


@dataclass(frozen=True, slots=True)
class Processing:
    """What the paper leaves open about the data.

    Attributes:
        force: as logged, or aligned with the positions.
        cut_off: of the filter [Hz]; None, or half the sample rate and above, for no filter.
        order: of the filter, in each direction.
        filter_force: whether the force goes through the filter too.
    """

    force: Alignment = "aligned"
    cut_off: float | None = 500.0
    order: int = 2
    filter_force: bool = True

    def __post_init__(self) -> None:
        if self.cut_off is not None and not self.cut_off > 0:
            raise ValueError(f"cut_off: must be > 0 Hz, is {self.cut_off}")


@dataclass(frozen=True, slots=True)
class Borders:
    """Where the zones lie, as choices that the paper leaves open.

    Attributes:
        onset: travel at which zone A begins [m]; None: where all elements of the plant slip.
        shift: of the border between the zones against the first v <= 0 [s].
        stick: duration of zone B [s].
    """

    onset: float | None = None
    shift: float = 0.0
    stick: float = 0.05


PROCESSING, BORDERS = Processing(), Borders()


@dataclass(frozen=True, slots=True)
class Move:
    """The samples of a move and its zones.

    Attributes:
        period: [s].
        time: since the demand started to move [s], shape (K,).
        position [m], velocity [m/s], acceleration [m/s^2], force [N]: shape (K,).
        slide, turn, end: zone A is samples slide..turn-1, zone B turn..end-1.
    """

    period: float
    time: F64
    position: F64
    velocity: F64
    acceleration: F64
    force: F64
    slide: int
    turn: int
    end: int


def prepare(
    record: Record, processing: Processing = PROCESSING, borders: Borders = BORDERS
) -> Move:
    """Differentiate, align, filter, and find the zones.

    Args:
        record: of the move.
        processing: of its signals.
        borders: of its zones.

    Raises:
        ValueError: the move has no zone A or B.
    """
    period = 1.0 / record.rate
    x, u = record.position, record.force
    velocity = (x[2:] - x[:-2]) / (2 * period)
    acceleration = (x[2:] - 2 * x[1:-1] + x[:-2]) / period**2
    force = u[1:-1] if processing.force == "logged" else 0.5 * (u[:-2] + u[1:-1])
    if processing.cut_off is not None and processing.cut_off < record.rate / 2:
        sections = butter(processing.order, processing.cut_off, output="sos", fs=record.rate)
        velocity = sosfiltfilt(sections, velocity)
        acceleration = sosfiltfilt(sections, acceleration)
        if processing.filter_force:
            force = sosfiltfilt(sections, force)
    position = x[1:-1]
    # Noise at rest could look like motion, so the search begins once the stage has moved.
    travelled = position - x[0] > (1e-3 if borders.onset is None else borders.onset)
    began = travelled if borders.onset is not None else travelled & record.slipping[1:-1]
    if not began.any():
        raise ValueError("the move has no zone A: not all elements slip")
    slide = int(np.argmax(began))
    back = velocity[slide:] <= 0
    if not back.any():
        raise ValueError("the move has no zone B: the velocity never goes through zero")
    turn = slide + int(np.argmax(back)) + round(borders.shift * record.rate)
    end = turn + round(borders.stick * record.rate)
    if not (slide + 4 < turn < end <= len(position)):
        raise ValueError(f"the zones leave the record: samples {slide}, {turn}, {end}")
    return Move(
        period, record.time[1:-1], position, velocity, acceleration, force, slide, turn, end
    )
