"""How a stage's friction changes, learnt from its history, per axis and figure.

The Coulomb force of each site goes into the settings of the tracking, the other figures into how
far the estimator lets them drift from move to move.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from estimation.field import DAY, ProcessNoise, Series, TrackingSettings, learn
from stagectl.config.machine import Machine
from stagectl.history import History, Measurement, Pair, StageKey

HOUR = 3600.0
MOST_STEPS = 400
"""The latest differences say enough, and a run should not wait for more."""
MOST_TOGETHER, LEAST_EACH = 6000, 10
"""Measurements of all places of an axis that can be waited for, and of each that are wanted."""
RECENT = 20
"""Of each place, to see how long it is from move to move."""
LEAST_STEPS = 20
"""Fewer differences than that say nothing; the usual rates stand."""


def of_each(history: History, stage: StageKey, most: int) -> int:
    """How many of the last measurements of every place can be gone through, at most `most`."""
    places = max(len(history.places(stage)), 1)
    return min(most, max(MOST_TOGETHER // places, LEAST_EACH))


def tracking_settings(
    machine: Machine, history: History, stage: StageKey
) -> dict[str, TrackingSettings]:
    """Settings of the tracking by axis.

    Args:
        machine: whose `repeatability` is the level's wander.
        history: open.
        stage: whose.
    """
    measured = history.measurements(stage, each=MOST_STEPS // 4, apart=HOUR)
    settings: dict[str, TrackingSettings] = {}
    for name, axis in machine.axes.items():
        wander = axis.plant.friction.repeatability
        start = TrackingSettings(
            wander=max(wander.coulomb, 1e-4), correlation_time=wander.correlation_time
        )
        noise = level_noise([m for m in measured if m.axis == name])
        if noise.steps >= LEAST_STEPS:
            start = replace(start, site_rate=noise.rate)
        settings[name] = start
    return settings


def figure_drift(
    history: History, stage: StageKey, axes: Sequence[str]
) -> dict[str, dict[str, float]]:
    """Relative 1-sigma by which the figures but the Coulomb force change from move to move.

    Axis -> figure -> drift; what the history says too little of is absent.

    Args:
        history: open.
        stage: whose.
        axes: their names.
    """
    measured = history.measurements(stage, each=RECENT)
    found: dict[str, dict[str, float]] = {}
    for axis in axes:
        time = np.array([m.time for m in measured if m.axis == axis])
        apart = np.diff(time)
        apart = apart[(apart > 0.0) & (apart < HOUR)]
        if not len(apart):
            continue
        gap = float(np.median(apart))
        # Within an hour it may go as far as it is seen to do from one hour to the next.
        found[axis] = {
            name: math.sqrt((noise.rate**2 / DAY + noise.scatter**2 / HOUR) * gap)
            for name, noise in figure_noise(history, stage, axis).items()
            if name != "coulomb" and noise.steps >= LEAST_STEPS
        }
    return found


def level_noise(measured: Sequence[Measurement]) -> ProcessNoise:
    """Rate of one axis' sites on their own: what is common to all of them at a time is taken out.

    Args:
        measured: of one axis.
    """
    # Hourly means: within an hour it is wander and warm-up, which the tracking has apart.
    cells: dict[tuple[Pair, int], list[float]] = {}
    for entry in measured:
        cells.setdefault((entry.place, int(entry.time // HOUR)), []).append(math.log(entry.value))
    by_hour: dict[int, dict[Pair, tuple[float, int]]] = {}
    for (place, hour), values in cells.items():
        by_hour.setdefault(hour, {})[place] = (float(np.mean(values)), len(values))
    places = sorted({place for place, _ in cells})
    level = {
        place: float(np.mean([row[place][0] for row in by_hour.values() if place in row]))
        for place in places
    }
    series: dict[Pair, list[tuple[float, float, float]]] = {}
    for hour, row in sorted(by_hour.items()):
        common = float(np.mean([value - level[place] for place, (value, _) in row.items()]))
        for place, (value, count) in row.items():
            series.setdefault(place, []).append((hour * HOUR, value - common, 0.01 / count**0.5))
    return learn(_latest([_series(rows) for rows in series.values()]))


def figure_noise(history: History, stage: StageKey, axis: str) -> Mapping[str, ProcessNoise]:
    """Rate and scatter of every friction figure of one axis, from the trends of all places.

    Of each hour one estimate counts: those before it have gone into it.
    """
    by_name: dict[str, list[Series]] = {}
    for place in history.places(stage):
        trend = history.trend(stage, axis, place, last=MOST_STEPS // 4, apart=HOUR)
        for name, values in trend.values.items():
            ok = np.isfinite(values) & (values > 0.0)
            if ok.sum() >= 2:
                value = values[ok]
                by_name.setdefault(name, []).append(
                    Series(trend.time[ok], np.log(value), trend.sigma[name][ok] / value)
                )
    return {name: learn(_latest(series)) for name, series in by_name.items()}


def _latest(series: Sequence[Series]) -> list[Series]:
    """The ends of all series, MOST_STEPS differences together."""
    most = max(MOST_STEPS // max(len(series), 1), 2) + 1
    return [Series(s.time[-most:], s.value[-most:], s.sigma[-most:]) for s in series]


def _series(rows: Sequence[tuple[float, float, float]]) -> Series:
    time, value, sigma = (np.array(column, dtype=np.float64) for column in zip(*rows, strict=True))
    return Series(time, value, sigma)
