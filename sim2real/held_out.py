"""How far models close the gap, also on moves that took no part in their fit.

`axis_gap` is the free-run gap of one axis under a model. `predict_held_out` runs what was fitted on
moves that the fit did not see, and `share_closed` says how much of the gap it closes there, with an
interval by bootstrap over moves.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import count

import numpy as np
from numpy.typing import NDArray

from hil_sim.settings import StageSettings
from sim2real.fitting import AxisModel, AxisProblem, compose_stage, fit
from sim2real.gap import NO_GAP_BELOW, Measured, Signals, rms, subtract_signals
from sim2real.phases import split_moves
from stagedata import F64, BoolArray

Share = tuple[float, tuple[float, float]]
"""A share of the gap, and its 95 % interval."""
Models = Mapping[str, AxisModel]
"""Axis -> its model."""
FittedAxis = tuple[AxisProblem, AxisModel, Sequence[AxisModel]]
"""One axis, the model fitted to it, and for each fold the model already fitted to the moves of all
others; without these, they are fitted."""

FLOOR_LEVEL = 2.0
"""Squared gap over floor of an axis that is explained: one for each signal."""
FOLDS = 2
"""Parts that the moves are divided into; each is predicted by a fit to the others."""
_DRAWS = 400
"""Bootstrap draws of whole moves."""
_SEED = 7


def axis_gap(
    name: str,
    models: Mapping[str, AxisModel],
    measured: Sequence[Measured],
    settings: StageSettings,
) -> float:
    """Squared gap over floor of one axis, summed over its signals, averaged over recordings.

    Args:
        name: of the axis.
        models: axis -> its model; axes without one are as the machine file says.
        measured: recordings, with their floors.
        settings: of the machine file.
    """
    stage = compose_stage(settings, models)
    total = samples = 0.0
    for m in measured:
        recorded, simulated = m.replay.measured()[name], m.replay.run_axis(stage, name)
        valid = m.replay.valid(name)
        number = float(valid.sum())
        total += number * sum(
            (rms(values - simulated[signal], valid) / max(m.floor.rms[name][signal], 1e-12)) ** 2
            for signal, values in recorded.items()
        )
        samples += number
    return total / samples


def combined_energy(energies: F64, samples: F64) -> float:
    """G^2: mean square over floor, summed over signals.

    Args:
        energies: of the moves, float64[moves, signals].
        samples: of the moves, float64[moves, signals].
    """
    return float((energies.sum(axis=0) / samples.sum(axis=0)).sum())


def share_closed(before: F64, after: F64, samples: F64) -> Share | tuple[None, None]:
    """Gap closed, at most 1, and its 95 % interval; None where the gap is too small.

    Args:
        before: energies of the moves by the machine file, float64[moves, signals].
        after: by the final model.
        samples: of the moves, float64[moves, signals].
    """
    signals = before.shape[1]

    def share(rows: NDArray[np.int64]) -> float:
        g0 = combined_energy(before[rows], samples[rows])
        g1 = combined_energy(after[rows], samples[rows])
        return min(1.0, float(1.0 - (g1 - signals) / max(g0 - signals, 1e-9)))

    if combined_energy(before, samples) < NO_GAP_BELOW * signals:
        return None, None
    return _with_interval(share, len(before))


def share_given_back(before: F64, without: F64, after: F64, samples: F64) -> Share:
    """Share of the gap that reopens when an effect is removed, and its 95 % interval.

    Of effects that compensate each other, one alone may leave a wider gap than the machine file.
    The share is then relative to that wider gap.

    Args:
        before: energies of the moves by the machine file, float64[moves, signals].
        without: by the final model without the effect.
        after: by the final model.
        samples: of the moves, float64[moves, signals].
    """
    signals = before.shape[1]

    def share(rows: NDArray[np.int64]) -> float:
        opened = combined_energy(without[rows], samples[rows])
        widest = max(opened, combined_energy(before[rows], samples[rows]))
        remaining = combined_energy(after[rows], samples[rows])
        return float((opened - remaining) / max(widest - min(remaining, signals), 1e-9))

    return _with_interval(share, len(before))


def _with_interval(share: Callable[[NDArray[np.int64]], float], moves: int) -> Share:
    """A share computed from all moves, and its interval from draws of them."""
    rng = np.random.default_rng(_SEED)
    draws = [share(rng.integers(0, moves, moves)) for _ in range(_DRAWS)]
    low, high = np.quantile(draws, (0.025, 0.975))
    return share(np.arange(moves)), (float(low), float(high))


@dataclass(frozen=True, slots=True, eq=False)
class Remaining:
    """What models leave of the recordings.

    Attributes:
        energies: squared residuals over squared floors of each move, float64[moves, signals].
        rms: axis -> signal -> rms over all moves, in the signal's unit.
    """

    energies: F64
    rms: Mapping[str, Mapping[str, float]]


@dataclass(frozen=True, slots=True, eq=False)
class HeldOut:
    """What the models of a diagnosis leave on moves predicted by a fit to the others.

    Attributes:
        samples: valid samples of each move, float64[moves, signals].
        before: energies by the machine file, float64[moves, signals].
        folds: the models fitted to all moves but a fold's, for each fold.
        leaves: what models leave, the moves of each of any number of folds by its models.
        after: what `folds` leave.
        without: (axis, index of effect) -> as `after`, with that effect removed.
        columns: axis -> columns of the energies that shares of its effects refer to.
        explained: signals predicted by the fits, one entry per recording.
        fitted: energies by the fit to all moves, float64[moves, signals]; None where not computed.
    """

    samples: F64
    before: F64
    folds: Sequence[Models]
    leaves: Callable[[Sequence[Models]], Remaining]
    after: Remaining
    without: Mapping[tuple[str, int], Remaining]
    columns: Mapping[str, slice]
    explained: tuple[Signals, ...]
    fitted: F64 | None = None

    def given_back(self, axis: str, index: int) -> Share:
        """`share_given_back` of an effect of an axis' model."""
        without = self.without[axis, index].energies
        parts = (self.before, without, self.after.energies, self.samples)
        before, without, after, samples = (part[:, self.columns[axis]] for part in parts)
        return share_given_back(before, without, after, samples)


def predict_held_out(
    measured: Sequence[Measured],
    settings: StageSettings,
    fitted: Mapping[str, FittedAxis],
    pool: ThreadPoolExecutor,
    progress: Callable[[int, int], object],
) -> HeldOut:
    """Predict each move by a fit to the others, in the closed loop.

    Args:
        measured: the recordings.
        settings: of the machine file.
        fitted: axis -> what was fitted.
        pool: threads for the axes.
        progress: called with (fits done, all fits).
    """
    recorded = _Recorded(measured, settings)
    held = recorded.moves_of(FOLDS)
    fits = FOLDS * len(fitted)
    progress(0, fits)
    numbers = count(1)  # from any thread

    def refit(name: str) -> list[AxisModel]:
        whole, best, known = fitted[name]
        if known:
            return list(known)
        models, columns = [], whole.base_columns(best, whole.residual(best))
        for masks in held:
            others = [_to_periods(~mask, m) for mask, m in zip(masks, measured, strict=True)]
            kept = np.concatenate([o[own] for o, own in zip(others, whole.masks, strict=True)])
            own_columns = columns[np.tile(kept, 2)]  # positions, then forces
            models.append(fit(whole.masked(others), best, 1, own_columns, thorough=False).model)
            progress(next(numbers), fits)
        return models

    by_axis = dict(zip(fitted, pool.map(refit, fitted), strict=True))
    folds = [{name: models[fold] for name, models in by_axis.items()} for fold in range(FOLDS)]
    best = {name: model for name, (_, model, _) in fitted.items()}
    after = recorded.compose(folds)
    without = {
        (name, index): recorded.compose(
            [{**models, name: models[name].without(index)} for models in folds]
        )
        for name, model in best.items()
        for index in range(len(model.terms))
    }
    return HeldOut(
        recorded.samples(),
        recorded.energies([m.residual for m in measured]),
        folds,
        lambda models: recorded.remaining(recorded.compose(models)),
        recorded.remaining(after),
        {key: recorded.remaining(residuals) for key, residuals in without.items()},
        dict.fromkeys(fitted, slice(None)),
        tuple(
            subtract_signals(m.replay.measured(), residual)
            for m, residual in zip(measured, after, strict=True)
        ),
        recorded.energies([recorded.residual(best, m) for m in measured]),
    )


class _Recorded:
    """Recordings with their moves, and what models of all axes leave of them in the free run."""

    def __init__(self, measured: Sequence[Measured], settings: StageSettings) -> None:
        self._measured = measured
        self._settings = settings
        self._moves = [split_moves(m.replay.recording, m.replay.period) for m in measured]

    def moves_of(self, folds: int) -> list[list[BoolArray]]:
        """Samples of each fold's moves, per recording; moves are assigned in pairs."""
        held = []
        for fold in range(folds):
            masks = []
            for m, moves in zip(self._measured, self._moves, strict=True):
                mask = np.zeros(len(m.replay.recording), dtype=np.bool_)
                for block in moves:
                    if (block.number // 2) % folds == fold:
                        mask[block.start : block.stop] = True
                masks.append(mask)
            held.append(masks)
        return held

    def residual(self, models: Mapping[str, AxisModel], measured: Measured) -> Signals:
        """Recorded minus simulated."""
        stage = compose_stage(self._settings, models)
        return subtract_signals(measured.replay.measured(), measured.replay.run(stage))

    def compose(self, folds: Sequence[Models]) -> list[Signals]:
        """Residuals of each recording, each sample by the models of the fold that it is held in."""
        out, held = [], self.moves_of(len(folds))
        for number, m in enumerate(self._measured):
            whole, *others = (self.residual(models, m) for models in folds)
            for fold, part in enumerate(others, 1):
                mask = held[fold][number]
                for axis, signals in whole.items():
                    for signal, values in signals.items():
                        values[mask] = part[axis][signal][mask]
            out.append(whole)
        return out

    def remaining(self, residuals: Sequence[Signals]) -> Remaining:
        """Energies and rms of residuals, one entry per recording."""
        rms_of = {}
        for axis, signals in residuals[0].items():
            valid = [m.replay.valid(axis) for m in self._measured]
            number = sum(float(mask.sum()) for mask in valid)
            rms_of[axis] = {
                signal: math.sqrt(
                    sum(
                        float(np.square(each[axis][signal][mask]).sum())
                        for each, mask in zip(residuals, valid, strict=True)
                    )
                    / number
                )
                for signal in signals
            }
        return Remaining(self.energies(residuals), rms_of)

    def energies(self, residuals: Sequence[Signals]) -> F64:
        """Squared residuals over squared floors, summed over each move, float64[moves, signals]."""
        rows = []
        for m, moves, residual in zip(self._measured, self._moves, residuals, strict=True):
            for block in moves:
                row = []
                for axis, signals in residual.items():
                    valid = m.replay.valid(axis)[block.start : block.stop]
                    for signal, values in signals.items():
                        cut = values[block.start : block.stop][valid]
                        floor = max(m.floor.rms[axis][signal], 1e-12)
                        row.append(float(cut @ cut) / floor**2)
                rows.append(row)
        return np.array(rows)

    def samples(self) -> F64:
        """Valid samples of each move, float64[moves, signals]."""
        return np.array(
            [
                [
                    float(m.replay.valid(axis)[block.start : block.stop].sum())
                    for axis, signals in m.residual.items()
                    for _ in signals
                ]
                for m, moves in zip(self._measured, self._moves, strict=True)
                for block in moves
            ]
        )


def _to_periods(mask: BoolArray, measured: Measured) -> BoolArray:
    """A mask over samples as one over SYNC periods."""
    out = np.zeros(len(measured.replay.demand), dtype=np.bool_)
    out[measured.replay.place] = mask
    return out
