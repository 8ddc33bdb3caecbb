"""What a run shows of a stage that is not well, without any model: oscillations, slower settling.

An oscillation: about the line through a stretch at rest or at a constant speed, the following error
swings by more than the settle window, or the force by several of its units, in half-waves of about
the same length. Slower settling: the last moves of a kind against the first ones, by ranks
(Mann-Whitney). Each is told once per run.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from stagedata import F64, Samples

SHORTEST = 0.1
"""Stretches that say anything [s]."""
HALF_WAVES = 6
EVEN = 0.3
"""Spread of the lengths of the half-waves over their mean: of noise it is 0.5 and more."""
UNITS = 4.0
"""Amplitude of the force, in its units."""
MOVES = 15
"""Moves at the beginning and at the end that are compared."""
SURE = 4.2
"""Standard deviations of the rank sum, of 4.7 if all of the last are slower than the first."""
SLOWER = 2.0
"""Times the median at the beginning."""


def oscillation(values: F64, amplitude: float, period: float) -> tuple[float, float] | None:
    """Amplitude and frequency [Hz] of values that oscillate about a line; None where they do not.

    Args:
        values: one per SYNC, shape (K,).
        amplitude: the least that counts, as the values.
        period: Ts [s].
    """
    time = np.arange(len(values)) - 0.5 * (len(values) - 1)
    rest = values - values.mean()
    rest = rest - time * (time @ rest) / (time @ time)
    height = float(np.sqrt(2.0) * rest.std())
    turns = np.nonzero(np.diff(rest > 0.0))[0]
    waves = np.diff(turns)
    if height <= amplitude or len(waves) < HALF_WAVES or waves.std() > EVEN * waves.mean():
        return None
    return height, 0.5 / (float(waves.mean()) * period)


class Unrest:
    """Watches the samples and settling times of a run.

    Args:
        names: of the axes.
        increments: of their positions [m].
        period: Ts [s].
    """

    def __init__(self, names: Sequence[str], increments: Sequence[float], period: float) -> None:
        self._names, self._increments, self._period = names, increments, period
        self._told: set[tuple[str, str]] = set()
        self._durations: dict[str, list[float]] = {}

    def in_samples(self, samples: Samples, window: float) -> list[str]:
        """What the samples of a move and the rest after it show.

        Args:
            samples: since the move began.
            window: of settling [m].
        """
        found = []
        for a, name in enumerate(self._names):
            demand, valid = samples.position_demand[:, a], samples.valid[:, a]
            bend = np.abs(np.diff(demand, n=2, prepend=demand[:1], append=demand[-1:]))
            steady = (bend[: len(demand)] <= 2.5 * self._increments[a]) & valid
            for begin, end in _stretches(steady, round(SHORTEST / self._period)):
                error = (samples.position[:, a] - demand)[begin:end]
                force = samples.force[begin:end, a]
                found += self._tell(name, "following error", error, window)
                found += self._tell(name, "force", force, UNITS * _unit(force))
        return found

    def _tell(self, name: str, what: str, values: F64, least: float) -> list[str]:
        swings = oscillation(values, least, self._period)
        if swings is None or (name, what) in self._told:
            return []
        self._told.add((name, what))
        height, frequency = swings
        size = f"{height * 1e9:.0f} nm" if what == "following error" else f"{height:.2g} N"
        return [
            f"axis {name}: the {what} oscillates at {frequency:.0f} Hz, by {size}: look for a "
            "vibration, or for gains of the drive that are too high; --no-observer shows whether "
            "it is the host's"
        ]

    def after_settling(self, kind: str, duration: float) -> list[str]:
        """What the settling times of moves of a kind show; `duration` of one more [s]."""
        times = self._durations.setdefault(kind, [])
        times.append(duration)
        if len(times) < 2 * MOVES or ("settling", kind) in self._told:
            return []
        first, last = np.array(times[:MOVES]), np.array(times[-MOVES:])
        above = (last[:, None] > first).sum() + 0.5 * (last[:, None] == first).sum()
        spread = np.sqrt(MOVES * MOVES * (2 * MOVES + 1) / 12.0)
        sure = above - 0.5 * MOVES * MOVES > SURE * spread
        before, now = float(np.median(first)), float(np.median(last))
        if not sure or now < SLOWER * before:
            return []
        self._told.add(("settling", kind))
        return [
            f"{kind}-moves settle in {now * 1e3:.0f} ms now, in {before * 1e3:.0f} ms at the "
            "beginning of the run: something has changed (temperature, a cable, the drive's "
            "gains); `stagectl gap diagnose` of this run looks for it"
        ]


def _unit(force: F64) -> float:
    steps = np.diff(np.unique(force))
    return float(steps.min()) if len(steps) else np.inf


def _stretches(flags: NDArray[np.bool_], shortest: int) -> list[tuple[int, int]]:
    edges = np.diff(np.concatenate(([0], flags.astype(np.int8), [0])))
    begins, ends = np.nonzero(edges > 0)[0].tolist(), np.nonzero(edges < 0)[0].tolist()
    return [(b, e) for b, e in zip(begins, ends, strict=True) if e - b >= shortest]
