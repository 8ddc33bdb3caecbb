"""Where to start fitting an effect: its parameters tried over what is plausible, to first order.

Each node of a grid over place, pitch, frequency, time constant and the like gives a signature; its
size (and phase) follow by least squares beside the base parameters. Cheap signatures come from the
error equations (`sim2real.signature`), the others from one tracked run each.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hil_sim.effects.effect import Effect, Parameter
from hil_sim.effects.ports import EffectPorts
from hil_sim.settings import AxisSettings
from sim2real.axis_model import AxisModel, Term
from sim2real.axis_problem import AxisProblem
from sim2real.signature import inputs, response

F64 = NDArray[np.float64]

_FINE, _COARSE, _SIMULATED_NODES = 48, 6, 3
"""Nodes over a plausible range: where a signature is cheap, where each takes a run, and how many
of the cheap ones are simulated in the end."""
_PEAKS = 4
"""Frequencies of a vibration that are tried: the highest peaks of the innovations' spectrum."""
_SHIFT = 0.05
"""Distance to a second place, between which a place that only shifts an effect is found [m]."""
_BEYOND = 0.8
"""Nodes begin at this share of what is plausible, and end as far beyond it."""
_APART, _NEARLY = 1.2, 0.6
"""Shapes of one effect this far apart are different starts, as far as the second one's gain is this
share of the first one's: a wave and its harmonic."""
_STIFF = 5.0
"""Base parameters are held so many times tighter than tolerance says: a fit keeps them in bounds,
which first order does not know."""
_WIDEST = 3.0
"""Sizes are sought up to so many times the node's."""


@dataclass(frozen=True, slots=True, eq=False)
class Start:
    """Where to start fitting an effect.

    Attributes:
        term: with the best parameters found.
        gain: cost that it would save, to first order.
        signature: its weighted share in the residual, beside the base parameters,
            float64[R + B]: their prior's rows stand below.
        node: of the grid that it came from.
        followed: whether the gain is of the filter's wander, not of its innovations.
    """

    term: Term
    gain: float
    signature: F64
    node: tuple[float, ...]
    followed: bool = False


class Scanner:
    """Scans effects on an axis under a model that has been fitted.

    Args:
        problem: the axis.
        model: what is there already.
        residual: under it, weighted deviations float64[R].
        base_columns: derivatives by the base parameters, float64[R, B].
        weights: of the deviations, float64[R].
    """

    def __init__(
        self,
        problem: AxisProblem,
        model: AxisModel,
        residual: F64,
        base_columns: F64,
        weights: F64,
    ) -> None:
        self._problem = problem
        self._model = model
        self._residual = residual
        self._root = np.sqrt(weights)
        self._cost = problem.cost(model, residual)
        self._axis = model.settings(problem.axis)
        self._tracks = problem.track(model)
        period = float(problem.trackers[0].time[1])
        self._accelerations = [np.gradient(t.v, period) for t in self._tracks]
        nuisance = [base_columns * self._root[:, None]]
        for term in range(len(model.terms)):
            nuisance.append(
                ((problem.residual(model.without(term)) - residual) * self._root)[:, None]
            )
        # The prior of the base parameters stands beside the data as rows of its own.
        # Stiffer than it is: else a mass 5 % off would be taken for a base parameter's.
        self._rows = np.diag(_STIFF / problem.spread)
        beside = np.vstack(
            [
                np.hstack(nuisance),
                np.hstack([self._rows, np.zeros((len(self._rows), len(model.terms)))]),
            ]
        )
        self._basis = np.linalg.qr(beside)[0]
        target = np.concatenate((residual * self._root, _STIFF * model.base / problem.spread))
        self._target = self._free(target)

    def best(
        self, effect: Effect, count: int = 1, nodes: Sequence[tuple[float, ...]] | None = None
    ) -> list[Start]:
        """The most promising parameters of an effect; none where it changes nothing.

        Besides, what the filter's wander says of it.

        Args:
            effect: to be scanned.
            count: starts given back, at most.
            nodes: parameters to start from, each of which is given back that saves something;
                None takes a grid over what is plausible.
        """
        given = nodes is not None
        cheap = self._cheap(effect)
        nodes = list(self._nodes(effect, cheap)) if nodes is None else nodes
        linear: list[Start] = []
        if cheap:
            tried = [self._tried(effect, values, self._signature) for values in nodes]
            linear = sorted((t for t in tried if t is not None), key=lambda start: -start.gain)
            if not given and len(nodes) > _SIMULATED_NODES:
                nodes = [start.node for start in linear[:_SIMULATED_NODES]]
        found = [
            start
            for values in nodes
            if (start := self._tried(effect, values, self._simulated)) is not None
        ]
        if not cheap:
            found = [self._actual(start) for start in found]
        elif linear and not given:
            # A node in the wrong phase may make elements slip that do not: then the error
            # equations know better than a simulation, which the cost at their start shows.
            found += self._proven(linear[0])
        if cheap and not given and (followed := self._followed(effect)) is not None:
            found.append(followed)
        found.sort(key=lambda start: -start.gain)
        if given:
            return found
        kept = _distinct(found, effect)[:count]
        return kept + [start for start in found if start.followed and start not in kept]

    def _followed(self, effect: Effect) -> Start | None:
        """What the wander that the filter found says of an effect that scales Coulomb friction.

        The innovations are silent there: the filter follows. But a wander that has the effect's
        course is less likely than the effect, by the machine file's `repeatability`.
        """
        friction = self._problem.axis.friction
        if friction.wander <= 0.0:
            return None
        best: tuple[float, float, tuple[float, ...]] | None = None
        for values in self._nodes(effect, True):
            along = square = 0.0
            for tracker, track, acceleration in zip(
                self._problem.trackers, self._tracks, self._accelerations, strict=True
            ):
                term = Term(effect, values)
                course = inputs(self._axis, term, track, tracker.time, acceleration)
                if course is None or course.level is None or course.force is not None:
                    return None
                along += float(course.level @ track.level)
                square += float(course.level @ course.level)
            if along > 0.0 and (best is None or along**2 / square > best[0]):
                best = (along**2 / square, along / square, values)
        if best is None:
            return None
        energy, size, values = best
        apart = 2.0 * friction.correlation_time / float(self._problem.trackers[0].time[1])
        term = Term(effect, self._scaled(effect, values, min(size, _WIDEST)))
        signature = self._signature(term)
        if signature is None:
            return None
        column = self._beside([signature])[:, 0]
        return Start(term, energy / (apart * friction.wander**2), column, values, True)

    def _proven(self, start: Start) -> list[Start]:
        """The start with the gain that it really has, where it has one."""
        try:
            residual = self._problem.residual(self._model.added(start.term))
        except ValueError:
            return []
        gain = self._cost - self._problem.cost(self._model, residual)
        return [replace(start, gain=gain)] if gain > 0.0 else []

    def _actual(self, start: Start) -> Start:
        """With the gain that the node or the size sought from it really has, whichever is more."""
        best = start
        gains = []
        for term in (start.term, Term(start.term.effect, start.node)):
            try:
                residual = self._problem.residual(self._model.added(term))
            except ValueError:  # physics does not allow it beside what is there
                continue
            gains.append((self._cost - self._problem.cost(self._model, residual), term))
        if gains:
            gain, term = max(gains, key=lambda pair: pair[0])
            best = Start(term, max(gain, 0.1 * start.gain), start.signature, start.node)
        return best

    def _beside(self, signatures: Sequence[F64]) -> F64:
        """What base parameters and present effects leave of them, weighted, float64[R + B, n]."""
        plain = np.column_stack([signature * self._root for signature in signatures])
        return self._free(np.vstack([plain, np.zeros((len(self._rows), plain.shape[1]))]))

    def _free(self, columns: F64) -> F64:
        """Without what base parameters and present effects can take up."""
        return columns - self._basis @ (self._basis.T @ columns)

    def _tried(
        self,
        effect: Effect,
        values: tuple[float, ...],
        signature: Callable[[Term], F64 | None],
    ) -> Start | None:
        phase = next((i for i, p in enumerate(effect.parameters) if p.role == "phase"), None)
        place = _offset(effect)
        sets = [values]
        if phase is not None:
            sets.append(_changed(values, phase, values[phase] + 0.5 * math.pi))
        elif place is not None:
            sets.append(_changed(values, place, values[place] + _SHIFT))
        raw = [signature(Term(effect, v)) for v in sets]
        if any(r is None for r in raw):
            return None
        free = self._beside([r for r in raw if r is not None])
        normal = free.T @ free
        if not np.isfinite(normal).all() or float(np.trace(normal)) < 1e-6:
            return None
        amount = -np.linalg.solve(
            normal + 1e-9 * np.trace(normal) * np.eye(len(normal)), free.T @ self._target
        )
        if phase is not None:
            size = float(np.hypot(*amount))
            turned = values[phase] + math.atan2(float(amount[1]), float(amount[0]))
            values = _changed(values, phase, turned % (2.0 * math.pi))
            column = free @ (amount / (size + 1e-300))
        elif place is not None:
            size = float(amount.sum())
            share = float(amount[1]) / (size + 1e-300)
            values = _changed(values, place, values[place] + _SHIFT * share)
            column = free @ np.array([1.0 - share, share])
        else:
            size = float(amount[0])
            column = free[:, 0]
        size = min(max(size, 0.0), _WIDEST)
        if size < 1e-4:
            return None
        gain = -2.0 * size * float(column @ self._target) - size**2 * float(column @ column)
        term = Term(effect, self._scaled(effect, values, size))
        return Start(term, gain, size * column, values)

    def _scaled(self, effect: Effect, values: tuple[float, ...], size: float) -> tuple[float, ...]:
        """The node's values with the effect so many times as strong."""
        scaled = list(values)
        for i, parameter in enumerate(effect.parameters):
            neutral = parameter.neutral_on(self._problem.axis)
            if neutral is None or parameter.role != "size":
                continue
            if not math.isfinite(neutral) or parameter.log:
                continue  # not linear in it: the node itself is the start
            value = neutral + size * (values[i] - neutral)
            least = max(parameter.least, parameter.above + 1e-6)
            scaled[i] = min(max(value, least), parameter.below - 1e-6)
        return tuple(scaled)

    def _signature(self, term: Term) -> F64 | None:
        """Change of the residual when the term is added, float64[R]."""
        parts: list[F64] = []
        forces: list[F64] = []
        for tracker, track, gains, acceleration, mask in zip(
            self._problem.trackers, self._tracks, self._problem.gains, self._accelerations,
            self._problem.masks, strict=True,
        ):  # fmt: skip
            found = inputs(self._axis, term, track, tracker.time, acceleration)
            if found is None:
                return self._simulated(term)
            parts.append(-response(found, gains)[mask])
            forces.append(np.zeros(int(mask.sum())))
        return np.concatenate((*parts, *forces))

    def _simulated(self, term: Term) -> F64 | None:
        try:
            return self._problem.residual(self._model.added(term)) - self._residual
        except ValueError:  # a node that physics does not allow beside what is there
            return None

    def _nodes(self, effect: Effect, cheap: bool) -> Iterator[tuple[float, ...]]:
        grids: list[list[float]] = []
        formed = 0
        for parameter in effect.parameters:
            grids.append(self._grid(effect, parameter, cheap, formed))
            formed += parameter.role in ("place", "shape")
        yield from itertools.product(*grids)

    def _cheap(self, effect: Effect) -> bool:
        values = tuple(_middle(p, self._problem.axis) for p in effect.parameters)
        return (
            inputs(
                self._axis, Term(effect, values), self._tracks[0],
                self._problem.trackers[0].time, self._accelerations[0],
            )
            is not None
        )  # fmt: skip

    def _grid(self, effect: Effect, parameter: Parameter, cheap: bool, formed: int) -> list[float]:
        """Values to try; `formed` parameters of place or shape came before."""
        axis = self._problem.axis
        if parameter.role == "phase":
            return [0.0]
        if parameter.role == "size":
            several = not cheap and len(effect.parameters) == 1
            return _sizes(parameter, axis, several)
        several = sum(p.role in ("place", "shape") for p in effect.parameters) > 1
        if parameter.role == "place":
            low = min(float(t.x.min()) for t in self._tracks)
            high = max(float(t.x.max()) for t in self._tracks)
            count = 24 if cheap and several else _SIMULATED_NODES
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
            return [_middle(parameter, axis)]
        if parameter.log:
            return list(np.geomspace(_BEYOND * low, high / _BEYOND, count))
        return list(np.linspace(low, high, count))

    def _periodic_in_time(self, effect: Effect) -> bool:
        ports = EffectPorts(self._problem.axis, 1e-3, 1.0)
        values = {p.key: _middle(p, self._problem.axis) for p in effect.parameters}
        effect.apply(ports, values)
        return bool(ports.harmonics)

    def _peaks(self, low: float, high: float) -> list[float]:
        """Frequencies of the highest peaks of the innovations' spectrum [Hz]."""
        track, tracker = self._tracks[0], self._problem.trackers[0]
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


def _distinct(found: list[Start], effect: Effect) -> list[Start]:
    """The best start, and the next one of quite another shape that promises nearly as much."""
    kept = found[:1]
    for start in found[1:]:
        ratios = [
            value / other
            for parameter, value, other in zip(
                effect.parameters, start.node, kept[0].node, strict=True
            )
            if parameter.role == "shape" and other > 0.0
        ]
        apart = any(max(r, 1.0 / r) > _APART for r in ratios if r > 0.0)
        if apart and start.gain > _NEARLY * kept[0].gain:
            kept.append(start)
    return kept[:2]


def _offset(effect: Effect) -> int | None:
    """Index of a place that only shifts the effect: where nothing else gives it a shape."""
    roles = [p.role for p in effect.parameters]
    if "shape" in roles or "phase" in roles or "place" not in roles:
        return None
    return roles.index("place")


def _changed(values: tuple[float, ...], index: int, value: float) -> tuple[float, ...]:
    return (*values[:index], value, *values[index + 1 :])


def _middle(parameter: Parameter, axis: AxisSettings) -> float:
    low, high = parameter.ranges(axis)[-1]
    return math.sqrt(low * high) if parameter.log else 0.5 * (low + high)


def _sizes(parameter: Parameter, axis: AxisSettings, several: bool) -> list[float]:
    """Typical sizes: in the middle of each plausible side of the neutral value, or several."""
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
