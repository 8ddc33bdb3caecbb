"""Which effects cause the gap, how surely, and how far it shrinks once they are added.

The search runs on tracked innovations (`sim2real.tracking`), where the friction's wander is
filtered out; what it finds is then judged by what the reader cares for, the free closed-loop gap,
on moves that took no part in fitting.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from hil_sim.effects.effect import Effect
from hil_sim.settings import AxisSettings, StageSettings
from sim2real.axis_model import (
    BASE,
    AxisModel,
    Coordinate,
    coordinates,
    parameters,
    with_base,
)
from sim2real.examine import Examination, without_causes
from sim2real.fit import AxisProblem, fit
from sim2real.gap import NO_GAP_BELOW, Measured
from sim2real.gate import gate
from sim2real.phases import blocks
from sim2real.recording import BoolArray
from sim2real.replay import Signals, residual
from sim2real.report import (
    EXPLAINED,
    NO_GAP,
    PARTLY_EXPLAINED,
    UNEXPLAINED,
    Candidate,
    Cause,
    Confusable,
    GapFigures,
    GapReport,
    Parameter,
)
from sim2real.search import AxisSearch, search
from sim2real.tracking import Tracker

F64 = NDArray[np.float64]

_FOLDS = 2
"""Parts the moves are dealt into; each is predicted by a fit to the others."""
_DRAWS = 400
"""Bootstrap draws of whole moves for intervals."""
_SEED = 7
_TEMPER = 40.0
"""The log likelihood counts for so much less than it says: innovations of the true model are white,
those of a model that is right but for details are not. From the blind trials (docs/blind.md)."""
_ENOUGH = 0.9
"""Gap closed from which a gap counts as explained."""
_SCATTER, _LIKENESS, _WANDERS, _STEP = 1.5, 0.003, 0.25, 0.05
"""What a fit's own sigma leaves out: see `_sigma`. From the blind trials (docs/blind.md)."""
_STEEP = 1.6
"""How fast trust in a name falls with the share of the gap that is left."""
_SHOWN = 8
"""Candidates shown per axis."""
_ALIKE = 0.95
"""Cosine of two signatures from which effects are called confusable where both fit."""

Progress = Callable[[str, int, int], object]


@dataclass(frozen=True, slots=True, eq=False)
class Diagnosis:
    """A diagnosis and what it rests on.

    Attributes:
        report: what it says.
        models: axis -> base parameters and effects, fitted to all moves.
        searches: axis -> the search.
        explained: signals of the model with the causes found, each move by a fit to other moves,
            one entry per recording; empty where no cause was found.
        plant: axis -> figure -> value moved within tolerance, for the twin.
    """

    report: GapReport
    models: Mapping[str, AxisModel]
    searches: Mapping[str, AxisSearch]
    explained: tuple[Signals, ...] = ()
    plant: Mapping[str, Mapping[str, float]] = field(default_factory=dict)


def diagnose(
    examined: Examination,
    tolerance: Mapping[str, float],
    library: Mapping[str, Effect],
    *,
    jobs: int = 2,
    progress: Progress = lambda *_: None,
) -> Diagnosis:
    """The whole diagnosis of examined recordings.

    Args:
        examined: channels, floor, gap and where.
        tolerance: axis -> relative standard deviation of the plant's figures.
        library: effects to consider, those that are searched for.
        jobs: axes searched at the same time.
        progress: called with what is being done, steps done, all steps.
    """
    plain = without_causes(examined)
    if examined.insufficient is not None or examined.gap is None:
        return Diagnosis(plain, {}, {})
    settings = examined.settings
    names = [axis.name for axis in settings.axes]
    shares = dict.fromkeys(names, 0.0)

    def searched(name: str) -> AxisSearch:
        problem = AxisProblem(
            [Tracker(m.replay, settings, name) for m in examined.measured],
            max(tolerance.get(name, 0.0), 1e-4),
        )

        def told(share: float) -> None:
            shares[name] = share
            progress("effects", round(100 * sum(shares.values())), 100 * len(names))

        return search(problem, library, told)

    library = {name: effect for name, effect in library.items() if effect.searched}
    with ThreadPoolExecutor(max_workers=max(1, jobs)) as pool:
        searches = dict(zip(names, pool.map(searched, names), strict=True))
        progress("held-out moves", 0, _FOLDS)
        gate(searches, examined.measured, settings)
        held_out = _HeldOut(examined.measured, settings, searches, pool)
    return _concluded(examined, plain, searches, held_out, settings)


class _HeldOut:
    """Free closed-loop residuals on moves that a fit to the other moves predicts.

    Attributes:
        before, after: recorded minus simulated, by the machine file and by the fits.
        fitted: the same by the fit to all moves.
        without: (axis, index of effect) -> as `after`, that effect left out.
    """

    def __init__(
        self,
        measured: Sequence[Measured],
        settings: StageSettings,
        searches: Mapping[str, AxisSearch],
        pool: ThreadPoolExecutor,
    ) -> None:
        self.measured = measured
        self._settings = settings
        self.moves = [blocks(m.replay.recording, m.replay.period) for m in measured]
        best = {name: found.best.model for name, found in searches.items()}
        folds = [self._masks(fold) for fold in range(_FOLDS)]

        def refitted(name: str) -> list[AxisModel]:
            found = searches[name]
            out = []
            for held in folds:
                masks = [_to_periods(~mask, m) for mask, m in zip(held, measured, strict=True)]
                problem = found.problem.masked(masks)
                out.append(fit(problem, found.best.model, 1, thorough=False).model)
            return out

        by_axis = dict(zip(searches, pool.map(refitted, searches), strict=True))
        each = [{name: by_axis[name][fold] for name in by_axis} for fold in range(_FOLDS)]
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
        """Samples of the moves held out, per recording; moves are dealt in pairs."""
        masks = []
        for m, moves in zip(self.measured, self.moves, strict=True):
            mask = np.zeros(len(m.replay.recording), dtype=np.bool_)
            for block in moves:
                if (block.number // 2) % _FOLDS == fold:
                    mask[block.start : block.stop] = True
            masks.append(mask)
        return masks

    def _simulated(self, models: Mapping[str, AxisModel], measured: Measured) -> Signals:
        stage = replace(
            self._settings,
            axes=tuple(models[a.name].settings(a) for a in self._settings.axes),
        )
        return residual(measured.replay.measured(), measured.replay.run(stage))

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
        """Signals of the fits to other moves, one entry per recording."""
        return tuple(
            residual(m.replay.measured(), left)
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


def _concluded(
    examined: Examination,
    plain: GapReport,
    searches: Mapping[str, AxisSearch],
    held_out: _HeldOut,
    settings: StageSettings,
) -> Diagnosis:
    """Verdict, causes and figures."""
    samples = held_out.samples()
    before = held_out.energies(held_out.before)
    after = held_out.energies(held_out.after)
    signals = before.shape[1]
    total = _combined(before, samples)
    share, interval = _closed(before, after, samples)
    in_sample, _ = _closed(before, held_out.energies(held_out.fitted), samples)
    causes, candidates, confusable = [], [], []
    whole = True
    for name, found in searches.items():
        own, alike = _causes(name, found, held_out, before, after, samples)
        causes += own
        confusable += alike
        candidates += _candidates(name, found, own)
        whole &= found.whole
    causes.sort(key=lambda cause: -(cause.gap_closed or 0.0))
    models = {name: found.best.model for name, found in searches.items()}
    confident = [cause for cause in causes if cause.probability > 0.5]
    remaining = _combined(after, samples) / signals
    if not confident:
        small = remaining < (_SMALL if whole else _SMALLER)
        verdict = NO_GAP if small else UNEXPLAINED
        causes = [] if small else causes
    elif whole and share is not None and share >= _ENOUGH:
        verdict = EXPLAINED
    else:
        verdict = PARTLY_EXPLAINED
    reason = _reason(verdict, confident, share, total / signals, whole)
    report = replace(
        plain,
        verdict=verdict,
        reason=reason,
        gap=_figures(examined, held_out, bool(confident)),
        gap_closed=share if confident else None,
        gap_closed_interval=interval if confident else None,
        gap_closed_in_sample=in_sample if confident else None,
        causes=tuple(confident),
        candidates=tuple(candidates),
        confusable=tuple(confusable),
    )
    if not confident:
        return Diagnosis(report, models, searches)
    return Diagnosis(report, models, searches, held_out.explained(), _plant(settings, models))


def _plant(settings: StageSettings, models: Mapping[str, AxisModel]) -> dict[str, dict[str, float]]:
    """Plant figures of the fitted models, axis -> figure -> value."""
    out = {}
    for axis in settings.axes:
        moved = with_base(axis, models[axis.name].base)
        out[axis.name] = {
            name: float(moved.mass if name == "mass" else getattr(moved.friction, name))
            for name in BASE
        }
    return out


_SMALL, _SMALLER = 3.0, 2.0
"""Combined gap over floor, squared, of what base parameters leave, up to which there is no gap:
where the innovations are white, and where they are not quite."""


def _combined(energies: F64, samples: F64) -> float:
    """G^2: mean square over floor, summed over signals."""
    return float((energies.sum(axis=0) / samples.sum(axis=0)).sum())


def _closed(
    before: F64, after: F64, samples: F64
) -> tuple[float | None, tuple[float, float] | None]:
    """Gap closed and its 95 % interval by bootstrap over moves."""
    signals = before.shape[1]

    def share(rows: NDArray[np.int64]) -> float:
        g0 = _combined(before[rows], samples[rows])
        g1 = _combined(after[rows], samples[rows])
        return float(1.0 - (g1 - signals) / max(g0 - signals, 1e-9))

    everything = np.arange(len(before))
    if _combined(before, samples) < NO_GAP_BELOW * signals:
        return None, None
    rng = np.random.default_rng(_SEED)
    draws = [share(rng.integers(0, len(before), len(before))) for _ in range(_DRAWS)]
    low, high = np.quantile(draws, (0.025, 0.975))
    return share(everything), (float(low), float(high))


def _causes(
    name: str,
    found: AxisSearch,
    held_out: _HeldOut,
    before: F64,
    after: F64,
    samples: F64,
) -> tuple[list[Cause], list[Confusable]]:
    problem, best = found.problem, found.best
    causes, alike = [], []
    at = len(BASE)
    signals = before.shape[1]
    g0 = _combined(before, samples)
    for index, term in enumerate(best.model.terms):
        entries = coordinates(term.effect, problem.axis)
        spread = (
            np.full(len(entries), np.nan)
            if best.covariance is None
            else np.sqrt(np.diag(best.covariance))[at : at + len(entries)]
        )
        at += len(entries)
        left_out = held_out.energies(held_out.without[name, index])
        gives_back = (_combined(left_out, samples) - _combined(after, samples)) / max(
            g0 - signals, 1e-9
        )
        rng = np.random.default_rng(_SEED)
        draws = []
        for _ in range(_DRAWS):
            rows = rng.integers(0, len(before), len(before))
            base = max(_combined(before[rows], samples[rows]) - signals, 1e-9)
            draws.append(
                (_combined(left_out[rows], samples[rows]) - _combined(after[rows], samples[rows]))
                / base
            )
        low, high = np.quantile(draws, (0.025, 0.975))
        probability, rivals = _probability(found, term.name)
        values = parameters(term)
        causes.append(
            Cause(
                name,
                term.name,
                probability,
                {
                    entry.parameter.key: Parameter(
                        values[entry.parameter.key],
                        _sigma(
                            term.effect, entry, values[entry.parameter.key], float(s), problem.axis
                        ),
                        entry.parameter.unit,
                    )
                    for entry, s in zip(entries, spread, strict=True)
                },
                gives_back,
                (float(low), float(high)),
                term.effect.remedy,
            )
        )
        if rivals:
            alike.append(
                Confusable(
                    name,
                    (term.name, *rivals),
                    "on these moves either fits nearly as well in the other's place",
                )
            )
    return causes, alike


def _sigma(
    effect: Effect, entry: Coordinate, value: float, fitted: float, axis: AxisSettings
) -> float:
    """One sigma of a parameter: of the fit, of the models' likeness, and of the friction's wander.

    Trials on simulated stages scatter half as much again as the fit says; sizes are known to a few
    parts in a thousand at best, what scales Coulomb friction to a quarter of its wander, and
    delays to a twentieth of the control period, by which integrators differ.
    """
    own = _SCATTER * fitted * abs(entry.slope(value))
    parameter = entry.parameter
    neutral = parameter.neutral_on(axis)
    if parameter.role != "size" or neutral is None or not math.isfinite(neutral):
        return own
    wander = _WANDERS * axis.friction.wander if effect.group == "friction" else 0.0
    step = _STEP * axis.control.period if parameter.unit == "s" else 0.0
    return math.hypot(own, _LIKENESS * abs(value - neutral), wander, step)


def _probability(found: AxisSearch, effect: str) -> tuple[float, list[str]]:
    """Probability that an effect is present, and the effects that could stand in its place."""
    problem = found.problem
    best = found.best
    names = best.model.names()
    rest = tuple(sorted(n for n in names if n != effect))
    cost = problem.cost(best.model, best.residual)
    weight, rivals = 0.0, []
    for rival in found.rivals:
        others = tuple(sorted(rival.model.names()))
        if effect in others:
            continue
        worse = problem.cost(rival.model, problem.residual(rival.model)) - cost
        odds = math.exp(-max(worse, 0.0) / (2.0 * _TEMPER))
        weight += odds
        swapped = [n for n in others if n not in rest]
        if odds > 0.05 and len(others) == len(names) and len(swapped) == 1:
            rivals.append(swapped[0])
    told = 1.0 / (1.0 + weight)
    return told * _trust(found), rivals


def _trust(found: AxisSearch) -> float:
    """How far a name can be trusted: nearly whole, or as much of the gap as it closes tells.

    An effect of the right family in another shape closes most of the gap, a stranger's nearest kin
    less (docs/blind.md).
    """
    if found.whole:
        return 0.99
    return float(np.clip(_STEEP * found.closes + 1.0 - _STEEP, 0.05, 0.95))


def _candidates(name: str, found: AxisSearch, causes: Sequence[Cause]) -> list[Candidate]:
    probabilities = {cause.effect: cause.probability for cause in causes}
    ranked = sorted(found.scanned.items(), key=lambda item: -item[1])[:_SHOWN]
    left = max(0.0, 1.0 - sum(probabilities.values()))
    total = sum(math.log1p(max(gain, 0.0)) for n, gain in ranked if n not in probabilities) + 1e-9
    return [
        Candidate(
            name,
            effect,
            probabilities.get(effect, left * 0.1 * math.log1p(max(gain, 0.0)) / total),
            None,
        )
        for effect, gain in ranked
    ]


def _figures(
    examined: Examination, held_out: _HeldOut, explained: bool
) -> Mapping[str, Mapping[str, GapFigures]]:
    gap = examined.gap or {}
    if not explained:
        return gap
    out: dict[str, dict[str, GapFigures]] = {}
    for axis, signals in gap.items():
        out[axis] = {}
        for signal, figures in signals.items():
            energy = count = 0.0
            for m, left in zip(held_out.measured, held_out.after, strict=True):
                valid = m.replay.valid(axis)
                energy += float(np.square(left[axis][signal][valid]).sum())
                count += float(valid.sum())
            out[axis][signal] = replace(figures, explained=math.sqrt(energy / count))
    return out


def _reason(
    verdict: str, causes: Sequence[Cause], share: float | None, gap: float, whole: bool
) -> str:
    size = f"the combined gap is {math.sqrt(gap):.3g} times the floor"
    if verdict == NO_GAP:
        return f"{size}: no more than the machine file's tolerance and repeatability give"
    if verdict == UNEXPLAINED:
        return f"{size}, and no effect of the library explains it"
    named = ", ".join(f"{cause.effect} on {cause.axis}" for cause in causes)
    closed = "" if share is None else f" closes {100 * share:.0f} % of it on held-out moves"
    rest = "" if whole else "; what is left still has structure"
    return f"{size}; {named}{closed}{rest}"
