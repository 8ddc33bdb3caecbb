"""Random-walk rate of a figure, from its history at several places.

Every place's series is a random walk of unknown rate, seen with noise of known size plus an unknown
scatter that all series share. Rate and scatter are those that make the series most probable
(prediction-error decomposition: A. C. Harvey, Forecasting, Structural Time Series Models and the
Kalman Filter, 1989, section 3.4), on a grid, with a weak prior: short histories say little.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stagedata import F64

DAY = 86400.0


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """One figure at one place.

    Attributes:
        time: [s], ascending, shape (n,).
        value: relative or logarithmic, shape (n,).
        sigma: standard deviation of each, shape (n,).
    """

    time: F64
    value: F64
    sigma: F64


@dataclass(frozen=True, slots=True)
class ProcessNoise:
    """What the series show.

    Attributes:
        rate: of the random walk [1/sqrt(day)].
        scatter: rms from one time to the next beside the known noise.
        steps: how many differences it was learnt from.
    """

    rate: float
    scatter: float
    steps: int


def learn(
    series: Sequence[Series],
    usual_rate: float = 0.01,
    usual_scatter: float = 0.01,
    spread: float = 1.5,
) -> ProcessNoise:
    """Rate and scatter that fit best.

    Args:
        series: of one figure of one axis, one per place.
        usual_rate: median of the rate's prior [1/sqrt(day)].
        usual_scatter: median of the scatter's.
        spread: standard deviation of its logarithm.
    """
    steps = np.linspace(-2.5, 2.5, 21)
    rate = usual_rate * np.exp(spread * steps)[:, None]
    scatter = usual_scatter * np.exp(spread * steps)[None, :]
    score = -0.5 * (steps[:, None] ** 2 + steps[None, :] ** 2)
    count = 0
    for entry in series:
        count += max(len(entry.time) - 1, 0)
        score = score + _likelihood(entry, rate**2 / DAY, scatter**2)
    best = np.unravel_index(int(np.argmax(score)), score.shape)
    return ProcessNoise(float(rate[best[0], 0]), float(scatter[0, best[1]]), count)


def _likelihood(series: Series, walk: F64, scatter: F64) -> F64:
    """Logarithm of the likelihood on the grid, the first value being free."""
    if len(series.time) < 2:
        return np.zeros((walk.shape[0], scatter.shape[1]))
    mean = np.full((walk.shape[0], scatter.shape[1]), float(series.value[0]))
    variance = np.zeros_like(mean) + float(series.sigma[0]) ** 2 + scatter
    total = np.zeros_like(mean)
    for k in range(1, len(series.time)):
        variance = variance + walk * max(float(series.time[k] - series.time[k - 1]), 0.0)
        noise = float(series.sigma[k]) ** 2 + scatter
        expected = variance + noise
        off = float(series.value[k]) - mean
        total -= 0.5 * (np.log(expected) + off**2 / expected)
        gain = variance / expected
        mean = mean + gain * off
        variance = variance * (1.0 - gain)
    return total
