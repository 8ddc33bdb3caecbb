"""What an axis is shaken by: a multisine on its force offset, another on its demand.

All signals of all axes are applied together, each on spectral lines of its own, so that one record
gives every response. Some lines are left to nobody: what shows there was made by the stage, by
rounding or friction (Pintelon and Schoukens, System Identification, 2012, section 4.3). Phases are
Schroeder's (1970), which keep the peak of a flat multisine low.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stagedata import F64

I64 = NDArray[np.int64]

DURATION = 2.0
"""One period of the multisines lasts about so long [s]: lines are half a hertz apart."""
LOWEST = 2.0
"""First line [Hz]."""
HIGHEST = 0.495
"""Last line, over the SYNC rate: the loop that an observer closes is sampled at SYNC."""


@dataclass(frozen=True, slots=True)
class Shaken:
    """An axis to be shaken.

    Attributes:
        force: peak of the force offset [N].
        kp, ki, kd: gains of its drive, as the host believes them [N/m, N/(m s), N s/m].
        derivative_time: of the derivative's low-pass [s].
    """

    force: float
    kp: float
    ki: float
    kd: float
    derivative_time: float


@dataclass(frozen=True, slots=True, eq=False)
class Excitation:
    """One period of the multisines of n axes.

    Attributes:
        offset: force offsets [N], (N, n).
        demand: displacements of the demand [m], (N, n).
        offset_lines, demand_lines: number of each line in the spectrum, (L,) for each axis.
        empty_lines: those of nobody.
    """

    offset: F64
    demand: F64
    offset_lines: tuple[I64, ...]
    demand_lines: tuple[I64, ...]
    empty_lines: I64

    def __len__(self) -> int:
        return len(self.offset)


def make_excitation(axes: Sequence[Shaken], period: float) -> Excitation:
    """The multisines of all axes.

    A line of the demand makes the drive answer with about the force of a line of the offset.

    Args:
        axes: to be shaken together.
        period: Ts [s].
    """
    rows = 1 << math.ceil(math.log2(DURATION / period))
    lines = np.arange(math.ceil(LOWEST * rows * period), math.floor(HIGHEST * rows))
    used = 2 * len(axes)
    combs = [lines[k :: used + 1] for k in range(used + 1)]
    offset, demand = np.zeros((rows, len(axes))), np.zeros((rows, len(axes)))
    for a, axis in enumerate(axes):
        flat = _multisine(combs[2 * a], np.ones(len(combs[2 * a])), rows)
        share = axis.force / np.abs(flat).max()
        offset[:, a] = share * flat
        s = 2j * math.pi * combs[2 * a + 1] / (rows * period)
        law = axis.kp + axis.ki / s + axis.kd * s / (1.0 + axis.derivative_time * s)
        demand[:, a] = _multisine(combs[2 * a + 1], share / np.abs(law), rows)
    return Excitation(offset, demand, tuple(combs[0:used:2]), tuple(combs[1:used:2]), combs[used])


def _multisine(lines: I64, amplitude: F64, rows: int) -> F64:
    number = np.arange(len(lines))
    spectrum = np.zeros(rows // 2 + 1, np.complex128)
    spectrum[lines] = amplitude * np.exp(-1j * math.pi * number * (number - 1) / len(lines))
    return np.fft.irfft(spectrum, rows) * rows / 2.0
