"""The active map in production: the friction to expect at a place, updated by every move.

The map's field, evaluated once on a grid, gives the level between sites; tracking of the sites
(`estimation.field.SiteTracker`) gives their change since. Steps of the level are reported.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.spatial import cKDTree

from estimation.field import FrictionField, SiteTracker, TrackingSettings
from estimation.online import Estimate
from stagectl.config.machine import Machine
from stagectl.history.measured import measured_level, misfit_error
from stagectl.history.records import Measurement, Pair
from stagectl.maps.model import FrictionMap
from stagectl.maps.place_index import PlaceIndex
from stagectl.sequencer import Expectation, LevelStepped
from stagedata import F64

SITE_RADIUS = 2e-3
"""A move that ends within this distance of a site is a move to that site [m]."""
GRID = 4e-3
"""Pitch of the field's grid: a tenth of what a map resolves [m]."""


class LevelGrid:
    """A field on a grid, with bilinear interpolation.

    Args:
        field: of the map.
        low, high: corners of the table [m].
    """

    def __init__(self, field: FrictionField, low: Pair, high: Pair) -> None:
        self._low = np.array(low)
        counts = [max(2, math.ceil((b - a) / GRID) + 1) for a, b in zip(low, high, strict=True)]
        self._step = np.array(
            [(b - a) / (n - 1) for a, b, n in zip(low, high, counts, strict=True)]
        )
        axes = [np.linspace(a, b, n) for a, b, n in zip(low, high, counts, strict=True)]
        nodes = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 2)
        self._values = np.log(field.value(nodes)).reshape(counts)

    def at(self, path: F64) -> F64:
        """Logarithm of the level at positions [m], shape (K, 2)."""
        place = (path - self._low) / self._step
        last = np.array(self._values.shape) - 2
        corner = np.clip(np.floor(place).astype(np.int64), 0, last)
        u, v = np.clip(place - corner, 0.0, 1.0).T
        i, j = corner.T
        z = self._values
        result: F64 = (1 - u) * ((1 - v) * z[i, j] + v * z[i, j + 1]) + u * (
            (1 - v) * z[i + 1, j] + v * z[i + 1, j + 1]
        )
        return result


class TrackedPlaces:
    """`sequencer.Places` with a friction map.

    Args:
        friction_map: active.
        machine: nothing is known of those of its axes that the map lacks.
        sites: that the run will visit [m].
        settings: of the tracking, by axis.
        origin: of the stage's time [s since 1970].

    Attributes:
        sites: tracked places, those of the map and those visited [m].
        trackers: of the sites, by axis.
        origin: as above.
        on_step: called with each step of the level, by default to no effect.
    """

    def __init__(
        self,
        friction_map: FrictionMap,
        machine: Machine,
        sites: Sequence[Pair],
        settings: Mapping[str, TrackingSettings],
        origin: float,
    ) -> None:
        self._names = tuple(machine.axes)
        self.origin = origin
        self.on_step: Callable[[LevelStepped], object] = lambda _: None
        first, second, *_ = (axis.travel for axis in machine.axes.values())
        low, high = zip(first, second, strict=True)
        known = [site.place for axis in friction_map.axes.values() for site in axis.sites]
        self.sites: list[Pair] = []
        self._index = PlaceIndex(SITE_RADIUS)
        for place in [*known, *sites]:
            if self.number_of(place) is None:
                self._add((float(place[0]), float(place[1])))
        self._fields: dict[str, FrictionField] = {}
        self._grids: dict[str, LevelGrid] = {}
        self.trackers: dict[str, SiteTracker] = {}
        for name, axis in friction_map.axes.items():
            field = self._fields[name] = axis.field()
            self._grids[name] = LevelGrid(field, low, high)
            mean, covariance = field.joint(np.array(self.sites))
            own = settings.get(name, TrackingSettings())
            self.trackers[name] = SiteTracker(mean, covariance, own, friction_map.date)
        self._width = self._site_width()
        self._place: Pair | None = None
        self._target: int | None = None

    def replay(self, measured: Sequence[Measurement]) -> None:
        """Update the sites with measurements since the map was made, in order of time."""
        for entry in measured:
            if entry.axis in self.trackers:
                site = self._site_or_new(entry.place)
                self.trackers[entry.axis].observe(
                    site, math.log(entry.value), entry.sigma / entry.value, entry.time
                )

    def expected_at(
        self, target: Sequence[float], time: float
    ) -> Sequence[Expectation | None] | None:
        """As `sequencer.Places`."""
        place = (float(target[0]), float(target[1]))
        if self._place is not None and math.dist(place, self._place) <= SITE_RADIUS:
            return None
        self._place = place
        self._target = self._site_or_new(place)
        return [self._expectation(name, time) for name in self._names]

    def coulomb_variation(self, axis: int, path: F64) -> F64:
        """As `sequencer.Places`: float64[K], relative, for a path float64[K, n] [m]."""
        name = self._names[axis]
        if name not in self.trackers or self._place is None:
            return np.zeros(len(path))
        level = self._level(name, np.vstack([path, self._place]))
        result: F64 = np.expm1(level[:-1] - level[-1])
        return result

    def knows_path(self, kind: str) -> bool:
        """As `sequencer.Places`: the map covers every path."""
        return True

    def learn(self, axis: int, kind: str, estimate: Estimate, time: float) -> Expectation | None:
        """As `sequencer.Places`.

        A macro-move shows the level along its path as much as at its end, so after one the site's
        own expectation stands, unless the level has stepped.
        """
        name = self._names[axis]
        if name not in self.trackers or self._target is None:
            return None
        shown = measured_level(estimate)
        if shown is None:
            return None
        value, sigma = shown
        seen = self.trackers[name].observe(
            self._target, math.log(value), sigma / value, self.origin + time, misfit_error(estimate)
        )
        if seen.step is not None:
            place, everywhere = self.sites[self._target], seen.step == "common"
            self.on_step(LevelStepped(name, place, time, seen.change, everywhere))
        elif kind != "macro":
            return None
        return self._expectation(name, time)

    def _expectation(self, name: str, time: float) -> Expectation | None:
        if name not in self.trackers or self._target is None:
            return None
        tracker = self.trackers[name]
        level = tracker.wander  # as of the last measurement, like the estimator's
        tracker.advance(self.origin + time)
        mean, sigma = tracker.expected(self._target, wander=False)
        coulomb = math.exp(mean)
        return Expectation(coulomb, sigma * coulomb, level)

    def _level(self, name: str, path: F64) -> F64:
        """Logarithm of the level along a path without the common part, shape (K,).

        Each site's deviation from the map fades out around it.
        """
        tracker = self.trackers[name]
        away = path[:, None, :] - np.array(self.sites)[None, :, :]
        weight = np.exp(-0.5 * np.einsum("kij,kij->ki", away, away) / self._width**2)
        deviation = tracker.state[len(tracker.state) - len(self.sites) :]
        result: F64 = self._grids[name].at(path)
        result += weight @ deviation / np.maximum(weight.sum(axis=1), 1.0)
        return result

    def _site_width(self) -> float:
        """Standard deviation of a site's influence: a third of the distance between sites [m]."""
        places = np.array(self.sites)
        if len(places) < 2:
            return 0.01
        apart, _ = cKDTree(places).query(places, k=2)  # the nearest one is the site itself
        return float(np.median(apart[:, 1])) / 3.0

    def number_of(self, place: Sequence[float]) -> int | None:
        """Number of the site at a place [m]; None where there is none."""
        return next(iter(self._index.near(place)), None)

    def _add(self, place: Pair) -> None:
        self.sites.append(place)
        self._index.add(place)

    def _site_or_new(self, place: Pair) -> int:
        found = self.number_of(place)
        if found is not None:
            return found
        self._add(place)
        for name, tracker in self.trackers.items():
            there = self._fields[name].at(np.array([place]))
            tracker.add_site(math.log(float(there.value[0])), float(there.sigma[0]) ** 2)
        return len(self.sites) - 1
