"""Free-run residuals on moves that took no part in a fit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import count
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from hil_sim.settings import StageSettings
from sim2real.fitting import AxisModel, AxisProblem, Fitted, compose_stage, fit
from sim2real.gap import Measured, Signals, subtract_signals
from sim2real.phases import split_moves
from stagedata import BoolArray

F64 = NDArray[np.float64]

FOLDS = 2
"""Parts that the moves are divided into; each is predicted by a fit to the others."""


class FittedAxis(Protocol):
    """One axis and the model that was fitted to it."""

    @property
    def problem(self) -> AxisProblem:
        """Recordings and cost of the axis."""

    @property
    def best(self) -> Fitted:
        """The fitted model."""

    def fold_models(self) -> Sequence[AxisModel]:
        """For each fold, the model already fitted to the moves of all others; empty if none is."""


class HeldOut:
    """Free-run residuals on moves predicted by a fit to the other moves.

    Attributes:
        before, after: recorded minus simulated, by the machine file and by the fits.
        fitted: the same by the fit to all moves.
        without: (axis, index of effect) -> as `after`, with that effect removed.
    """

    def __init__(
        self,
        measured: Sequence[Measured],
        settings: StageSettings,
        searches: Mapping[str, FittedAxis],
        pool: ThreadPoolExecutor,
        progress: Callable[[int, int], object] = lambda *_: None,
    ) -> None:
        self.measured = measured
        self._settings = settings
        self.moves = [split_moves(m.replay.recording, m.replay.period) for m in measured]
        best = {name: found.best.model for name, found in searches.items()}
        folds = [self._masks(fold) for fold in range(FOLDS)]
        fits = FOLDS * len(searches)
        progress(0, fits)
        numbers = count(1)  # from any thread

        def refitted(name: str) -> list[AxisModel]:
            found = searches[name]
            if known := list(found.fold_models()):
                return known
            out = []
            for held in folds:
                masks = [_to_periods(~mask, m) for mask, m in zip(held, measured, strict=True)]
                problem = found.problem.masked(masks)
                model = fit(problem, found.best.model, 1, thorough=False).model
                out.append(model)
                progress(next(numbers), fits)
            return out

        by_axis = dict(zip(searches, pool.map(refitted, searches), strict=True))
        each = [{name: by_axis[name][fold] for name in by_axis} for fold in range(FOLDS)]
        self.before = [m.residual for m in measured]
        self.after = self._composed(each, folds)
        self.fitted = [self._simulated(best, m) for m in measured]
        self.without = {
            (name, index): self._composed(
                [{**models, name: models[name].without(index)} for models in each], folds
            )
            for name, model in best.items()
            for index in range(len(model.terms))
        }

    def _masks(self, fold: int) -> list[BoolArray]:
        """Samples of the held-out moves, per recording; moves are assigned in pairs."""
        masks = []
        for m, moves in zip(self.measured, self.moves, strict=True):
            mask = np.zeros(len(m.replay.recording), dtype=np.bool_)
            for block in moves:
                if (block.number // 2) % FOLDS == fold:
                    mask[block.start : block.stop] = True
            masks.append(mask)
        return masks

    def _simulated(self, models: Mapping[str, AxisModel], measured: Measured) -> Signals:
        stage = compose_stage(self._settings, models)
        return subtract_signals(measured.replay.measured(), measured.replay.run(stage))

    def _composed(
        self, models: Sequence[Mapping[str, AxisModel]], folds: Sequence[Sequence[BoolArray]]
    ) -> list[Signals]:
        out = []
        for number, m in enumerate(self.measured):
            parts = [self._simulated(each, m) for each in models]
            whole = {
                axis: {signal: values.copy() for signal, values in signals.items()}
                for axis, signals in parts[0].items()
            }
            for fold, part in enumerate(parts):
                mask = folds[fold][number]
                for axis, signals in whole.items():
                    for signal, values in signals.items():
                        values[mask] = part[axis][signal][mask]
            out.append(whole)
        return out

    def explained(self) -> tuple[Signals, ...]:
        """Signals predicted by the fits to other moves, one entry per recording."""
        return tuple(
            subtract_signals(m.replay.measured(), left)
            for m, left in zip(self.measured, self.after, strict=True)
        )

    def energies(self, residuals: Sequence[Signals]) -> F64:
        """Squared residuals over squared floors, summed over each move, float64[moves, signals]."""
        rows = []
        for m, moves, left in zip(self.measured, self.moves, residuals, strict=True):
            for block in moves:
                row = []
                for axis, signals in left.items():
                    valid = m.replay.valid(axis)[block.start : block.stop]
                    for signal, values in signals.items():
                        cut = values[block.start : block.stop][valid]
                        floor = max(m.floor.rms[axis][signal], 1e-12)
                        row.append(float(cut @ cut) / floor**2)
                rows.append(row)
        return np.array(rows)

    def samples(self) -> F64:
        """Valid samples of each move, float64[moves, signals]."""
        rows = []
        for m, moves in zip(self.measured, self.moves, strict=True):
            for block in moves:
                rows.append(
                    [
                        float(m.replay.valid(axis)[block.start : block.stop].sum())
                        for axis, signals in m.residual.items()
                        for _ in signals
                    ]
                )
        return np.array(rows)


def _to_periods(mask: BoolArray, measured: Measured) -> BoolArray:
    """A mask over samples as one over SYNC periods."""
    out = np.zeros(len(measured.replay.demand), dtype=np.bool_)
    out[measured.replay.place] = mask
    return out
