"""Candidates: where to start each effect of the library beside a model, by simulation.

The signature of an effect is the run with it minus the run without. Where its size has a finite
neutral value, the signature is scaled to the residual by least squares beside all that is fitted
already; where it has none (a bandwidth, a saturation) it is taken at full size. Pitches and
frequencies are sought where the residual force has its peaks.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil_sim.effects.effect import Effect, Parameter
from sim2real.fitting import STEP, Term, coordinates
from sim2real.free_loop.fit import FreeFit, derivatives
from sim2real.free_loop.loop import FreeLoop
from stagedata import BoolArray

F64 = NDArray[np.float64]

_PLACES, _SHAPES, _FEW = 12, 6, 3
"""Places, and shapes alone or beside a place, that are tried."""
_PEAKS, _BESIDE, _BEYOND = 3, 0.35, 1.5
"""Peaks of the residual force that are tried for a pitch or a frequency; how far to both sides, in
waves over the extent; and the factor by which they may lie beyond what is plausible."""
_SIZES = (0.25, 1.0)
"""Shares of the way from neutral to the far end of the plausible range, where a size is not
scaled."""
_WIDEST = 6.0
"""A signature is scaled up to this many times."""
_RIDGE = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """An effect to start with.

    Attributes:
        term: with the values to start from.
        gain: cost that it would save, to first order.
    """

    term: Term
    gain: float


class Dictionary:
    """Candidates beside a fitted model.

    Args:
        loop: the axis.
        fitted: the model.
        moves: that count, bool[moves]; None for all.
    """

    def __init__(self, loop: FreeLoop, fitted: FreeFit, moves: BoolArray | None = None) -> None:
        self._loop = loop
        self._fitted = fitted
        self._own = np.ones(len(loop.move), dtype=np.bool_) if moves is None else moves[loop.move]
        energy = float(np.mean(fitted.residual[self._own] ** 2))
        self._root = 1.0 / math.sqrt(loop.coherent * max(energy, 1.0))
        slopes = derivatives(loop, fitted.model, fitted.residual)
        columns = slopes[self._own] * self._root
        prior = np.zeros((STEP, columns.shape[1]))
        prior[:, :STEP] = np.eye(STEP)
        self._basis = np.linalg.qr(np.vstack([columns, prior]))[0]
        base = fitted.model.base[:STEP] / loop.spread
        self._target = self._free(
            np.concatenate([fitted.residual[self._own] * self._root, base])[:, None]
        )[:, 0]
        self._peaks: dict[str, F64] = {}

    def best(self, effect: Effect, count: int = 1) -> list[Candidate]:
        """The most promising starts of an effect, best first; none where it changes nothing."""
        nodes = list(self._nodes(effect))
        phase = next((i for i, p in enumerate(effect.parameters) if p.role == "phase"), None)
        place = _only_shifts(effect)
        sets: list[tuple[float, ...]] = []
        for values in nodes:
            sets.append(values)
            if phase is not None:
                sets.append(_with(values, phase, values[phase] + 0.5 * math.pi))
            elif place is not None:
                sets.append(_with(values, place, values[place] + 0.2 * self._loop.extent))
        model = self._fitted.model
        runs = self._loop.residuals([model.added(Term(effect, v)) for v in sets])
        each = len(sets) // max(len(nodes), 1)
        found = []
        for i, values in enumerate(nodes):
            own = [r for r in runs[each * i : each * (i + 1)] if r is not None]
            if len(own) == each:
                found.append(self._started(effect, values, own, phase, place))
        kept = [c for c in found if c is not None]
        return sorted(kept, key=lambda c: -c.gain)[:count]

    def _free(self, columns: F64) -> F64:
        return columns - self._basis @ (self._basis.T @ columns)

    def _started(
        self,
        effect: Effect,
        values: tuple[float, ...],
        runs: Sequence[F64],
        phase: int | None,
        place: int | None,
    ) -> Candidate | None:
        """A start of a node, scaled and turned or shifted to fit what is left."""
        raw = np.column_stack([(r - self._fitted.residual)[self._own] for r in runs]) * self._root
        free = self._free(np.vstack([raw, np.zeros((STEP, raw.shape[1]))]))
        normal = free.T @ free
        if not np.isfinite(normal).all() or float(np.trace(normal)) < 1e-9:
            return None
        amount = -np.linalg.solve(
            normal + _RIDGE * np.trace(normal) * np.eye(len(normal)), free.T @ self._target
        )
        size = float(amount[0])
        if phase is not None:
            size = float(np.hypot(*amount))
            turned = values[phase] + math.atan2(float(amount[1]), float(amount[0]))
            values = _with(values, phase, turned % (2.0 * math.pi))
        elif place is not None:
            size = float(amount.sum())
            share = float(amount[1]) / (size if abs(size) > 1e-12 else 1e-12)
            share = min(max(share, -5.0), 5.0)
            values = _with(values, place, values[place] + 0.2 * share * self._loop.extent)
        scaled = self._scaled(effect, values, size)
        if scaled is None:
            return None
        term, factor = scaled
        column = free @ (amount * (factor / size if abs(size) > 1e-12 else 0.0))
        gain = -2.0 * float(column @ self._target) - float(column @ column)
        return Candidate(term, gain) if gain > 0.0 else None

    def _scaled(
        self, effect: Effect, values: tuple[float, ...], size: float
    ) -> tuple[Term, float] | None:
        """The term this many times as strong, as far as physics allows, and that factor."""
        entries = coordinates(effect, self._loop.axis)
        out, factor = list(values), 1.0
        for i, (parameter, entry) in enumerate(zip(effect.parameters, entries, strict=True)):
            neutral = parameter.neutral_on(self._loop.axis)
            if parameter.role != "size" or neutral is None:
                continue
            if not _is_linear(parameter, neutral):
                if not 0.3 < size:
                    return None
                continue
            first = values[i] - neutral
            value = entry.clipped(neutral + min(max(size, -_WIDEST), _WIDEST) * first)
            out[i], factor = value, (value - neutral) / first
        if abs(factor) < 1e-3:
            return None
        return Term(effect, tuple(out)), factor

    def _nodes(self, effect: Effect) -> itertools.product[tuple[float, ...]]:
        """Values of all parameters to try."""
        roles = [p.role for p in effect.parameters]
        periodic = "phase" in roles
        formed = sum(role in ("place", "shape") for role in roles)
        grids: list[list[float]] = []
        shaped = 0
        for parameter in effect.parameters:
            if parameter.role == "phase":
                grids.append([0.0])
            elif parameter.role == "size":
                grids.append(self._sizes(parameter))
            elif parameter.role == "place":
                low, high = self._loop.travelled
                count = _PLACES if formed > 1 else 1
                edge = (high - low) / count / 2.0
                grids.append(list(np.linspace(low + edge, high - edge, count)))
            elif periodic:
                grids.append(self._waves(parameter))
            else:
                low, high = parameter.ranges(self._loop.axis)[0]
                count = _FEW if "place" in roles else (_SHAPES if shaped == 0 else 1)
                shaped += 1
                if count == 1:
                    grids.append([math.sqrt(low * high) if low > 0.0 else 0.5 * (low + high)])
                elif low > 0.0:
                    grids.append(list(np.geomspace(low / _BEYOND, high * _BEYOND, count)))
                else:
                    grids.append(list(np.linspace(low, high, count)))
        return itertools.product(*grids)

    def _sizes(self, parameter: Parameter) -> list[float]:
        axis = self._loop.axis
        neutral = parameter.neutral_on(axis)
        low, high = parameter.ranges(axis)[-1]
        if neutral is not None and _is_linear(parameter, neutral):
            if parameter.least == neutral or low >= neutral:
                return [0.5 * (low + high)]
            sides = {low, high} - {neutral}
            return [neutral + 0.5 * (side - neutral) for side in sides]
        if neutral is not None and math.isfinite(neutral) and parameter.log:
            far = min((low, high), key=lambda v: -abs(math.log(v / neutral)))
            return [neutral * (far / neutral) ** share for share in (0.3, 0.6, 1.0, 1.4)]
        return list(np.geomspace(low, high, 4))

    def _waves(self, parameter: Parameter) -> list[float]:
        """Pitches [m] or frequencies [Hz] of the highest peaks of the residual force."""
        low, high = parameter.ranges(self._loop.axis)[0]
        low, high = max(low / _BEYOND, parameter.least), high * _BEYOND
        over_travel = parameter.unit == "m"
        lines = self._loop.wave_lines(over_travel)
        if parameter.unit not in self._peaks:
            self._peaks[parameter.unit] = self._loop.wave_power(
                self._fitted.residual, self._fitted.model, over_travel, self._own
            )
        values = 1.0 / lines if over_travel else lines
        power = np.where((values >= low) & (values <= high), self._peaks[parameter.unit], 0.0)
        extent = self._loop.extent if over_travel else self._loop.duration
        found: list[float] = []
        while len(found) < 3 * _PEAKS and power.max() > 0.0:
            peak = int(power.argmax())
            beside = lines[peak] + np.array([0.0, -_BESIDE, _BESIDE]) / extent
            found += [float(v) for v in (1.0 / beside if over_travel else beside) if v > 0.0]
            power = np.where(np.abs(lines - lines[peak]) < 1.0 / extent, 0.0, power)
        return found


def _is_linear(parameter: Parameter, neutral: float) -> bool:
    return math.isfinite(neutral) and not parameter.log


def _only_shifts(effect: Effect) -> int | None:
    """The parameter that is a place without a shape: it merely shifts a force."""
    roles = [p.role for p in effect.parameters]
    return roles.index("place") if "place" in roles and "shape" not in roles else None


def _with(values: tuple[float, ...], index: int, value: float) -> tuple[float, ...]:
    return (*values[:index], value, *values[index + 1 :])
