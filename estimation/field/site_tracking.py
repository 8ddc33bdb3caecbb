"""Friction level of many sites, tracked from move to move; distinguishes steps from drift.

The logarithm of an axis' sliding level at site i and time t is

    map_i + d_i + c(t) + w(t)

- d_i: what site i is off the map by; begins with the map's own joint covariance, so that one site
  says something of its neighbours, and walks at random with a rate per root day (`site_rate`);
- c: what all sites have in common: warm-up, lubricant. It changes at a rate that is
  itself an Ornstein-Uhlenbeck process: fast at the start and after a pause, when the stage warms
  up, and dying away from there. A pause mostly forgets it;
- w: the level's own wander, an Ornstein-Uhlenbeck process of known rms and correlation time.

A Kalman filter over (w, c, c', d_1 .. d_n): the arrival cost of the next move, wherever it goes.
A surprise at one site that neither drift nor wander explains is a step there (`change`); the same
at the next site as well is one of the whole table, and c takes it.

What it reaches: docs/figures.md, friction maps.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from estimation.field.change import StepDetector
from stagedata import F64

WANDER, COMMON, TREND, SITES = range(4)
DAY = 86400.0


@dataclass(frozen=True, slots=True)
class TrackingSettings:
    """What may change, and how fast. Everything relative: 0.01 is 1 %.

    Attributes:
        wander, correlation_time: rms and correlation time [s] of the level's own wander.
        site_rate: of a site on its own [1/sqrt(day)].
        common_rate: of all sites together, beside the trend [1/sqrt(s)].
        trend, trend_time: rms [1/s] and correlation time [s] of the common rate of change.
        warm_up: rms of that rate at the start and after a long pause [1/s].
        pause, pause_time: rms by which the common level may have changed in a long pause, and how
            long it takes for that [s].
        model_error: rms of what a measurement misses beside its own sigma.
        vague: measurements whose own sigma is at least this are of moves that hardly slid; a share
            `astray` of them is off by `outlier` (rms) without showing it.
    """

    wander: float = 0.01
    correlation_time: float = 0.5
    site_rate: float = 0.01
    common_rate: float = 3e-4
    trend: float = 3e-4
    trend_time: float = 200.0
    warm_up: float = 3e-3
    pause: float = 0.2
    pause_time: float = 600.0
    model_error: float = 0.004
    vague: float = 0.006
    astray: float = 0.01
    outlier: float = 0.03


@dataclass(frozen=True, slots=True)
class Observation:
    """What one measurement at a site brought.

    Attributes:
        surprise: measured minus expected over its standard deviation; where the measurement may be
            astray, the normal z that is as unlikely.
        change: measured over expected, minus 1.
        step: "site" or "common" where the level has stepped, else None; a "common" one takes the
            last "site" one back.
    """

    surprise: float
    change: float
    step: Literal["site", "common"] | None = None


class SiteTracker:
    """Levels of one axis.

    Args:
        mean: logarithm of the map's level at each site, shape (n,).
        covariance: of it, shape (n, n).
        settings: what may change.
        time: from when on [s].

    Attributes:
        mean: map_i, shape (n,).
        state: (w, c, c', d_1 .. d_n).  covariance: of it.
        time: of the state [s].
        moves: measurements at each site.
    """

    def __init__(
        self, mean: F64, covariance: F64, settings: TrackingSettings, time: float = -math.inf
    ) -> None:
        n = len(mean)
        self.settings = settings
        self.mean = np.array(mean, dtype=np.float64)
        self.state: F64 = np.zeros(SITES + n)
        self.covariance: F64 = np.zeros((SITES + n, SITES + n))
        self.covariance[SITES:, SITES:] = covariance
        self.covariance[WANDER, WANDER] = settings.wander**2
        self.covariance[COMMON, COMMON] = settings.pause**2
        self.covariance[TREND, TREND] = settings.warm_up**2
        self.time = time
        self.moves = np.zeros(n, dtype=np.int64)
        self._detectors = [StepDetector() for _ in range(n)]
        # Site, sign, size of the last step, and what the site has taken of it.
        self._last_step: tuple[int, int, float, float] | None = None

    def add_site(self, mean: float, variance: float) -> int:
        """A place that was not among the sites; returns its number."""
        self.mean = np.append(self.mean, mean)
        self.state = np.append(self.state, 0.0)
        size = len(self.state)
        covariance = np.zeros((size, size))
        covariance[:-1, :-1] = self.covariance
        covariance[-1, -1] = variance
        self.covariance = covariance
        self.moves = np.append(self.moves, 0)
        self._detectors.append(StepDetector())
        return len(self.mean) - 1

    def numbers(self) -> dict[str, F64]:
        """The state apart from `settings` and `time`, to be stored; `of_numbers` restores it."""
        step = self._last_step
        return {
            "mean": self.mean,
            "state": self.state,
            "covariance": self.covariance,
            "moves": self.moves.astype(np.float64),
            "sums": np.array([(d.up, d.down) for d in self._detectors]).reshape(-1, 2),
            "last_step": np.array([] if step is None else step, dtype=np.float64),
        }

    @classmethod
    def of_numbers(
        cls, numbers: Mapping[str, F64], settings: TrackingSettings, time: float
    ) -> SiteTracker:
        """The tracker whose state `numbers` returned.

        Args:
            numbers: of it.
            settings: of it.
            time: of its state [s].

        Raises:
            KeyError, ValueError: they are not whole, or do not belong together.
        """
        mean, covariance = numbers["mean"], numbers["covariance"]
        size = SITES + len(mean)
        if covariance.shape != (size, size) or numbers["state"].shape != (size,):
            raise ValueError("the tracker's arrays do not fit together")
        tracker = cls(mean, covariance[SITES:, SITES:], settings, time)
        tracker.state, tracker.covariance = numbers["state"].copy(), covariance.copy()
        tracker.moves = numbers["moves"].astype(np.int64)
        for detector, (up, down) in zip(tracker._detectors, numbers["sums"].tolist(), strict=True):
            detector.up, detector.down = up, down
        if len(numbers["last_step"]):
            site, sign, size_, taken = numbers["last_step"].tolist()
            tracker._last_step = (int(site), int(sign), size_, taken)
        return tracker

    def advance(self, time: float) -> None:
        """Let time pass until `time` [s]; no effect for the past."""
        if not math.isfinite(self.time):
            self.time = time
            return
        elapsed = time - self.time
        if elapsed <= 0.0:
            return
        self.time = time
        s, state, p = self.settings, self.state, self.covariance
        keep = math.exp(-elapsed / s.correlation_time)
        hold = math.exp(-elapsed / s.trend_time)
        grown = s.trend_time * (1.0 - hold)  # the integral of the trend's own decay
        state[COMMON] += grown * state[TREND]
        state[TREND] *= hold
        state[WANDER] *= keep
        # Rows, then columns, of the transition.
        p[COMMON, :] += grown * p[TREND, :]
        p[TREND, :] *= hold
        p[WANDER, :] *= keep
        p[:, COMMON] += grown * p[:, TREND]
        p[:, TREND] *= hold
        p[:, WANDER] *= keep
        p[WANDER, WANDER] += (1.0 - keep**2) * s.wander**2
        # Of a pause, not of time: seconds from move to move must not add up to one.
        paused = 1.0 - math.exp(-((elapsed / s.pause_time) ** 2))
        p[TREND, TREND] += s.trend**2 * (1.0 - hold**2) + s.warm_up**2 * paused
        cross = s.trend**2 * s.trend_time * (1.0 - hold) ** 2
        p[COMMON, TREND] += cross
        p[TREND, COMMON] += cross
        tau, h = s.trend_time, elapsed / s.trend_time
        integrated = (s.trend * tau) ** 2 * max(2.0 * h - 3.0 + 4.0 * hold - hold**2, 0.0)
        slow = 1.0 - math.exp(-elapsed / s.pause_time)
        # In a pause the integrated trend would grow without bound; the pause's own rms is its end.
        p[COMMON, COMMON] += min(integrated, s.pause**2 * slow) + min(
            s.common_rate**2 * elapsed, s.pause**2 * slow
        )
        p[range(SITES, len(state)), range(SITES, len(state))] += s.site_rate**2 * elapsed / DAY

    def expected(self, site: int, wander: bool = True) -> tuple[float, float]:
        """Logarithm of the level at a site now, and its standard deviation.

        Args:
            site: its number.
            wander: with the level's wander as it is now, else without.
        """
        row = self._row(site, wander)
        mean = self.mean[site] + float(row @ self.state)
        return mean, math.sqrt(max(float(row @ self.covariance @ row), 0.0))

    def off_map(self, site: int) -> tuple[float, float]:
        """d_i: a site's deviation from the map beyond the common change; and its sigma."""
        i = SITES + site
        return float(self.state[i]), math.sqrt(max(float(self.covariance[i, i]), 0.0))

    @property
    def common(self) -> tuple[float, float]:
        """c, the change since the map that all sites share, and its standard deviation."""
        return float(self.state[COMMON]), math.sqrt(float(self.covariance[COMMON, COMMON]))

    @property
    def wander(self) -> tuple[float, float]:
        """The level's wander w and its standard deviation."""
        return float(self.state[WANDER]), math.sqrt(float(self.covariance[WANDER, WANDER]))

    def observe(
        self, site: int, value: float, sigma: float, time: float, doubt: float = 0.0
    ) -> Observation:
        """A move has measured the level at a site.

        Args:
            site: its number.
            value: logarithm of the level measured.
            sigma: its standard deviation, the wander not included.
            time: of it [s].
            doubt: what it may be off by besides where something has stepped; the surprise is
                judged without it.
        """
        self.advance(time)
        self.moves[site] += 1
        noise = sigma**2 + self.settings.model_error**2
        expected, spread = self.expected(site)
        off = value - expected
        surprise, weight = off / math.sqrt(spread**2 + noise), 1.0
        if sigma >= self.settings.vague:
            surprise, weight = self._heavy_tailed(off, spread**2 + noise)
            wide = noise + self.settings.outlier**2
            noise = 1.0 / (weight / noise + (1.0 - weight) / wide)
        sign = self._detectors[site].update(surprise)
        step: Literal["site", "common"] | None = None
        if sign:
            step = "site"
            last = self._last_step
            if last is not None and last[0] != site and last[1] == sign:
                if 0.5 < off / last[2] < 2.0:
                    step = "common"
            if step == "common" and last is not None:
                # What the other site has taken for its own was everybody's.
                self.state[SITES + last[0]] -= last[3]
                self._open(SITES + last[0], 0.3 * last[2])
                self._open(COMMON, off)
                self._last_step = None
            else:
                self._open(SITES + site, off)
                self._last_step = (site, sign, off, float(self.state[SITES + site]))
        elif self._last_step is not None and self._last_step[0] != site:
            self._last_step = None  # elsewhere nothing has stepped: it was that site's own
        self._correct(self._row(site, True), off, noise + doubt**2)
        if step == "site" and self._last_step is not None:
            taken = float(self.state[SITES + site]) - self._last_step[3]
            self._last_step = (site, sign, off, taken)
        return Observation(surprise, math.expm1(off), step)

    def _heavy_tailed(self, off: float, variance: float) -> tuple[float, float]:
        """Equivalent normal z under the mixture with outliers; probability of no outlier.

        Args:
            off: measured minus expected.
            variance: of that, where it is not astray.

        Returns:
            z, and the probability that the measurement is sound.
        """
        share, wide = self.settings.astray, variance + self.settings.outlier**2
        sound, astray = (1.0 - share) / math.sqrt(variance), share / math.sqrt(wide)
        most = sound + astray
        sound *= math.exp(-0.5 * off**2 / variance)
        astray *= math.exp(-0.5 * min(off**2 / wide, 1e3))
        z = math.sqrt(2.0 * math.log(most / (sound + astray)))
        return math.copysign(z, off), sound / (sound + astray)

    def _open(self, place: int, size: float) -> None:
        """Increase the variance of one entry of the state by that of a step."""
        self.covariance[place, place] += size**2

    def _row(self, site: int, wander: bool) -> F64:
        row = np.zeros(len(self.state))
        row[WANDER] = 1.0 if wander else 0.0
        row[COMMON] = 1.0
        row[SITES + site] = 1.0
        return row

    def _correct(self, row: F64, off: float, noise: float) -> None:
        """Joseph-free update with a scalar; symmetric by construction."""
        cross = self.covariance @ row
        variance = float(row @ cross) + noise
        self.state += cross * (off / variance)
        self.covariance -= np.outer(cross, cross) / variance
