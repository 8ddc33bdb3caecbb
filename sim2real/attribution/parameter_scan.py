"""Where to start fitting an effect: its parameters scanned over plausible ranges, to first order.

Each node of a grid over place, pitch, frequency, time constant and the like gives a signature; its
size (and phase) follow by least squares beside the base parameters. Cheap signatures come from the
error equations (`sim2real.attribution.signature`), the others from one tracked run each.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hil_sim.effects.effect import Effect
from sim2real.attribution.parameter_grid import Grid, midrange
from sim2real.attribution.signature import effect_inputs, first_order_signature
from sim2real.fitting import AxisModel, AxisProblem, Term

F64 = NDArray[np.float64]

_SIMULATED_NODES = 3
"""Nodes with a cheap signature that are simulated in the end."""
_SHIFT = 0.05
"""Distance to a second place; a place that merely shifts an effect is found between the two [m]."""
_APART, _NEARLY = 1.2, 0.6
"""Shapes of an effect whose ratio exceeds the first are different starts, if the second one's
gain is this share of the first one's: a wave and its harmonic."""
_PRIOR_STIFFNESS = 5.0
"""Factor by which base parameters are held tighter than their tolerance: a fit keeps them in
bounds, which first order does not know."""
_WIDEST = 3.0
"""Sizes are sought up to this many times the node's."""


@dataclass(frozen=True, slots=True, eq=False)
class Start:
    """Where to start fitting an effect.

    Attributes:
        term: with the best parameters found.
        gain: cost that it would save, to first order.
        signature: its weighted part of the residual that the base parameters cannot take up,
            float64[R + B]: the rows of their prior stand below.
        node: of the grid that it came from.
        from_wander: whether the gain is in the filter's wander, not in its innovations.
    """

    term: Term
    gain: float
    signature: F64
    node: tuple[float, ...]
    from_wander: bool = False


class Scanner:
    """Scans effects on an axis beside a model that has been fitted.

    Args:
        problem: the axis.
        model: fitted so far.
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
        self._saved: dict[tuple[str, tuple[float, ...]], float | None] = {}
        self._axis = model.settings(problem.axis)
        self._tracks = problem.track(model)
        self._grid = Grid(problem.axis, problem.trackers, self._tracks)
        period = float(problem.trackers[0].time[1])
        self._accelerations = [np.gradient(t.v, period) for t in self._tracks]
        nuisance = [base_columns * self._root[:, None]]
        fewer = [model.without(term) for term in range(len(model.terms))]
        for without in problem.residuals_or_worst(fewer):
            nuisance.append(((without - residual) * self._root)[:, None])
        # The prior of the base parameters adds rows to the data. It is stiffened: otherwise a
        # mass 5 % off would be explained by a base parameter.
        self._rows = np.diag(_PRIOR_STIFFNESS / problem.spread)
        beside = np.vstack(
            [
                np.hstack(nuisance),
                np.hstack([self._rows, np.zeros((len(self._rows), len(model.terms)))]),
            ]
        )
        self._basis = np.linalg.qr(beside)[0]
        target = np.concatenate(
            (residual * self._root, _PRIOR_STIFFNESS * model.base / problem.spread)
        )
        self._target = self._free(target)

    def best(
        self, effect: Effect, count: int = 1, nodes: Sequence[tuple[float, ...]] | None = None
    ) -> list[Start]:
        """The most promising parameters of an effect; none where it changes nothing.

        What the filter's wander says of it is added.

        Args:
            effect: to be scanned.
            count: starts returned, at most.
            nodes: parameters to start from; each that saves anything is returned. None takes a
                grid over the plausible ranges.
        """
        given = nodes is not None
        cheap = self._cheap(effect)
        nodes = list(self._grid.nodes(effect, cheap)) if nodes is None else nodes
        linear: list[Start] = []
        if cheap:
            linear = sorted(self._tried(effect, nodes, self._signatures), key=lambda s: -s.gain)
            if not given and len(nodes) > _SIMULATED_NODES:
                nodes = [start.node for start in linear[:_SIMULATED_NODES]]
        found = self._tried(effect, nodes, self._simulated)
        if not cheap:
            found = self._actual(found)
        elif linear and not given:
            # A node in the wrong phase may make elements slip that really stick: then the error
            # equations are more accurate than a simulation, as the cost at their start shows.
            found += self._proven(linear[0])
        if cheap and not given and (followed := self._followed(effect)) is not None:
            found.append(followed)
        found.sort(key=lambda start: -start.gain)
        if given:
            return found
        kept = _distinct_starts(found, effect)[:count]
        return kept + [start for start in found if start.from_wander and start not in kept]

    def _followed(self, effect: Effect) -> Start | None:
        """What the filter's wander says of an effect that scales Coulomb friction.

        The innovations say nothing of it, because the filter follows. But a wander that has the
        effect's course is less likely than the effect, by the machine file's `repeatability`.
        """
        axis = self._problem.axis
        if axis.wander <= 0.0:
            return None
        best: tuple[float, float, tuple[float, ...]] | None = None
        for values in self._grid.nodes(effect, True):
            along = square = 0.0
            for tracker, track, acceleration in zip(
                self._problem.trackers, self._tracks, self._accelerations, strict=True
            ):
                term = Term(effect, values)
                course = effect_inputs(self._axis, term, track, tracker.time, acceleration)
                if course is None or course.level is None or course.force is not None:
                    return None
                along += float(course.level @ track.level)
                square += float(course.level @ course.level)
            if along > 0.0 and (best is None or along**2 / square > best[0]):
                best = (along**2 / square, along / square, values)
        if best is None:
            return None
        energy, size, values = best
        apart = 2.0 * axis.correlation_time / float(self._problem.trackers[0].time[1])
        term = Term(effect, self._scaled(effect, values, min(size, _WIDEST)))
        signature = self._signatures([term])[0]
        if signature is None:
            return None
        column = self._beside([signature])[:, 0]
        return Start(term, energy / (apart * axis.wander**2), column, values, True)

    def _proven(self, start: Start) -> list[Start]:
        """The start with its actual gain, if it has any."""
        gain = self._gains([start.term])[0]
        return [replace(start, gain=gain)] if gain is not None and gain > 0.0 else []

    def _actual(self, starts: Sequence[Start]) -> list[Start]:
        """The starts with the actual gain of their node or fitted size, whichever is larger."""
        tried = [t for s in starts for t in (s.term, Term(s.term.effect, s.node))]
        gains = self._gains(tried)
        best = []
        for i, start in enumerate(starts):
            known = [
                (gain, tried[at])
                for at in (2 * i, 2 * i + 1)
                if (gain := gains[at]) is not None  # physics may not allow it beside what is there
            ]
            if known:
                gain, term = max(known, key=lambda pair: pair[0])
                start = Start(term, max(gain, 0.1 * start.gain), start.signature, start.node)
            best.append(start)
        return best

    def _gains(self, terms: Sequence[Term]) -> list[float | None]:
        """Actual reduction of the cost by each term; None where physics does not allow it."""
        self._simulated([term for term in terms if _key(term) not in self._saved])
        return [self._saved[_key(term)] for term in terms]

    def _beside(self, signatures: Sequence[F64]) -> F64:
        """What base parameters and present effects leave of signatures, float64[R + B, n]."""
        plain = np.column_stack([signature * self._root for signature in signatures])
        return self._free(np.vstack([plain, np.zeros((len(self._rows), plain.shape[1]))]))

    def _free(self, columns: F64) -> F64:
        """The columns without what base parameters and present effects can explain."""
        return columns - self._basis @ (self._basis.T @ columns)

    def _tried(
        self,
        effect: Effect,
        nodes: Sequence[tuple[float, ...]],
        signatures: Callable[[Sequence[Term]], list[F64 | None]],
    ) -> list[Start]:
        """Starts from nodes that change something; sizes, phases and shifts by least squares."""
        phase = next((i for i, p in enumerate(effect.parameters) if p.role == "phase"), None)
        place = _shift_only_place(effect)
        sets = []
        for values in nodes:
            sets.append(values)
            if phase is not None:
                sets.append(_with_value(values, phase, values[phase] + 0.5 * math.pi))
            elif place is not None:
                sets.append(_with_value(values, place, values[place] + _SHIFT))
        raw = signatures([Term(effect, v) for v in sets])
        each = len(sets) // max(len(nodes), 1)
        found = []
        for i, values in enumerate(nodes):
            own = [r for r in raw[each * i : each * (i + 1)] if r is not None]
            if len(own) == each:
                found.append(self._started(effect, values, own, phase, place))
        return [start for start in found if start is not None]

    def _started(
        self,
        effect: Effect,
        values: tuple[float, ...],
        signatures: Sequence[F64],
        phase: int | None,
        place: int | None,
    ) -> Start | None:
        """The start of a node, by its signature and that of its other phase or place."""
        free = self._beside(signatures)
        normal = free.T @ free
        if not np.isfinite(normal).all() or float(np.trace(normal)) < 1e-6:
            return None
        amount = -np.linalg.solve(
            normal + 1e-9 * np.trace(normal) * np.eye(len(normal)), free.T @ self._target
        )
        if phase is not None:
            size = float(np.hypot(*amount))
            turned = values[phase] + math.atan2(float(amount[1]), float(amount[0]))
            values = _with_value(values, phase, turned % (2.0 * math.pi))
            column = free @ (amount / (size + 1e-300))
        elif place is not None:
            size = float(amount.sum())
            share = float(amount[1]) / (size + 1e-300)
            values = _with_value(values, place, values[place] + _SHIFT * share)
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
        """The node's values with the effect this many times as strong."""
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

    def _signatures(self, terms: Sequence[Term]) -> list[F64 | None]:
        """Change of the residual when each term is added, float64[R], to first order."""
        found: list[F64 | None] = []
        for term in terms:
            parts: list[F64] = []
            forces: list[F64] = []
            for tracker, track, gains, acceleration, mask in zip(
                self._problem.trackers, self._tracks, self._problem.gains, self._accelerations,
                self._problem.masks, strict=True,
            ):  # fmt: skip
                there = effect_inputs(self._axis, term, track, tracker.time, acceleration)
                if there is None:
                    break
                parts.append(-first_order_signature(there, gains)[mask])
                forces.append(np.zeros(int(mask.sum())))
            whole = len(parts) == len(self._tracks)
            found.append(np.concatenate((*parts, *forces)) if whole else self._simulated([term])[0])
        return found

    def _simulated(self, terms: Sequence[Term]) -> list[F64 | None]:
        """The same by simulation; None for values that physics does not allow."""
        residuals = self._problem.residuals([self._model.added(term) for term in terms])
        for term, residual in zip(terms, residuals, strict=True):
            self._saved[_key(term)] = (
                None if residual is None else self._cost - self._problem.cost(self._model, residual)
            )
        return [None if residual is None else residual - self._residual for residual in residuals]

    def _cheap(self, effect: Effect) -> bool:
        values = tuple(midrange(p, self._problem.axis) for p in effect.parameters)
        return (
            effect_inputs(
                self._axis, Term(effect, values), self._tracks[0],
                self._problem.trackers[0].time, self._accelerations[0],
            )
            is not None
        )  # fmt: skip


def _key(term: Term) -> tuple[str, tuple[float, ...]]:
    return term.name, term.values


def _distinct_starts(found: list[Start], effect: Effect) -> list[Start]:
    """The best start, and the next with a clearly different shape and nearly as much gain."""
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


def _shift_only_place(effect: Effect) -> int | None:
    """Index of a place that merely shifts the effect, because nothing else gives it a shape."""
    roles = [p.role for p in effect.parameters]
    if "shape" in roles or "phase" in roles or "place" not in roles:
        return None
    return roles.index("place")


def _with_value(values: tuple[float, ...], index: int, value: float) -> tuple[float, ...]:
    return (*values[:index], value, *values[index + 1 :])
