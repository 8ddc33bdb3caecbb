"""Whether library effects keep their names, or a coordinate is the answer.

Effects keep their names where no curve over one coordinate predicts other moves better: where their
prediction is within one standard error over blocks of moves of the best curve's, or loses less than
a fiftieth of the gap. Several effects that show along the motion have to predict clearly better
than one curve. What curves do beside effects: `beside`.

Source: docs/decisions/0019-rivals.md.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sim2real.findings import ForceCurve, Unlisted
from sim2real.fitting import STEP, AxisModel, coordinates, is_coulomb_level
from sim2real.held_out import share_closed
from sim2real.rivals.coordinates import CLOSER, COORDINATES, NARROW, WAVES, Coordinate
from sim2real.rivals.grouped_fit import Prediction
from sim2real.rivals.screen import Curve, Linear, Screen
from sim2real.scoring.constants import ENOUGH, LITTLE, SURE_COORDINATE

_MUCH = 0.2
"""Share of the gap that a name may lose to a curve within one standard error, which is large where
few moves show the force; it may lose `LITTLE` in any case."""
CLEARLY = 3.0
"""Standard errors by which several effects predict clearly better than a curve."""
_AS_WELL = 0.5
"""Standard errors by which a prediction may be worse and still be as good."""
FAINT = 0.25
"""Energy over that of noise which matters nowhere."""
MOST, _SHOWN = 0.5, 0.2
"""Shares of the gap that a curve has to close on other moves: to take names away, and to be shown
where nothing has a name and the gap is far above the floor."""
_FAR = 4.0
"""Energy over that of noise that is far above it."""
_TURNS = 1.5
"""Periods of a wave within the motion from which it is known to come back."""
_POINTS, _REPEATS = 1000, 0.1
"""Points of a curve that are compared, and the largest difference, over that of points apart, of a
curve that repeats itself."""
_IN_TUNE = 0.01
"""Relative distance of a pitch from a half or a third of another one that counts as none."""
_FEWEST = 200
"""Samples in motion that curves need."""
_MOVES = 2
"""Moves of a block: there and back."""


@dataclass(frozen=True, slots=True, eq=False)
class Rivals:
    """The curves of an axis, best first.

    Attributes:
        screen: that fitted them.
        curves: the best one over each coordinate.
        alone: what effects predict that the curves were fitted beside; None without any.
    """

    screen: Screen
    curves: Sequence[Curve]
    alone: Prediction | None = None

    @property
    def opened(self) -> Prediction:
        """What the curves have to improve on."""
        return self.alone or self.screen.open

    @property
    def gained(self) -> float:
        """Energy that the best curve takes away."""
        return self.opened.energy - self.curves[0].prediction.energy if self.curves else 0.0

    @property
    def best(self) -> Curve | None:
        """The curve that predicts other moves best, where it closes most of the gap."""
        return self._closing(MOST)

    def _closing(self, least: float) -> Curve | None:
        """The curve that predicts other moves best, where it closes this share of the gap."""
        if not self.curves:
            return None
        above = max(self.opened.energy - self.screen.floor, 1e-9)
        return self.curves[0] if self.gained >= least * above else None

    @property
    def peak(self) -> tuple[float, float] | None:
        """Place and width [m] of the highest bump of the best curve; None unless it is narrow."""
        best = self.best
        if best is None or not best.coordinate.is_narrow:
            return None
        highest = int(np.abs(best.force).argmax())
        area = float(np.trapezoid(best.force, best.at))
        return float(best.at[highest]), abs(area / best.force[highest]) / math.sqrt(2.0 * math.pi)

    def leave_names(
        self,
        models: Sequence[AxisModel],
        *,
        leaves_structure: bool = False,
        is_complete: bool = False,
    ) -> bool:
        """Whether one of these library models, which could explain the axis, keeps its names.

        Args:
            models: each with one effect or more.
            leaves_structure: innovations show that something is missing whichever of them is right:
                then a name may lose nothing that is certain, however small beside the gap.
            is_complete: innovations show that nothing is missing: then a single effect that shows
                along the motion keeps its name, and several only have to predict as well as a
                curve, for they have fewer figures; better by one standard error where some are
                levels of friction, whose course innovations do not show. Where all are, and a curve
                of as few figures does as well, they have to be better by all that counts. With a
                wave that does not come back within the motion a set is any curve of its group.
        """
        best = self.best
        if best is None:
            return True
        for model in models:
            prediction = self.screen.model(model) if model.terms else None
            if prediction is None:
                continue
            if is_complete and not self._long_waves(model):
                keeps = self._complete_keeps(model, prediction, best)
            else:
                keeps = self._keeps(model, prediction, best, leaves_structure)
            if keeps:
                return True
        return False

    def _keeps(
        self, model: AxisModel, prediction: Prediction, best: Curve, leaves_structure: bool
    ) -> bool:
        """Whether a model keeps its names beside the best curve, by what it predicts."""
        excess, error = compare(prediction, best.prediction)
        margin = self.margin(error)
        if leaves_structure:
            margin = min(margin, max(CLEARLY * error, FAINT * self.screen.floor))
        if excess < -min(margin, CLEARLY * error):
            return True
        # Noise that a curve happens to follow is no reason to take a single name away.
        excess += min(best.prediction.energy - self.screen.floor, 0.0)
        return excess <= margin and count_shown(self.screen, model, prediction, margin) < 2

    def _complete_keeps(self, model: AxisModel, prediction: Prediction, best: Curve) -> bool:
        """The same of a model that lacks nothing by the innovations."""
        excess, error = compare(prediction, best.prediction)
        margin = self.margin(error)
        levels = [is_coulomb_level(term, self.screen.loop.axis) for term in model.terms]
        if all(levels) and self._is_one_function(prediction, best.coordinate):
            return excess < -margin
        better = 1.0 if any(levels) else -_AS_WELL
        if excess < -min(margin, better * error):
            return True
        return count_shown(self.screen, model, prediction, margin) < 2

    def _long_waves(self, model: AxisModel) -> list[str]:
        """Waves that do not come back within the motion, beside another effect of their group.

        Together these are any curve.
        """
        low, high = self.screen.extent("position")
        groups = [term.effect.group for term in model.terms]
        group_of = dict(zip(model.names(), groups, strict=True))
        return [
            name
            for name, pitch in pitches(model).items()
            if _TURNS * pitch > high - low and groups.count(group_of[name]) > 1
        ]

    def _is_one_function(self, levels: Prediction, over: Coordinate) -> bool:
        """Whether a curve with as few figures as two levels of friction predicts as well."""
        if over.along != "position":
            return True
        few = self.screen.curve(replace(over, step=math.inf))
        if few is None:
            return False
        excess, error = compare(few.prediction, levels)
        return excess <= max(error, FAINT * self.screen.floor)

    def shapes(self, model: AxisModel) -> list[str]:
        """Effects that are no more than the shape of another one: harmonics, and long waves."""
        return [*harmonics(model), *self._long_waves(model)]

    def unlisted(self, axis: str) -> tuple[Unlisted, ...]:
        """The coordinate that the force depends on, and those that could take its place."""
        if not self.curves:
            return ()
        is_far = self.opened.energy > _FAR * self.screen.floor
        best = self._closing(_SHOWN if is_far else MOST)
        if best is None:
            return ()
        odds, alike = [], []
        for curve in self.curves:
            excess, error = compare(curve.prediction, best.prediction)
            odds.append(math.exp(-0.5 * (excess / max(self.margin(error), 1e-9)) ** 2))
            if curve is not best and excess <= self.margin(error):
                alike.append(curve.coordinate.over)
        samples = np.bincount(self.screen.blocks, minlength=len(best.prediction.energies))
        opened, left = (
            energies[:, None] / 2.0 for energies in (self.opened.energies, best.prediction.energies)
        )
        moved = samples > 0
        share, interval = share_closed(
            opened[moved], left[moved], samples[moved, None].astype(np.float64)
        )
        if share is None or interval is None or interval[0] <= 0.0:
            return ()
        probability = min(SURE_COORDINATE, max(share, 0.0)) / sum(odds)
        force = ForceCurve(*(tuple(part.tolist()) for part in (best.at, best.force, best.sigma)))
        over, times = best.coordinate.over, best.coordinate.times
        if over == "position_direction":
            times = ""
        found = Unlisted(
            axis, over, tuple(alike), probability, share, interval, force, times,
            period=find_period(best) if best.coordinate.may_repeat else 0.0,
        )  # fmt: skip
        return (found,)

    def margin(self, error: float) -> float:
        """Energy by which a prediction may be worse and count as alike; error: its standard one."""
        gap = max(self.opened.energy - self.screen.floor, 0.0)
        return min(max(error, LITTLE * gap), _MUCH * gap)


def find_period(curve: Curve) -> float:
    """Distance after which a curve repeats itself, in its coordinate's unit; 0 where it does not.

    At that distance, of which the curve has two or more, it differs from itself by less than a
    tenth of what points apart do, and at some shorter distance by more than these. Of several such
    distances it is the shortest: the others are multiples of it.
    """
    at = np.linspace(curve.at[0], curve.at[-1], _POINTS)
    force = np.interp(at, curve.at, curve.force)
    lags = range(1, _POINTS // 2)
    unlike = np.array([np.mean((force[lag:] - force[:-lag]) ** 2) for lag in lags])
    unlike /= max(2.0 * float(np.var(force)), 1e-12)
    apart = np.maximum.accumulate(unlike) > 1.0
    again = np.flatnonzero(apart & (unlike < _REPEATS))
    if not len(again):
        return 0.0
    first = again[: np.argmax(np.diff(again, append=_POINTS) > 1) + 1]
    return float(at[first[unlike[first].argmin()] + 1] - at[0])


def harmonics(model: AxisModel) -> list[str]:
    """Names of the waves over position whose pitch is a half or a third of another one's."""
    found = pitches(model)
    return [
        name
        for name, pitch in found.items()
        if any(
            abs(order * pitch / other - 1.0) < _IN_TUNE
            for other in found.values()
            for order in (2, 3)
        )
    ]


def pitches(model: AxisModel) -> dict[str, float]:
    """Effect -> its pitch [m], of those that are waves over position."""
    return {
        term.name: value
        for term in model.terms
        if any(p.role == "phase" for p in term.effect.parameters)
        for p, value in zip(term.effect.parameters, term.values, strict=True)
        if p.role == "shape" and p.unit == "m"
    }


def count_shown(screen: Screen, model: AxisModel, whole: Prediction, margin: float) -> int:
    """Number of effects of a model without which it predicts worse by more than a margin.

    Args:
        screen: the axis.
        model: with the effects.
        whole: what it predicts.
        margin: energy.
    """
    return sum(loss > margin for loss in losses(screen, model, whole))


def losses(screen: Screen, model: AxisModel, whole: Prediction) -> list[float]:
    """Energy that a model leaves more without each of its effects.

    Those within the control loop do not show along a motion, nor does a mass beside what goes with
    acceleration. The plant's figures stay, for some would take the place of an effect of theirs.
    """
    effects = sum(len(coordinates(term.effect, screen.loop.axis)) for term in model.terms)
    figures = whole.values[effects : effects + STEP]
    found = []
    for index in range(len(model.terms)):
        fewer = screen.linear(model.without(index))
        left = None if fewer is None else screen.predict(fewer.with_figures(figures))
        found.append(math.inf if left is None else left.energy - whole.energy)
    return found


def find_rivals(screen: Screen) -> Rivals:
    """Fit curves over all coordinates; with closer nodes over that of the best, too.

    An axis that hardly moves has none.
    """
    if screen.samples < _FEWEST:
        return Rivals(screen, ())
    curves = fit_curves(screen, COORDINATES)
    if screen.closed(curves[0].prediction) < ENOUGH:
        curves = _ranked([*curves, *fit_curves(screen, WAVES)])
    best, closed = curves[0].coordinate, screen.closed(curves[0].prediction)
    closer = NARROW if best.along == "position" or closed < MOST else ()
    if closed > ENOUGH:  # what its nodes are too far apart for is all that is left
        closer += tuple(each for each in CLOSER if each.over == best.over)
    curves = _ranked([*curves, *fit_curves(screen, closer)])
    return Rivals(screen, curves)


def fit_curves(
    screen: Screen, over: Sequence[Coordinate], beside: Linear | None = None
) -> list[Curve]:
    """The best curve over each coordinate, best first."""
    fitted = [screen.curve(coordinate, beside) for coordinate in over]
    return _ranked([curve for curve in fitted if curve is not None])


def _ranked(curves: Sequence[Curve]) -> list[Curve]:
    """The best curve over each coordinate, best first."""
    ranked: dict[str, Curve] = {}
    for curve in sorted(curves, key=lambda c: c.prediction.energy):
        ranked.setdefault(curve.coordinate.over, curve)
    return list(ranked.values())


def compare(one: Prediction, other: Prediction) -> tuple[float, float]:
    """By how much the first leaves more energy, and the standard error of that over blocks."""
    change = one.energies - other.energies
    blocks = np.add.reduceat(change, np.arange(0, len(change), _MOVES))
    error = float(np.std(blocks, ddof=1)) * math.sqrt(len(blocks)) if len(blocks) > 1 else math.inf
    return float(change.sum()), error
