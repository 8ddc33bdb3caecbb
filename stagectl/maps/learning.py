"""How a stage's friction changes, learnt from its history: the settings of the tracking."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from estimation.process_noise import ProcessNoise, Series, learn
from estimation.site_tracking import TrackingSettings
from stagectl.config.machine import Machine
from stagectl.history.port import History
from stagectl.history.records import Measurement, Pair, StageKey

HOUR = 3600.0
LEAST_STEPS = 20
"""Fewer differences than that say nothing; the usual rates stand."""


def tracking_settings(
    machine: Machine, measured: Sequence[Measurement]
) -> dict[str, TrackingSettings]:
    """Settings of the tracking by axis.

    Args:
        machine: whose `repeatability` is the level's wander.
        measured: what moves have shown, in the order of time.
    """
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
    return learn([_series(rows) for rows in series.values()])


def figure_noise(history: History, stage: StageKey, axis: str) -> Mapping[str, ProcessNoise]:
    """Rate and scatter of every friction figure of one axis, from the trends of all places."""
    by_name: dict[str, list[Series]] = {}
    for place in history.places(stage):
        trend = history.trend(stage, axis, place)
        for name, values in trend.values.items():
            ok = np.isfinite(values) & (values > 0.0)
            if ok.sum() >= 2:
                value = values[ok]
                by_name.setdefault(name, []).append(
                    Series(trend.time[ok], np.log(value), trend.sigma[name][ok] / value)
                )
    return {name: learn(series) for name, series in by_name.items()}


def _series(rows: Sequence[tuple[float, float, float]]) -> Series:
    time, value, sigma = (np.array(column, dtype=np.float64) for column in zip(*rows, strict=True))
    return Series(time, value, sigma)
