"""The frequency response from demand to position, measured and simulated, and its coherence.

Welch's method with Hann windows on velocities, which suppresses the leakage of long strokes; demand
and positions are differenced alike, so the response is that of positions. With friction the loop is
not linear: the response is that of these moves, and its scatter is not noise. The simulation makes
the same moves, so the uncertainty is taken from the scatter of measured minus simulated response.

J. S. Bendat, A. G. Piersol, Random Data, 4th ed., 2010, sections 6.1 and 9.1.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim2real.residuals.course import BEFORE, MEASURED, Course
from stagedata import BoolArray, FloatArray

_SEGMENT = 0.5
"""Length of a segment [s]."""
_FEWEST = 8
"""Fewest segments for an estimate."""
_PER_DECADE = 30
"""Frequency bands per decade, where the segments resolve that many."""
KNOWN_TO = 0.1
"""A frequency counts as excited if the standard deviation of measured minus simulated response,
relative to the measured one, is below this."""


@dataclass(frozen=True, slots=True, eq=False)
class FrequencyResponse:
    """Response of the position to its demand at n frequencies.

    Attributes:
        frequency: float64[n] [Hz].
        response: `MEASURED` or model -> complex128[n].
        coherence: of the measured response, float64[n], 0..1.
        excited: bool[n], whether measured and simulated response can be compared to `KNOWN_TO`.
    """

    frequency: FloatArray
    response: Mapping[str, NDArray[np.complex128]]
    coherence: FloatArray
    excited: BoolArray


def estimate_response(course: Course) -> FrequencyResponse | None:
    """Response of position to demand; None without demand or positions, or if too short.

    Args:
        course: of the axis.
    """
    if course.demand is None or not np.ptp(course.demand) > 0.0 or not course.valid.any():
        return None
    length = 2 ** round(np.log2(max(_SEGMENT / course.period, 32.0)))
    segments = _segments(course, length)
    if len(segments) < _FEWEST:
        return None
    window = np.hanning(length)

    def spectra(values: FloatArray) -> NDArray[np.complex128]:
        steps = np.diff(values, prepend=values[:1])
        return np.fft.rfft(window * np.stack([steps[s] for s in segments]), axis=1)

    demand = spectra(course.demand)
    outputs = {MEASURED: spectra(_filled(course.measured["position"], course.valid))}
    for model, signals in course.simulated.items():
        if "position" in signals:
            outputs[model] = spectra(signals["position"])
    lines = np.fft.rfftfreq(length, course.period)[1:]
    band = np.floor(_PER_DECADE * np.log10(lines / lines[0]) + 1e-9).astype(np.int64)
    _, band, width = np.unique(band, return_inverse=True, return_counts=True)

    def power(one: NDArray[np.complex128], other: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Cross spectrum, averaged over segments and over the lines of each band."""
        each = np.sum(np.conj(one) * other, axis=0)[1:]
        sums: NDArray[np.complex128] = np.bincount(band, weights=each.real) + 1j * np.bincount(
            band, weights=each.imag
        )
        return sums

    own = power(demand, demand).real
    measured = power(demand, outputs[MEASURED])
    other = power(outputs[MEASURED], outputs[MEASURED]).real
    left = outputs[MEASURED] - outputs[BEFORE]
    difference = power(demand, left)
    scatter = power(left, left).real
    # Only spectral lines in which the demand has power carry information; neighbours correlate.
    powers = np.bincount(band, weights=np.sum(np.abs(demand[:, 1:]) ** 4, axis=0))
    with np.errstate(divide="ignore", invalid="ignore"):
        coherence = np.clip(np.nan_to_num(np.abs(measured) ** 2 / (own * other)), 0.0, 1.0)
        freedom = np.maximum(0.5 * own**2 / powers - 1.0, 0.0)
        unexplained = np.maximum(scatter - np.abs(difference) ** 2 / own, 0.0)
        uncertainty = np.sqrt(unexplained * own / freedom) / np.abs(measured)
        response = {name: power(demand, spectrum) / own for name, spectrum in outputs.items()}
    excited = (own > 0.0) & (uncertainty < KNOWN_TO)
    frequency = np.bincount(band, weights=lines) / width
    return FrequencyResponse(frequency, response, coherence, excited)


def _segments(course: Course, length: int) -> list[slice]:
    """Segments that overlap by half, none across two recordings."""
    ends = [*course.starts[1:], len(course.position)]
    return [
        slice(first, first + length)
        for start, end in zip(course.starts, ends, strict=True)
        for first in range(start + 1, end - length + 1, length // 2)
    ]


def _filled(values: FloatArray, valid: BoolArray) -> FloatArray:
    """Values with invalid samples replaced by linear interpolation."""
    if valid.all():
        return values
    at = np.arange(len(values))
    return np.interp(at, at[valid], values[valid])
