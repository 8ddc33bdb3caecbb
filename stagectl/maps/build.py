"""Builds a friction map from a stage's history.

All measured levels go through the same tracking as in production, in order of time and with an
uninformed prior. So repeated visits are averaged with regard to the wander's correlation, old ones
count less, and drift of the whole table between two sites is not taken for a difference between
them, as far as a site was revisited. The map has the sites' final levels and a field fitted to
them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimation.field import COMMON, KERNELS, SITES, FrictionField, SiteTracker, TrackingSettings
from stagectl.errors import UnusableInput
from stagectl.history import History, Measurement, Pair, StageKey
from stagectl.maps.learning import limit_per_place
from stagectl.maps.model import FrictionMap, MapAxis, MapSite
from stagedata import F64

LEAST_SITES = 4
"""Fewer places make no map."""


class TooFewPlaces(UnusableInput):
    """The places measured make no map."""


GATHERED = 100
"""Latest measurements of each place and axis used: earlier ones add nothing, and a year of
production would take hours."""
WARMING = ((3e-5, 0.4), (2e-4, 0.3), (1e-3, 0.2), (3e-3, 0.1))
"""Rms rate of change of the level when measurements begin [1/s], and prior weights: the stage
should be warm by then, but is not always."""
_PRUNE, _HOPELESS = 200, 7.0  # every 200 measurements, drop what is less likely by exp(-7)
_OPEN = 0.5  # prior relative 1-sigma of the common level
AMPLITUDE, LENGTH, SCATTER = 0.15, 0.45, 0.05
"""Prior of the sites' levels: rms over the table, correlation length relative to the sites' extent,
and rms deviation of a site from a smooth table."""


def build_map(
    history: History,
    stage: StageKey,
    until: float = math.inf,
    since: float = -math.inf,
    settings: Mapping[str, TrackingSettings] | None = None,
) -> FrictionMap:
    """Build the map at a date.

    Args:
        history: open.
        stage: to build the map of.
        until: latest measurement used [s since 1970].
        since: earliest measurement used.
        settings: of the tracking, by axis; default: the same for all.

    Raises:
        TooFewPlaces: no axis was measured at enough of them.
    """
    measured = history.measurements(stage, since, until, limit_per_place(history, stage, GATHERED))
    by_axis: dict[str, list[Measurement]] = {}
    for entry in measured:
        by_axis.setdefault(entry.axis, []).append(entry)
    axes: dict[str, MapAxis] = {}
    for axis, entries in sorted(by_axis.items()):
        places = {entry.place for entry in entries}
        if len(places) < LEAST_SITES:
            continue
        used = (settings or {}).get(axis, TrackingSettings())
        axes[axis] = MapAxis(*_axis(entries, used), _figures(history, stage, axis, until))
    if not axes:
        raise TooFewPlaces(
            f"{history.name}: {stage}: a map takes {LEAST_SITES} places measured on one axis; "
            "'stagectl calibrate' visits them"
        )
    return FrictionMap(stage, max(entry.time for entry in measured), axes)


def _axis(
    entries: Sequence[Measurement], settings: TrackingSettings
) -> tuple[tuple[MapSite, ...], tuple]:  # type: ignore[type-arg]
    places = list(dict.fromkeys(entry.place for entry in entries))
    mean, covariance, moves = _levels(entries, places, settings)
    # Uncertainty of the common level does not concern the map's shape: take each site's deviation
    # from the mean of all.
    with_mean = covariance.mean(axis=1)
    beside = covariance.diagonal() - 2.0 * with_mean + with_mean.mean()
    sigma = np.sqrt(np.maximum(beside, 1e-8))
    level = np.exp(mean)
    last = {entry.place: entry.time for entry in entries}
    field = FrictionField(np.array(places), level, sigma)
    sites = tuple(
        MapSite(place, float(level[i]), float(sigma[i]), last[place], int(moves[i]))
        for i, place in enumerate(places)
    )
    return sites, field.nodes


def _levels(
    entries: Sequence[Measurement], places: Sequence[Pair], settings: TrackingSettings
) -> tuple[F64, F64, NDArray[np.int64]]:
    """Logarithm of the sites' final levels, its covariance, and the number of measurements of each.

    A mixture over rates of warm-up, weighted by their likelihood: a single fast rate would leave
    the shape of the table open, a single slow one would distort it.
    """
    values = np.log([entry.value for entry in entries])
    start = np.full(len(places), float(np.median(values)))
    number = {place: i for i, place in enumerate(places)}
    prior = prior_covariance(places)
    trackers, score = [], np.log([share for _, share in WARMING])
    for rate, _ in WARMING:
        tracker = SiteTracker(start, prior, replace(settings, warm_up=rate), entries[0].time)
        tracker.covariance[COMMON, COMMON] = 0.0  # the first measurement's level is the reference
        trackers.append(tracker)
    for k, (entry, value) in enumerate(zip(entries, values.tolist(), strict=True)):
        sigma = entry.sigma / entry.value
        for i, tracker in enumerate(trackers):
            tracker.advance(entry.time)
            expected, spread = tracker.expected(number[entry.place])
            variance = spread**2 + sigma**2 + settings.model_error**2
            score[i] -= 0.5 * (math.log(variance) + (value - expected) ** 2 / variance)
            tracker.observe(number[entry.place], value, sigma, entry.time)
        if k % _PRUNE == _PRUNE - 1:
            kept = score > score.max() - _HOPELESS
            trackers, score = (
                [t for t, keep in zip(trackers, kept, strict=True) if keep],
                score[kept],
            )
    weight = np.exp(score - score.max())
    weight /= weight.sum()
    row = np.eye(len(places), SITES + len(places), SITES)
    row[:, COMMON] = 1.0
    means = np.array([tracker.mean + row @ tracker.state for tracker in trackers])
    mean: F64 = weight @ means
    covariance: F64 = sum(
        (
            share * (row @ tracker.covariance @ row.T + np.outer(own - mean, own - mean))
            for share, tracker, own in zip(weight, trackers, means, strict=True)
        ),
        start=np.zeros((len(places), len(places))),
    )
    return mean, covariance, trackers[0].moves


def prior_covariance(places: Sequence[Pair]) -> F64:
    """Prior covariance of the logarithm of the sites' levels.

    Any common level, varying smoothly over the table, and slightly from site to site. Without the
    smoothness, only a site visited twice would distinguish drift from a difference between sites.
    """
    at = np.array(places)
    apart = np.linalg.norm(at[:, None] - at[None], axis=2)
    length = LENGTH * max(float(np.ptp(at, axis=0).max()), 1e-3)
    smooth: F64 = KERNELS["matern 5/2"][0](apart / length)
    return _OPEN**2 + AMPLITUDE**2 * smooth + SCATTER**2 * np.eye(len(places))


def _figures(
    history: History, stage: StageKey, axis: str, until: float
) -> dict[str, tuple[float, float]]:
    """The other figures, from the newest of the places' last estimates that has them."""
    rows = [row for row in history.at_date(stage, until) if row.axis == axis]
    found: dict[str, tuple[float, float]] = {}
    names = {name for row in rows for name in row.figures} - {"coulomb"}
    for name in sorted(names):
        having = [row for row in rows if name in row.figures]
        newest = max(having, key=lambda row: row.time)
        found[name] = (float(newest.figures[name]), newest.sigma(name))
    return found
