"""The figures of an axis and its drive that its measured responses show, with their uncertainty.

Least squares over all lines at rest and while sliding, each weighed by its scatter and by how well
the closed form of `sampled_loop` holds at all. It starts from figures near enough, however far off
the believed ones are; resonances are added while they earn their place.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from estimation.response.frequency_response import AxisResponse
from estimation.response.sampled_loop import C128, Clocking, Figures, Lines, Resonance
from stagedata import F64

FORM = 0.02
"""Relative error of the closed form: no line counts for more than that allows."""
OUTLYING = 3.0
"""Residuals beyond so many sigma count linearly."""
LATEST = 8
"""Lateness and age are looked for up to so many SYNC periods."""
HIGHEST_RESONANCE = 0.4
"""Over the SYNC rate: beyond, folding hides where a mode lies."""
MODES = 2
"""Resonances at most."""
EARNS = 0.5
"""A resonance stays if it leaves at most this share of the squared residuals,"""
SIGMAS = 5.0
"""and is so many sigma from none; it is looked for where a line is so many sigma off."""
GOOD = 3.0
"""With a misfit below this, no other start is tried."""
_THINNED = 8
"""One line in so many is enough for a start."""
_TRIED = 100
"""Frequencies at which a resonance is tried first."""
_SCALED = ("mass", "kp", "ki", "kd", "derivative_time")
_ADDED = ("dead_time", "lateness", "age", "smoothing", "viscous", "stiffness", "loss")
_BOUNDED = [_ADDED.index("dead_time"), _ADDED.index("smoothing")]
_MODE = ("resonance", "damping", "share")


@dataclass(frozen=True, slots=True)
class Fitted:
    """What the responses show.

    Attributes:
        figures: of the axis.
        sigma: 1 sigma by name of a figure, in its unit; relative for mass, gains and derivative
            time, which are left out where they are believed to be 0. Of resonance k:
            `resonance_k` [Hz], `damping_k` (relative), `share_k`. Age and smoothing
            can hardly be told apart; `position_delay` is of their sum [s].
        misfit: rms of the weighed residuals; about 1 or less where the closed form holds.
    """

    figures: Figures
    sigma: dict[str, float]
    misfit: float


def fit(response: AxisResponse, clocking: Clocking, believed: Figures) -> Fitted:
    """The figures that explain a response.

    Args:
        response: measured.
        clocking: of the drive.
        believed: of the same order as the figures.
    """
    problem = _Problem(response, clocking, believed)
    without_modes = [(problem.solve(start), start) for start in problem.starts()]
    found: list[_Solution] = []
    for solution, start in sorted(without_modes, key=lambda pair: pair[0].cost):
        found.append(problem.with_modes(solution, start))
        if found[-1].misfit < GOOD:
            break
    return min(found, key=lambda solution: solution.cost).result()


class _Curve(NamedTuple):
    """A measured response, and what computes it."""

    lines: Lines
    at: F64
    value: C128
    weight: F64


class _State(NamedTuple):
    """Both curves of an axis at rest or while sliding."""

    slides: bool
    offset: _Curve
    demand: _Curve

    def computed(self, figures: Figures) -> tuple[C128, C128]:
        return (
            self.offset.lines.responses(figures, self.slides)[0],
            self.demand.lines.responses(figures, self.slides)[1],
        )


@dataclass(frozen=True, slots=True)
class _Solution:
    figures: Figures
    scaled: tuple[str, ...]
    deviation: F64
    delay_deviation: float
    cost: float
    residuals: F64

    @property
    def misfit(self) -> float:
        """Rms of the residuals."""
        return math.sqrt(2.0 * self.cost / len(self.residuals))

    @property
    def is_mode_sure(self) -> bool:
        """Whether the last resonance is one."""
        mode = self.figures.resonances[-1]
        return mode.damping < 0.3 and abs(mode.share) > SIGMAS * self.deviation[-1]

    def result(self) -> Fitted:
        modes = self.figures.resonances
        names = (*self.scaled, *_ADDED, *(f"{n}_{k}" for k in range(len(modes)) for n in _MODE))
        sigma = dict(zip(names, self.deviation.tolist(), strict=True))
        for k, mode in enumerate(modes):
            sigma[f"resonance_{k}"] *= mode.frequency
        sigma["position_delay"] = self.delay_deviation
        return Fitted(self.figures, sigma, self.misfit)


class _Problem:
    def __init__(self, response: AxisResponse, clocking: Clocking, believed: Figures) -> None:
        self._period, self._believed = clocking.period, believed
        self._scaled = tuple(name for name in _SCALED if getattr(believed, name) > 0.0)
        self._states = _states(response, clocking, 1)
        self._coarse = _states(response, clocking, _THINNED)
        hard = believed.kp + believed.stiffness
        self._units = np.array([1e-4, 1e-4, 1e-4, 1e-4, believed.kd, hard, hard * clocking.period])
        """Of what is added: a step of any changes the responses about as much."""
        self._least = np.zeros(len(_ADDED))
        """Of what is bounded; within a control tick, it is not known when a drive does what."""
        self._least[_ADDED.index("dead_time")] = -clocking.control_period / 2.0 / self._units[0]

    def starts(self) -> Iterator[Figures]:
        """Figures near enough for least squares: a delay on the way out, in the loop, or none.

        The responses to offset and to demand differ by the drive's law and by how late an offset
        acts: their ratio gives the level of the gains, whatever the mechanics are. Mass and age
        follow from the response to the demand, lateness and sign from the other.
        """
        step = self._period / 4.0
        steps = range(4 * LATEST + 1)
        figures = self._believed
        for _ in range(2):  # the level moves what is folded, a little
            level = self._law_level(figures)
            figures = figures._replace(
                kp=figures.kp * level, ki=figures.ki * level, kd=figures.kd * level
            )
        heavier = [figures._replace(mass=figures.mass * 2.0 ** (k / 4)) for k in range(-8, 9)]
        aged = [f._replace(age=k * step) for f in heavier for k in steps]
        figures = min(aged, key=lambda f: self._distance(f, 1))
        little = 0.1 * self._period  # where their slopes are not 0
        figures = figures._replace(dead_time=figures.dead_time + little, smoothing=little)
        late = [figures._replace(lateness=k * step, sign=s) for s in (1.0, -1.0) for k in steps]
        figures = min(late, key=lambda f: self._distance(f, 0))
        yield figures
        if figures.age > 0.0:
            yield figures._replace(dead_time=figures.dead_time + figures.age, age=0.0)
            yield figures._replace(age=0.0)

    def _law_level(self, figures: Figures) -> float:
        """Measured over computed ratio of the responses to demand and offset."""
        rest = self._coarse[0]
        offset, demand = rest.computed(figures)
        size = min(len(offset), len(demand))
        measured = np.abs(rest.demand.value[:size] / rest.offset.value[:size])
        return float(np.median(measured / np.abs(demand[:size] / offset[:size])))

    def _distance(self, figures: Figures, which: int) -> float:
        """Of computed from measured responses to offsets (0) or the demand (1)."""
        total = 0.0
        for state in self._coarse:
            curve = (state.offset, state.demand)[which]
            total += _distance(curve.lines.responses(figures, state.slides)[which], curve.value)
        return total

    def residuals(self, figures: Figures) -> F64:
        """Weighed, of all lines, real parts before imaginary ones."""
        parts = []
        for state in self._states:
            offset, demand = state.computed(figures)
            parts.append((offset - state.offset.value) * state.offset.weight)
            parts.append((demand - state.demand.value) * state.demand.weight)
        whole = np.concatenate(parts)
        return np.concatenate((whole.real, whole.imag))

    def solve(self, start: Figures, evaluations: int = 40) -> _Solution:
        """The least squares from a start, with as many resonances as that has."""
        found = least_squares(
            lambda vector: self.residuals(self._figures(vector, start)),
            self._vector(start),
            loss="soft_l1",
            f_scale=OUTLYING,
            x_scale="jac",
            max_nfev=evaluations,
        )
        residuals = np.asarray(found.fun, np.float64)
        cost = float(residuals @ residuals) / 2.0
        spread = max(1.0, 2.0 * cost / max(1, len(residuals) - len(found.x)))
        inverse = np.linalg.pinv(found.jac.T @ found.jac)
        deviation = np.sqrt(np.maximum(np.diag(inverse), 0.0) * spread)
        deviation[len(self._scaled) : len(self._scaled) + len(_ADDED)] *= self._units
        both = len(self._scaled) + np.array([_ADDED.index("age"), _ADDED.index("smoothing")])
        way = np.array([1.0, math.copysign(1.0, found.x[both[1]])])  # smoothing is |x|
        variance = float(way @ inverse[np.ix_(both, both)] @ way)
        delay = math.sqrt(max(variance, 0.0) * spread)
        delay *= float(self._units[_ADDED.index("age")])
        return _Solution(
            self._figures(found.x, start), self._scaled, deviation, delay, cost, residuals
        )

    def with_modes(self, best: _Solution, start: Figures) -> _Solution:
        """A solution from a start, with the resonances that earn their place."""
        while len(best.figures.resonances) < MODES and np.abs(best.residuals).max() > SIGMAS:
            richer = self.with_another_mode(start, best)
            if richer.cost > EARNS * best.cost or not richer.is_mode_sure:
                break
            best = richer
        return best

    def with_another_mode(self, start: Figures, found: _Solution) -> _Solution:
        """The best solution with one more resonance.

        A strong mode changes the responses far beyond its own lines, and figures that made up for
        it are a bad place to start from; a weak one is where a response is off most.
        """
        known = found.figures.resonances
        anew = min(self._modes(), key=lambda mode: self._fine_distance(_with(start, known, mode)))
        worst = self._worst_line(found.figures)
        modes = (anew, *(Resonance(worst, 0.01, share) for share in (0.1, -0.9)))
        first = (
            self.solve(_with(figures, known, mode), 10)
            for figures in (start, found.figures)
            for mode in modes
        )
        return self.solve(min(first, key=lambda s: s.cost).figures)

    def _modes(self) -> Iterator[Resonance]:
        highest = HIGHEST_RESONANCE / self._period
        lowest = float(self._states[0].offset.at[0])
        for frequency in np.geomspace(2.0 * lowest, highest, _TRIED).tolist():
            for share in (0.2, -0.9):
                yield Resonance(frequency, 0.01, share)

    def _worst_line(self, figures: Figures) -> float:
        """Where a response differs most from the closed form [Hz]."""
        worst = []
        for state in self._states:
            for curve, computed in zip(state[1:], state.computed(figures), strict=True):
                off = np.abs((computed - curve.value) * curve.weight)
                off[curve.at > HIGHEST_RESONANCE / self._period] = 0.0
                worst.append((float(off.max()), float(curve.at[np.argmax(off)])))
        return max(worst)[1]

    def _fine_distance(self, figures: Figures) -> float:
        """As `_distance`, on all lines while sliding."""
        sliding = self._states[-1]
        offset, demand = sliding.computed(figures)
        return _distance(offset, sliding.offset.value) + _distance(demand, sliding.demand.value)

    def _vector(self, figures: Figures) -> F64:
        scaled = [
            math.log(getattr(figures, name) / getattr(self._believed, name))
            for name in self._scaled
        ]
        added = np.array([getattr(figures, name) for name in _ADDED]) / self._units
        modes = [
            value
            for mode in figures.resonances
            for value in (math.log(mode.frequency), math.log(mode.damping), mode.share)
        ]
        return np.array([*scaled, *added, *modes])

    def _figures(self, vector: F64, like: Figures) -> Figures:
        first = len(self._scaled)
        scaled, added, modes = np.split(vector, (first, first + len(_ADDED)))
        values = {
            name: getattr(self._believed, name) * math.exp(min(max(value, -5.0), 5.0))
            for name, value in zip(self._scaled, scaled.tolist(), strict=True)
        }
        least = self._least[_BOUNDED]
        added[_BOUNDED] = least + np.abs(added[_BOUNDED] - least)
        values |= zip(_ADDED, (added * self._units).tolist(), strict=True)
        resonances = tuple(
            Resonance(math.exp(min(f, 20.0)), math.exp(min(max(d, -7.0), 0.0)), share)
            for f, d, share in modes.reshape(-1, len(_MODE)).tolist()
        )
        return like._replace(**values, resonances=resonances)


def _with(figures: Figures, known: tuple[Resonance, ...], mode: Resonance) -> Figures:
    return figures._replace(resonances=(*known, mode))


def _distance(computed: C128, measured: C128) -> float:
    """Of two curves, by the logarithm of their ratio: no line counts for much."""
    ratio = np.log(computed / measured)
    return float(np.abs(ratio.real).sum() + np.abs(ratio.imag).sum())


def _states(response: AxisResponse, clocking: Clocking, step: int) -> list[_State]:
    """The measured curves, every `step`-th line of them."""

    def curve(at: F64, value: C128, sigma: F64) -> _Curve:
        weight = 1.0 / np.hypot(sigma, FORM * np.abs(value))
        return _Curve(Lines(at[::step], clocking), at[::step], value[::step], weight[::step])

    return [
        _State(
            slides,
            curve(r.offset_at, r.offset, r.offset_sigma),
            curve(r.demand_at, r.demand, r.demand_sigma),
        )
        for slides, r in ((False, response.rest), (True, response.sliding))
        if slides or not response.sticks
    ]
