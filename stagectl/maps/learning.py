"""Learns from a stage's history how fast its friction changes, per axis and figure.

The rate of the Coulomb force goes into the settings of the tracking, those of the other figures
into the drift per move that the estimator assumes.
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
"""Latest differences used: they suffice, and a run should not wait for more."""
MOST_TOGETHER, LEAST_EACH = 6000, 10
"""Most measurements of all places of an axis, and least of each place."""
RECENT = 20
"""Latest measurements of each place, for the time between moves."""
LEAST_STEPS = 20
"""Least number of differences to learn a rate from; else the default stands."""


def limit_per_place(history: History, stage: StageKey, most: int) -> int:
    """Number of latest measurements of every place to use, at most `most`."""
    places = max(len(history.places(stage)), 1)
    return min(most, max(MOST_TOGETHER // places, LEAST_EACH))


def tracking_settings(
    machine: Machine, history: History, stage: StageKey
) -> dict[str, TrackingSettings]:
    """Settings of the tracking, by axis.

    Args:
        machine: its `repeatability` is the wander of the level.
        history: open.
        stage: to learn from.
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
    """Relative 1-sigma of the change per move of all figures but the Coulomb force.

    Args:
        history: open.
        stage: to learn from.
        axes: their names.

    Returns:
        Axis -> figure -> drift, without those of which the history says too little.
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
        # Within an hour, allow the change seen from one hour to the next.
        found[axis] = {
            name: math.sqrt((noise.rate**2 / DAY + noise.scatter**2 / HOUR) * gap)
            for name, noise in figure_noise(history, stage, axis).items()
            if name != "coulomb" and noise.steps >= LEAST_STEPS
        }
    return found


def level_noise(measured: Sequence[Measurement]) -> ProcessNoise:
    """Rate of change of one axis' single sites, without their common change.

    Args:
        measured: of one axis.
    """
    # Hourly means: wander and warm-up within an hour are modelled separately.
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

    One estimate per hour is used, for it contains those before it.
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
    """The latest parts of all series, MOST_STEPS differences together."""
    most = max(MOST_STEPS // max(len(series), 1), 2) + 1
    return [Series(s.time[-most:], s.value[-most:], s.sigma[-most:]) for s in series]


def _series(rows: Sequence[tuple[float, float, float]]) -> Series:
    time, value, sigma = (np.array(column, dtype=np.float64) for column in zip(*rows, strict=True))
    return Series(time, value, sigma)
