"""Candidates: where to start each effect of the library beside a fitted model.

An effect is tried at the nodes of a grid over place, pitch, frequency, time constant and the like.
At each node it has a signature: the residual of a run with the effect less that of a run without.
The size, phase or shift that fits best follows by least squares beside everything fitted already.
The caller says what models are fitted to, tracked innovations or the free loop (`Linearised`).
Where it can compute signatures to first order, hundreds of nodes are tried in this way and only the
best are simulated.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil_sim.effects import Effect, Parameter
from hil_sim.settings import AxisSettings
from sim2real.dictionary.nodes import (
    FIRST_ORDER,
    SIMULATED,
    Values,
    Waves,
    effect_nodes,
    typical,
)
from sim2real.fitting import AxisModel, Term, coordinates
from stagedata import F64

_NODES = 3
"""Nodes that are simulated where signatures are known to first order."""
_SHIFT = 0.2
"""Distance between two places tried of an effect that a place merely shifts, as a share of the
travel: its signature at any other place is a combination of the two."""
_FARTHEST = 5.0
"""Largest shift of such a place, in these distances."""
_WIDEST = 3.0
"""Largest factor by which a signature is scaled."""
_LEAST = 1e-4
"""Smallest such factor: an effect that should be smaller still is dropped."""
_RIDGE, _SILENT = 1e-9, 1e-9
"""Relative ridge of the normal equations; energy below which a signature is taken for zero."""
_KEPT = 0.1
"""Smallest gain of a start, over the gain predicted: a fit may save more than its start."""
_APART, _NEARLY = 1.2, 0.6
"""A second start of an effect is kept if a shape differs by more than this ratio and its gain is
more than this share of the best one's, as for a wave and its harmonic."""


@dataclass(frozen=True, slots=True, eq=False)
class Linearised:
    """A fitted model, and what is known of its surroundings.

    Attributes:
        axis: of the machine file.
        model: the model.
        residual: what it leaves, float64[R].
        root: square root of each element's weight, 0 where it does not count, float64[R].
        beside: derivatives of the residual by base parameters and present effects, float64[R, P].
        prior: derivatives of the prior's B residuals by the same, float64[B, P].
        held: the prior's residuals, float64[B].
        travelled: lowest and highest position [m].
        waves: pitches and frequencies at which the residual has its peaks.
        residuals: what models leave, float64[R] each; None for values that physics does not allow.
        cost: of the model with a residual.
        first_order: signature of a term, float64[R], without a simulation; None where it takes
            one.
    """

    axis: AxisSettings
    model: AxisModel
    residual: F64
    root: F64
    beside: F64
    prior: F64
    held: F64
    travelled: tuple[float, float]
    waves: Waves
    residuals: Callable[[Sequence[AxisModel]], list[F64 | None]]
    cost: Callable[[F64], float]
    first_order: Callable[[Term], F64 | None] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """An effect to start with.

    Attributes:
        term: with the values to start from.
        gain: cost that it would save, to first order.
        signature: its weighted part of the residual that base parameters and present effects
            cannot take up, float64[R + B].
        node: of the grid that it came from.
        from_wander: whether the gain is in the level that the filter tracked, not in innovations.
    """

    term: Term
    gain: float
    signature: F64
    node: Values
    from_wander: bool = False


_Signatures = Callable[[Sequence[Term]], "list[F64 | None]"]


class Dictionary:
    """Candidates beside a fitted model.

    Args:
        at: the model.
    """

    def __init__(self, at: Linearised) -> None:
        self._at = at
        self._axis = at.axis
        self._cost = at.cost(at.residual)
        self._saved: dict[tuple[str, Values], float | None] = {}
        self._basis = np.linalg.qr(np.vstack([at.beside * at.root[:, None], at.prior]))[0]
        self._target = self._free(np.concatenate([at.residual * at.root, at.held])[:, None])[:, 0]

    def best(
        self, effect: Effect, count: int = 1, nodes: Sequence[Values] | None = None
    ) -> list[Candidate]:
        """The most promising starts of an effect, best first; none where it changes nothing.

        Args:
            effect: to be tried.
            count: starts returned, at most two: a second one differs in shape.
            nodes: values to start from; each that saves anything is returned. None takes a grid
                over the plausible ranges.
        """
        if nodes is not None:
            return _by_gain(self._tried(effect, nodes, self._simulated))
        cheap = self._is_cheap(effect)
        nodes = self.nodes(effect)
        linear: list[Candidate] = []
        if cheap:
            linear = _by_gain(self._tried(effect, nodes, self._first_order))
            if len(nodes) > _NODES:
                nodes = [candidate.node for candidate in linear[:_NODES]]
        found = self._tried(effect, nodes, self._simulated)
        if linear:
            # A node in the wrong phase may make elements slip that really stick: then first order
            # is more accurate than a simulation, as the cost at its start shows.
            found += self._proven(linear[0])
        elif self._at.first_order is not None or not self._is_scalable(effect):
            found = self._actual(found)
        return _distinct(_by_gain(found), effect)[:count]

    def nodes(self, effect: Effect) -> list[Values]:
        """Values of an effect to try; more of them where no simulation is needed."""
        grid = FIRST_ORDER if self._is_cheap(effect) else SIMULATED
        return list(effect_nodes(effect, self._axis, self._at.travelled, grid, self._at.waves))

    def left_over(self, signature: F64) -> F64:
        """What base parameters and present effects leave of a signature, float64[R + B].

        A signature, float64[R], is the change of the weighted residual by an effect, in units of
        its noise. Below what is left of it are the prior's B rows.
        """
        return self._beside([signature])[:, 0]

    def scaled(self, effect: Effect, values: Values, size: float) -> tuple[Term, float]:
        """The effect this many times as strong, as far as physics allows, and that factor.

        An effect that is not linear in its size stays as it is: it starts at the node.
        """
        size = min(max(size, 0.0), _WIDEST)
        out, factor = list(values), size
        entries = coordinates(effect, self._axis)
        for i, (parameter, entry) in enumerate(zip(effect.parameters, entries, strict=True)):
            neutral = parameter.neutral_on(self._axis)
            if parameter.role != "size" or neutral is None or not _is_linear(parameter, neutral):
                continue
            first = values[i] - neutral
            value = entry.clipped(neutral + size * first)
            out[i], factor = value, (value - neutral) / first
        return Term(effect, tuple(out)), factor

    def _is_cheap(self, effect: Effect) -> bool:
        if self._at.first_order is None:
            return False
        return self._at.first_order(typical(effect, self._axis)) is not None

    def _is_scalable(self, effect: Effect) -> bool:
        """Whether all sizes of an effect are linear."""
        sizes = [(p, p.neutral_on(self._axis)) for p in effect.parameters if p.role == "size"]
        return all(neutral is not None and _is_linear(p, neutral) for p, neutral in sizes)

    def _proven(self, start: Candidate) -> list[Candidate]:
        """The start with the gain that a simulation of it shows; none if it shows none."""
        (gain,) = self._gains([start.term])
        return [replace(start, gain=gain)] if gain is not None and gain > 0.0 else []

    def _actual(self, starts: Sequence[Candidate]) -> list[Candidate]:
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
                start = replace(start, term=term, gain=max(gain, _KEPT * start.gain))
            best.append(start)
        return best

    def _gains(self, terms: Sequence[Term]) -> list[float | None]:
        """Actual reduction of the cost by each term; None where physics does not allow it."""
        self._simulated([term for term in terms if _key(term) not in self._saved])
        return [self._saved[_key(term)] for term in terms]

    def _beside(self, signatures: Sequence[F64]) -> F64:
        """What base parameters and present effects leave of signatures, float64[R + B, n]."""
        plain = np.column_stack([signature * self._at.root for signature in signatures])
        return self._free(np.vstack([plain, np.zeros((len(self._at.held), plain.shape[1]))]))

    def _free(self, columns: F64) -> F64:
        """The columns without what base parameters and present effects can explain."""
        return columns - self._basis @ (self._basis.T @ columns)

    def _tried(
        self, effect: Effect, nodes: Sequence[Values], signatures: _Signatures
    ) -> list[Candidate]:
        """Starts at the nodes that change the residual; size, phase and shift by least squares."""
        phase = next((i for i, p in enumerate(effect.parameters) if p.role == "phase"), None)
        place = shift_only_place(effect)
        shift = _SHIFT * (self._at.travelled[1] - self._at.travelled[0])
        sets = []
        for values in nodes:
            sets.append(values)
            if phase is not None:
                sets.append(_with_value(values, phase, values[phase] + 0.5 * math.pi))
            elif place is not None:
                sets.append(_with_value(values, place, values[place] + shift))
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
        values: Values,
        signatures: Sequence[F64],
        phase: int | None,
        place: int | None,
    ) -> Candidate | None:
        """The start of a node, by its signature and that of its other phase or place."""
        free = self._beside(signatures)
        normal = free.T @ free
        if not np.isfinite(normal).all() or float(np.trace(normal)) < _SILENT:
            return None
        ridge = _RIDGE * np.trace(normal) * np.eye(len(normal))
        amount = -np.linalg.solve(normal + ridge, free.T @ self._target)
        size, start = float(amount[0]), values
        if phase is not None:
            size = float(np.hypot(*amount))
            turned = values[phase] + math.atan2(float(amount[1]), float(amount[0]))
            start = _with_value(values, phase, turned % (2.0 * math.pi))
        elif place is not None:
            size = float(amount.sum())
            share = float(amount[1]) / max(size, _LEAST)
            share = min(max(share, -_FARTHEST), _FARTHEST)
            far = share * _SHIFT * (self._at.travelled[1] - self._at.travelled[0])
            start = _with_value(values, place, values[place] + far)
            amount = size * np.array([1.0 - share, share])
        if size < _LEAST:
            return None
        term, factor = self.scaled(effect, start, size)
        column = free @ (amount * (factor / size))
        gain = -2.0 * float(column @ self._target) - float(column @ column)
        return Candidate(term, gain, column, values) if gain > 0.0 else None

    def _first_order(self, terms: Sequence[Term]) -> list[F64 | None]:
        """Change of the residual when each term is added, float64[R], to first order."""
        known = self._at.first_order
        found = [None if known is None else known(term) for term in terms]
        return [
            self._simulated([term])[0] if signature is None else signature
            for term, signature in zip(terms, found, strict=True)
        ]

    def _simulated(self, terms: Sequence[Term]) -> list[F64 | None]:
        """The same by simulation; None for values that physics does not allow."""
        residuals = self._at.residuals([self._at.model.added(term) for term in terms])
        for term, residual in zip(terms, residuals, strict=True):
            self._saved[_key(term)] = (
                None if residual is None else self._cost - self._at.cost(residual)
            )
        return [
            None if residual is None else residual - self._at.residual for residual in residuals
        ]


def _is_linear(parameter: Parameter, neutral: float) -> bool:
    """Whether a signature may be scaled by this size: finite neutral value, not logarithmic."""
    return math.isfinite(neutral) and not parameter.log


def _by_gain(found: Sequence[Candidate]) -> list[Candidate]:
    return sorted(found, key=lambda candidate: -candidate.gain)


def _distinct(found: Sequence[Candidate], effect: Effect) -> list[Candidate]:
    """The best start, and the next with a clearly different shape and nearly as much gain."""
    kept = list(found[:1])
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
            return [*kept, start]
    return kept


def shift_only_place(effect: Effect) -> int | None:
    """Index of a place that merely shifts the effect, because nothing else gives it a shape."""
    roles = [p.role for p in effect.parameters]
    if "shape" in roles or "phase" in roles or "place" not in roles:
        return None
    return roles.index("place")


def _key(term: Term) -> tuple[str, Values]:
    return term.name, term.values


def _with_value(values: Values, index: int, value: float) -> Values:
    return (*values[:index], value, *values[index + 1 :])
