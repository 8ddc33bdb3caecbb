"""Design of an axis' observer from its known figures: model, gain, limits.

Source: docs/reference/observer.md.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial

from estimation.observer.loop import Carriage, DriveLoop, period_maps
from estimation.observer.measured import GAIN_MARGIN, Margins, MeasuredLoop
from estimation.observer.model import ObserverModel, make_model
from estimation.observer.sensitivity import (
    GAINS,
    LATENCIES,
    PEAK,
    PEAK_OVER_DRIVE,
    drive_alone,
    peak_sensitivity,
    with_observer,
)

ASSUMED = (0.75, 1.0, 0.5, 1.25, 0.25, 0.1)
"""Shares of sigma0 that the model may assume. The more, the more force a deviation calls for, and
the smaller the gain has to be for an axis that slips: `design_observer` weighs the two."""
WALK = 1.6
"""The disturbance changes by so many times the Coulomb force in a root second: 5 % in 1 ms."""
FIGURES_OFF = 0.5
"""Friction figures may be off by so much."""
STIFFNESS = (0.0, 0.5, 1.0, 1.0 + FIGURES_OFF)
"""Shares of sigma0 at which the loop is checked: slipping, partly slipping, sticking."""


@dataclass(frozen=True, slots=True)
class AxisFigures:
    """What the host knows of an axis.

    Attributes:
        drive: its loop.
        carriage: with the presliding stiffness of all elements.
        coulomb: Fc [N].
        noise: of a sampled position [m rms].
        period: Ts [s].
        limit: of the correction, either way [N].
        mass_doubt: relative, either way.
        measured: response of the axis; None where the figures are believed.
        age: of sampled positions, as measured [s].
        lead: by which forces act later than the host believes, as measured [s].
    """

    drive: DriveLoop
    carriage: Carriage
    coulomb: float
    noise: float
    period: float
    limit: float
    mass_doubt: float = 0.0
    measured: MeasuredLoop | None = None
    age: float = 0.0
    lead: float = 0.0


@dataclass(frozen=True)
class Design:
    """An observer, with the peaks of the sensitivity.

    Attributes:
        figures: that it was designed for.
        model: of the axis.
        gain: g of the correction, per SYNC; 0 where none keeps the peaks.
        assumed_stiffness: of friction, in the model [N/m].
    """

    figures: AxisFigures
    model: ObserverModel
    gain: float
    assumed_stiffness: float

    @property
    def time_constant(self) -> float:
        """Time constant of the correction [s]; infinite without gain."""
        return self.figures.period / self.gain if self.gain else float("inf")

    @property
    def walk(self) -> float:
        """Of the disturbance, per period [N]."""
        return _walk(self.figures)

    @property
    def response(self) -> float:
        """Force by which a period's correction answers a deviation at rest [N/m]."""
        return self.gain * (self.figures.drive.kp + self.assumed_stiffness)

    @cached_property
    def drive_peak(self) -> float:
        """Peak sensitivity of the drive alone, figures as they are."""
        own = self.figures
        return peak_sensitivity(
            drive_alone(period_maps(own.drive, own.carriage, own.period)), own.period
        )

    @cached_property
    def peaks(self) -> tuple[float, ...]:
        """Peak sensitivity with the observer, figures as they are, for each of `LATENCIES`."""
        own = self.figures
        maps = period_maps(own.drive, own.carriage, own.period)
        return tuple(
            peak_sensitivity(with_observer(maps, self.model, self.gain, latency), own.period)
            for latency in LATENCIES
        )

    @cached_property
    def margins(self) -> Margins | None:
        """The least by the measured response, over `LATENCIES`; None where there is none."""
        measured = self.figures.measured
        if measured is None:
            return None
        found = [
            margins
            for latency in LATENCIES
            for margins in measured.margins(self.model, self.gain, latency)
        ]
        return Margins(min(m.gain for m in found), max(m.peak for m in found))

    @cached_property
    def worst_peak(self) -> float:
        """Highest peak sensitivity over figures that are off, and latencies."""
        period = self.figures.period
        return max(
            peak_sensitivity(with_observer(maps, self.model, self.gain, latency), period)
            for maps in (
                period_maps(self.figures.drive, carriage, period)
                for carriage in carriages(self.figures)
            )
            for latency in LATENCIES
        )


def _walk(figures: AxisFigures) -> float:
    return WALK * figures.coulomb * math.sqrt(figures.period)


def carriages(figures: AxisFigures) -> Iterator[Carriage]:
    """The axis with figures that are off: stiffness, mass, viscous friction."""
    carriage, doubt = figures.carriage, figures.mass_doubt
    for mass in (1.0, 1.0 - doubt, 1.0 + doubt) if doubt else (1.0,):
        for stiffness in STIFFNESS if carriage.stiffness else (0.0,):
            yield replace(
                carriage,
                mass=carriage.mass * mass,
                stiffness=carriage.stiffness * stiffness,
                viscous=carriage.viscous * (1.0 - FIGURES_OFF),
            )


@cache
def design_observer(figures: AxisFigures) -> Design:
    """The observer that answers deviations most of those that keep the sensitivity's peak.

    Gain and assumed stiffness are chosen together. The peak is at most `PEAK`, or `PEAK_OVER_DRIVE`
    times that of the drive alone, with figures that are off and for all `LATENCIES`. Where the
    drive alone would be unstable, nothing is asked. Where the response was measured, it decides
    instead of the figures, and a gain margin of `GAIN_MARGIN` is kept as well.
    """
    measured = figures.measured
    keeps_peaks = (
        _peaks_by_figures(figures)
        if measured is None
        else lambda model, gain: _keeps_margins(measured, model, gain)
    )
    best: Design | None = None
    for share in ASSUMED if figures.carriage.stiffness else (0.0,):
        assumed = replace(figures.carriage, stiffness=share * figures.carriage.stiffness)
        model = make_model(figures.drive, assumed, figures.period, _walk(figures), figures.noise)
        needed = 0.0 if best is None else best.response / (figures.drive.kp + assumed.stiffness)
        least = bisect_right(GAINS, needed)
        kept = _count_kept(partial(keeps_peaks, model), least)
        if best is None or kept > least:
            best = Design(figures, model, GAINS[kept - 1] if kept else 0.0, assumed.stiffness)
    if best is None:
        raise ValueError("no stiffness to assume")
    return best


def _peaks_by_figures(figures: AxisFigures) -> Callable[[ObserverModel, float], bool]:
    """Whether an observer of a gain keeps the peaks, by figures and how far off they may be."""
    demands = []
    for carriage in carriages(figures):
        maps = period_maps(figures.drive, carriage, figures.period)
        own = peak_sensitivity(drive_alone(maps), figures.period)
        demands.append((maps, max(PEAK, PEAK_OVER_DRIVE * own)))

    def keeps(model: ObserverModel, gain: float) -> bool:
        return all(
            peak_sensitivity(with_observer(maps, model, gain, latency), figures.period) <= most
            for maps, most in demands
            if most < float("inf")
            for latency in LATENCIES
        )

    return keeps


def _keeps_margins(measured: MeasuredLoop, model: ObserverModel, gain: float) -> bool:
    bounds = [max(PEAK, PEAK_OVER_DRIVE * peak) for peak in measured.drive_peaks]
    return all(
        margins.gain >= GAIN_MARGIN and margins.peak <= most
        for latency in LATENCIES
        for margins, most in zip(measured.margins(model, gain, latency), bounds, strict=True)
    )


def _count_kept(keeps: Callable[[float], bool], least: int) -> int:
    """How many of `GAINS` are kept, the smallest first; `least` where the next one is not."""
    if least < len(GAINS) and not keeps(GAINS[least]):
        return least
    low, high = least, len(GAINS)
    while low < high:
        middle = (low + high) // 2
        low, high = (middle + 1, high) if keeps(GAINS[middle]) else (low, middle)
    return low
