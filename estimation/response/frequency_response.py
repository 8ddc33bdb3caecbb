"""From a record of a shaken axis to its responses, with their uncertainty."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.response.excitation import I64
from stagedata import F64

C128 = NDArray[np.complex128]

STUCK = 0.3
"""Usual uncertainty of a response, over its size, above which there is none."""
_PASSES = 3
"""Each response frees the other's lines from itself; they converge by the rounding's share."""
SHOWS = 0.1
"""Forces show on lines where the response is above this share of its maximum."""
_NEIGHBOURS = 5
"""Lines either side over which the scatter is averaged: periods alone are too few."""


@dataclass(frozen=True, slots=True, eq=False)
class FrequencyResponse:
    """Responses of an axis' sampled position, its drive's loop closed.

    Attributes:
        offset_at, demand_at: frequencies [Hz], (L,) and (M,).
        offset: to the force offsets of rows [m/N], (L,).
        demand: to the target positions of rows, (M,).
        offset_sigma, demand_sigma: 1 sigma of each component, units as the responses'.
        distortion: what is not linear in the axis, as a force besides the offset [N rms].
    """

    offset_at: F64
    demand_at: F64
    offset: C128
    demand: C128
    offset_sigma: F64
    demand_sigma: F64
    distortion: float = 0.0

    def on_offset_lines(self) -> C128:
        """The response to the demand at the frequencies of that to the offset, (L,)."""
        return between(self.offset_at, self.demand_at, self.demand)


class AxisResponse(NamedTuple):
    """An axis at rest, where friction sticks as a spring, and while it slides."""

    rest: FrequencyResponse
    sliding: FrequencyResponse

    @property
    def sticks(self) -> bool:
        """Whether friction holds the axis at rest: without presliding, nothing is measured."""
        return bool(np.median(self.rest.offset_sigma / np.abs(self.rest.offset)) > STUCK)


def between(at: F64, known_at: F64, known: C128) -> C128:
    """A response between its lines, at frequencies `at` [Hz]."""
    return np.interp(at, known_at, known.real) + 1j * np.interp(at, known_at, known.imag)


def evaluate(
    position: F64, demand: F64, offset: F64, lines: tuple[I64, I64, I64], period: float
) -> FrequencyResponse:
    """The responses of one axis from whole periods of its multisines.

    What was really sent counts: rounding puts a little of each signal on the lines of the others.

    Args:
        position: sampled, less the motion without shaking [m], (P, N): P > 1 periods of N rows.
        demand: target positions less the same [m], (P, N).
        offset: force offsets [N], (P, N).
        lines: of offset, of the demand, and of nobody.
        period: Ts [s].
    """
    count, rows = position.shape
    each = [np.fft.rfft(signal, axis=1) for signal in (position, demand, offset)]
    y, r, f = (spectra.mean(axis=0) for spectra in each)
    scatter = np.abs(each[0] - y) ** 2
    noise = np.sqrt(scatter.sum(axis=0) / (2.0 * (count - 1) * count))
    mine, others, nobodys = lines
    at, other_at = mine / (rows * period), others / (rows * period)
    to_offset = y[mine] / f[mine]
    to_demand = y[others] / r[others]
    for _ in range(_PASSES):
        to_demand = (y[others] - between(other_at, at, to_offset) * f[others]) / r[others]
        to_offset = (y[mine] - between(at, other_at, to_demand) * r[mine]) / f[mine]
    empty_at = nobodys / (rows * period)
    by_force, by_demand = between(empty_at, at, to_offset), between(empty_at, other_at, to_demand)
    left = each[0][:, nobodys] - by_force * each[2][:, nobodys] - by_demand * each[1][:, nobodys]
    distortion = _distortion(left / by_force, np.abs(by_force)) / math.sqrt(rows)
    per_line = distortion * math.sqrt(rows / 2.0)
    on_others = np.abs(between(other_at, at, to_offset)) * per_line
    return FrequencyResponse(
        at,
        other_at,
        to_offset,
        to_demand,
        np.hypot(_smooth(noise[mine]), np.abs(to_offset) * per_line) / np.abs(f[mine]),
        np.hypot(_smooth(noise[others]), on_others) / np.abs(r[others]),
        distortion,
    )


def _distortion(force: C128, shows: F64) -> float:
    """What repeats itself from period to period, spread over all lines: steps, not a vibration.

    Args:
        force: on lines of nobody, each period, (P, E) [N].
        shows: how much position a force makes there, (E,).
    """
    used = shows > SHOWS * shows.max()
    common = (force[1:, used] * force[:-1, used].conj()).real.mean(axis=0)
    # half of the lines are below ln 2 of the mean where all have the same power
    return math.sqrt(max(float(np.median(common)) / math.log(2.0), 0.0))


def _smooth(noise: F64) -> F64:
    """Root mean square over neighbouring lines."""
    window = np.ones(2 * _NEIGHBOURS + 1)
    total = np.convolve(noise**2, window, "same")
    return np.sqrt(total / np.convolve(np.ones(len(noise)), window, "same"))
