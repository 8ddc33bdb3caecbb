"""A model fitted to tracked innovations, as the dictionary of candidates asks for it.

Effects that are a force or a factor along the tracked motion have a first-order signature
(`sim2real.attribution.signature`). Effects that scale Coulomb friction, which the filter follows,
are also found in the course of the level that it tracked (`follow`).
"""

from __future__ import annotations

import numpy as np

from hil_sim.effects import Effect, Parameter
from sim2real.attribution.levels import level_course
from sim2real.attribution.signature import effect_inputs, first_order_signature
from sim2real.dictionary import Candidate, Dictionary, Linearised, typical
from sim2real.fitting import AxisProblem, Fitted, Term
from sim2real.tracking import Track
from stagedata import F64

_PRIOR_STIFFNESS = 5.0
"""Factor by which base parameters are held tighter than their tolerance, since a first-order
estimate does not know the bounds that a fit keeps."""
_PEAKS = 4
"""Frequencies of a vibration that are tried: the highest peaks of the innovations' spectrum."""
_LOWER, _HIGHER = 0.7, 1.4
"""How far beyond the plausible range a peak may lie."""


class TrackedDictionary(Dictionary):
    """Candidates on an axis beside a model that has been fitted to innovations.

    Args:
        problem: the axis.
        fitted: the model so far.
        base_columns: derivatives by the base parameters there, float64[R, B].
    """

    def __init__(self, problem: AxisProblem, fitted: Fitted, base_columns: F64) -> None:
        self._problem = problem
        self._settings = fitted.model.settings(problem.axis)
        self._tracks = problem.track(fitted.model)
        period = float(problem.trackers[0].time[1])
        self._accelerations = [np.gradient(t.v, period) for t in self._tracks]
        model, residual = fitted.model, fitted.residual
        fewer = [model.without(term) for term in range(len(model.terms))]
        nuisance = [base_columns]
        nuisance += [(r - residual)[:, None] for r in problem.residuals_or_worst(fewer)]
        held = np.diag(_PRIOR_STIFFNESS / problem.spread)
        super().__init__(
            Linearised(
                problem.axis,
                model,
                residual,
                np.sqrt(problem.weights(residual)),
                np.hstack(nuisance),
                np.hstack([held, np.zeros((len(held), len(model.terms)))]),
                _PRIOR_STIFFNESS * model.base / problem.spread,
                (
                    min(float(t.x.min()) for t in self._tracks),
                    max(float(t.x.max()) for t in self._tracks),
                ),
                self._frequencies,
                problem.residuals,
                lambda there: problem.cost(model, there),
                self._signature,
            )
        )

    def follow(self, effect: Effect) -> list[Candidate]:
        """Candidates for an effect that scales Coulomb friction, by the level that was tracked.

        The innovations hardly show it, because the filter follows the level. But a level that has
        the course of the effect is more likely to be the effect than wander of the size that the
        machine file's `repeatability` allows.
        """
        axis = self._problem.axis
        if axis.wander <= 0.0:
            return []
        motion, level = list(self._motion()), np.concatenate([t.level for t in self._tracks])
        best: tuple[float, float, Term] | None = None
        for values in self.nodes(effect):
            term = Term(effect, values)
            course = level_course(self._settings, term, motion)
            if course is None:
                return []
            along, square = float(course @ level), float(course @ course)
            if along > 0.0 and (best is None or along**2 / square > best[0]):
                best = (along**2 / square, along / square, term)
        if best is None:
            return []
        energy, size, node = best
        apart = 2.0 * axis.correlation_time / float(self._problem.trackers[0].time[1])
        term, _ = self.scaled(effect, node.values, size)
        signature = self._signature(term)
        if signature is None:
            return []
        gain = energy / (apart * axis.wander**2)
        return [Candidate(term, gain, self.left_over(signature), node.values, True)]

    def _motion(self) -> zip[tuple[Track, tuple[F64, float], F64]]:
        """Track, times with the start [s], and accelerations [m/s^2] of each recording."""
        times = [(tracker.time, tracker.start) for tracker in self._problem.trackers]
        return zip(self._tracks, times, self._accelerations, strict=True)

    def _signature(self, term: Term) -> F64 | None:
        """Change of the residual when a term is added, float64[R], to first order."""
        parts: list[F64] = []
        forces: list[F64] = []
        for (track, (time, start), acceleration), gains, mask in zip(
            self._motion(), self._problem.gains, self._problem.masks, strict=True
        ):
            there = effect_inputs(self._settings, term, track, time, acceleration, start)
            if there is None:
                return None
            parts.append(-first_order_signature(there, gains)[mask])
            forces.append(np.zeros(int(mask.sum())))
        return np.concatenate((*parts, *forces))

    def _frequencies(self, effect: Effect, parameter: Parameter) -> list[float] | None:
        """Frequencies of the highest peaks of the innovations' spectrum [Hz], for a vibration."""
        axis = self._problem.axis
        if not typical(effect, axis).ports(axis).harmonics:
            return None
        low, high = parameter.ranges(axis)[0]
        track, time = self._tracks[0], self._problem.trackers[0].time
        values = np.where(track.valid, np.clip(track.position, -20.0, 20.0), 0.0)
        count = 4 * len(values)
        power = np.abs(np.fft.rfft(values, count)) ** 2
        frequency = np.fft.rfftfreq(count, float(time[1]))
        remaining = np.where((frequency > _LOWER * low) & (frequency < _HIGHER * high), power, 0.0)
        frequencies: list[float] = []
        while len(frequencies) < _PEAKS and remaining.max() > 0.0:
            line = int(remaining.argmax())
            frequencies.append(summit(power, line) * float(frequency[1]))
            remaining[np.abs(frequency - frequency[line]) < 2.0 / float(time[-1])] = 0.0
        return frequencies


def summit(power: F64, line: int) -> float:
    """Where a peak of a spectrum has its top, in lines: that of a parabola through three lines.

    Over a recording, half a line off turns a wave by as much as a fit still recovers from.
    """
    if not 0 < line < len(power) - 1:
        return float(line)
    before, top, after = power[line - 1 : line + 2]
    bend = before - 2.0 * top + after
    # At the edge of a band the highest line need not be a peak: its parabola has its top elsewhere.
    off = float(0.5 * (before - after) / bend) if bend < 0.0 else 0.0
    return line + min(max(off, -0.5), 0.5)
