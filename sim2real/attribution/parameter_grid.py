"""The grid on which an effect's parameters are tried: plausible ranges, travel, spectral peaks."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence

import numpy as np

from hil_sim.effects.effect import Effect, Parameter
from hil_sim.effects.ports import EffectPorts
from hil_sim.settings import AxisSettings
from sim2real.tracking import Track, Tracker

_FINE, _COARSE = 48, 6
"""Values over a plausible range: where a signature is cheap, and where each takes a simulation."""
_PLACES, _FEW_PLACES = 24, 3
"""Places on the travel, likewise."""
_PEAKS = 4
"""Frequencies of a vibration that are tried: the highest peaks of the innovations' spectrum."""
_BEYOND = 0.8
"""Values begin at this share of the plausible range's end, and end as far beyond the other."""


class Grid:
    """Values to try on one axis.

    Args:
        axis: of the machine file.
        trackers: of its recordings.
        tracks: their results.
    """

    def __init__(
        self, axis: AxisSettings, trackers: Sequence[Tracker], tracks: Sequence[Track]
    ) -> None:
        self._axis = axis
        self._trackers = trackers
        self._tracks = tracks

    def nodes(self, effect: Effect, cheap: bool) -> Iterator[tuple[float, ...]]:
        """Values of all parameters; more of them where a signature is cheap."""
        grids: list[list[float]] = []
        formed = 0
        for parameter in effect.parameters:
            grids.append(self._grid(effect, parameter, cheap, formed))
            formed += parameter.role in ("place", "shape")
        yield from itertools.product(*grids)

    def _grid(self, effect: Effect, parameter: Parameter, cheap: bool, formed: int) -> list[float]:
        """Values of one parameter; `formed` parameters of place or shape came before it."""
        axis = self._axis
        if parameter.role == "phase":
            return [0.0]
        if parameter.role == "size":
            several = not cheap and len(effect.parameters) == 1
            return _sizes(parameter, axis, several)
        several = sum(p.role in ("place", "shape") for p in effect.parameters) > 1
        if parameter.role == "place":
            low = min(float(t.x.min()) for t in self._tracks)
            high = max(float(t.x.max()) for t in self._tracks)
            count = _PLACES if cheap and several else _FEW_PLACES
            edge = (high - low) / count / 2.0
            return list(np.linspace(low + edge, high - edge, count))
        low, high = parameter.ranges(axis)[0]
        if self._periodic_in_time(effect):
            return self._peaks(low, high)
        if formed:
            count = 3 if cheap else 1
        else:
            count = _FINE if cheap else _COARSE
        if count == 1:
            return [midrange(parameter, axis)]
        if parameter.log:
            return list(np.geomspace(_BEYOND * low, high / _BEYOND, count))
        return list(np.linspace(low, high, count))

    def _periodic_in_time(self, effect: Effect) -> bool:
        ports = EffectPorts(self._axis, 1e-3, 1.0)
        values = {p.key: midrange(p, self._axis) for p in effect.parameters}
        effect.apply(ports, values)
        return bool(ports.harmonics)

    def _peaks(self, low: float, high: float) -> list[float]:
        """Frequencies of the highest peaks of the innovations' spectrum [Hz]."""
        track, tracker = self._tracks[0], self._trackers[0]
        values = np.where(track.valid, np.clip(track.position, -20.0, 20.0), 0.0)
        count = 4 * len(values)
        power = np.abs(np.fft.rfft(values, count)) ** 2
        frequency = np.fft.rfftfreq(count, float(tracker.time[1]))
        inside = (frequency > 0.7 * low) & (frequency < 1.4 * high)
        power = np.where(inside, power, 0.0)
        found: list[float] = []
        width = 2.0 / float(tracker.time[-1])
        while len(found) < _PEAKS and power.max() > 0.0:
            peak = float(frequency[int(power.argmax())])
            found.append(peak)
            power[np.abs(frequency - peak) < width] = 0.0
        return found


def midrange(parameter: Parameter, axis: AxisSettings) -> float:
    """The middle of a parameter's plausible range."""
    low, high = parameter.ranges(axis)[-1]
    return math.sqrt(low * high) if parameter.log else 0.5 * (low + high)


def _sizes(parameter: Parameter, axis: AxisSettings, several: bool) -> list[float]:
    """Typical sizes: one in the middle of each plausible side of the neutral value, or several."""
    neutral = parameter.neutral_on(axis)
    found: list[float] = []
    for low, high in parameter.ranges(axis):
        sides = [(low, high)]
        if neutral is not None and low < neutral < high:
            sides = [(neutral, low), (neutral, high)]
        for first, last in sides:
            shares = (0.25, 0.5, 0.9) if several else (0.5,)
            for share in shares:
                if parameter.log:
                    found.append(first * (last / first) ** share)
                else:
                    found.append(first + share * (last - first))
    return found
