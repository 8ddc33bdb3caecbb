"""The search without a controller: which effects explain the force that the measured motion takes.

For recordings without a demand, machines whose gains nobody knows, and those whose controller is
not that of the machine file. Names and figures come from the search of the free loop, run along the
measured motion (`sim2real.open_loop`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from hil_sim.effects import Effect
from hil_sim.settings import AxisSettings
from sim2real.attribution import AxisResult, find_causes
from sim2real.diagnosis.beside_curve import search_beside
from sim2real.diagnosis.examination import Examination, Progress
from sim2real.findings import FittedFigure, Unlisted
from sim2real.fitting import (
    BASE,
    AxisModel,
    Workers,
    compose_stage,
    plant_figure,
    with_base,
)
from sim2real.free_loop import FreeSearch, fit_figures, move_covariance, refit_without, search_free
from sim2real.held_out import FLOOR_LEVEL, FOLDS, HeldOut, Models, Remaining
from sim2real.open_loop import FIGURES, MotionLoop, compare_along
from sim2real.rivals import Beside, Rivals, Screen, find_rivals
from sim2real.scoring.constants import CLOSED, DOUBTED, ENOUGH, OPEN

_UNKNOWN = 0.19
"""Relative standard deviation of a figure that the machine file leaves unknown, around the value
that least squares find."""
_ANY_MASS, _NEGLIGIBLE = 1.0, 0.1
"""The same of an unknown mass whose inertia is less than this share of the Coulomb force: the
motion hardly shows it."""
_MASS = 0.01
"""Smallest tolerance of the mass. A drive reports the force at one instant, and the force varies
within a SYNC period: on the reference stage by 2.4 % of mass times acceleration."""
_SAME_AS = {
    "mass": ("payload_mass", "force_constant"),
    "coulomb": ("coulomb_level",),
    "viscous": ("viscous_damping",),
    "stiffness": ("presliding_stiffness",),
}
"""Figure -> effects that only change it: they are not searched for where the figure is unknown."""
_BEHIND = ("dead_time", "current_bandwidth")
"""Effects that lie between controller and reported force: they do not show along a motion."""


def search_along_motion(
    examined: Examination,
    tolerance: Mapping[str, float],
    library: Mapping[str, Effect],
    workers: Workers,
    progress: Progress,
) -> tuple[dict[str, AxisResult], HeldOut]:
    """Search all axes along their motion, and predict held-out moves.

    Arguments as `diagnosis.diagnose`; workers: threads for the fits.
    """
    names = list(examined.gap or {})
    searches, loops = {}, {}
    for number, name in enumerate(names):

        def advance(share: float, before: int = number) -> None:
            progress("effects", round(100 * (before + share)), 100 * len(names))

        advance(0.0)
        unknown = examined.unknown.get(name, ())
        loop = MotionLoop(
            name, examined.motions, examined.settings, tolerance.get(name, 0.0), workers
        )
        for at, figure in enumerate(BASE):
            least = _UNKNOWN if figure in unknown else _MASS if figure == "mass" else 1e-4
            if figure == "mass" and figure in unknown and _is_light(examined, loop.axis):
                least = _ANY_MASS
            loop.spread[at] = max(float(loop.spread[at]), least)
        same = {effect for figure in unknown for effect in _SAME_AS.get(figure, ())}
        sought = {
            n: effect
            for n, effect in library.items()
            if effect.searched and n not in same and n not in _BEHIND
        }
        loops[name], searches[name] = loop, search_free(loop, sought, advance)
    progress("effects", 100 * len(names), 100 * len(names))
    results = {name: _result(search, loops[name]) for name, search in searches.items()}
    while True:
        kept = {name: result.free or searches[name] for name, result in results.items()}
        held_out = _hold_out(examined, kept)
        doubtful = {name: find_doubtful(result, held_out) for name, result in results.items()}
        if not any(doubtful.values()):
            return results, held_out
        results = {
            name: _refitted(result, kept[name], effect) if (effect := doubtful[name]) else result
            for name, result in results.items()
        }


def find_doubtful(result: AxisResult, held_out: HeldOut) -> str | None:
    """The effect of an axis that is to leave the model; None where none is.

    Of effects that are doubted, it is that which gives back least of the gap: what is left of the
    others' figures may be no more than its counterpart. Where a curve takes its place, they stay.
    """
    names, free = result.best.model.names(), result.free
    if free is None or free.of_rest or result.unlisted or set(names) <= set(result.doubted):
        return None
    causes, _ = find_causes(result, held_out, along_motion=True)
    doubted = [cause for cause in causes if cause.probability <= DOUBTED]
    if not doubted or len(names) < 2 or free.closed < CLOSED:
        return None
    return min(doubted, key=lambda cause: cause.gap_closed or 0.0).effect


def _refitted(result: AxisResult, search: FreeSearch, effect: str) -> AxisResult:
    """What is found on an axis without an effect."""
    fewer = refit_without(search, effect)
    covariance = move_covariance(fewer.loop, fewer.best)
    return replace(
        result,
        best=replace(fewer.best, covariance=covariance),
        is_complete=fewer.is_near_floor(),
        free=fewer,
        doubted=[name for name in result.doubted if name != effect],
    )


def _is_light(examined: Examination, axis: AxisSettings) -> bool:
    """Whether the inertia of an axis is small beside its friction."""
    moved = [motion.axes[axis.name] for motion in examined.motions]
    rates = np.concatenate([own.acceleration[own.usable] for own in moved])
    inertia = axis.mass * math.sqrt(float(np.mean(rates**2))) if len(rates) else 0.0
    return inertia < _NEGLIGIBLE * axis.friction.coulomb


def _result(search: FreeSearch, loop: MotionLoop) -> AxisResult:
    doubted: Sequence[str] = ()
    unlisted: tuple[Unlisted, ...] = ()
    is_complete = True
    if search.open_gap > OPEN * FLOOR_LEVEL:
        rivals = find_rivals(Screen(loop))
        beside = Beside(rivals)
        search, keeps, plain = named(search, rivals, beside)
        both = None if keeps else _named_beside(search, rivals)
        if both is not None:
            search, doubted, unlisted = both
            is_complete = False
        elif keeps:
            doubted, unlisted = beside.doubts(search.best.model, plain)
        else:
            doubted, unlisted = search.best.model.names(), rivals.unlisted(loop.name)
    best = search.best
    covariance = move_covariance(loop, best)
    return AxisResult(
        axis=loop.axis,
        spread=loop.spread,
        best=replace(best, covariance=covariance),
        open_gap=search.open_gap,
        is_complete=is_complete and search.is_near_floor(),
        free=search,
        unlisted=unlisted,
        doubted=doubted,
    )


def named(
    search: FreeSearch, rivals: Rivals, beside: Beside
) -> tuple[FreeSearch, bool, tuple[str, ...]]:
    """What a search found, up to the last step whose effects keep their names against curves.

    Where all its effects together do not keep them, fewer may that close nearly all of the gap: a
    curve as good as three names may be no better than the first of these. A weight or a constant
    pull that does so by itself is a name in any case. A curve over position contains it, and so
    closes more wherever the force has any other course besides, which is given beside it. So it is
    where further effects do not keep their names beside a curve.

    Returns:
        The search, whether its effects keep their names, and those that no curve can take.
    """
    plain: tuple[str, ...] = ()
    for step in search.steps:
        if step.closed >= ENOUGH and all(term.effect.any_size for term in step.model.terms):
            plain = step.model.names()
    found = search.best.model
    if search.names_causes() and rivals.leave_names([found]):
        if plain in ((), found.names()) or not beside.doubts(found, plain)[0]:
            return search, True, plain
    for number, step in reversed(list(enumerate(search.steps))):
        if step.closed < ENOUGH:
            break
        is_plain = step.model.names() == plain
        if not is_plain and (step is search.steps[-1] or not rivals.leave_names([step.model])):
            continue
        best, folds = fit_figures(search.loop, step.model)
        fewer = replace(search, best=best, folds=folds, steps=search.steps[: number + 1])
        if fewer.names_causes():
            return fewer, True, plain
    return search, False, ()


def _named_beside(
    search: FreeSearch, rivals: Rivals
) -> tuple[FreeSearch, tuple[str, ...], tuple[Unlisted, ...]] | None:
    """Effects of a search that explain an axis together with a curve, as `search_beside`."""
    loop = rivals.screen.loop
    for step in reversed(search.steps):
        curve = Beside(rivals).complement(step.model)
        if curve is None:
            continue
        known = rivals.screen.forces(curve)
        beside = MotionLoop(loop.name, loop.motions, loop.settings, 0.0, loop.workers, known)
        beside.spread = loop.spread
        sought = {term.name: term.effect for term in step.model.terms}
        found = search_beside(beside, rivals, curve, sought, len(sought))
        if found is not None:
            free, doubted, unlisted = found
            return replace(free, loop=loop), doubted, unlisted
    return None


def _hold_out(examined: Examination, searches: Mapping[str, FreeSearch]) -> HeldOut:
    """What the models leave of the moves, each by the fit that did not see it."""
    # `MotionLoop` counts the force twice, in place of the position: half of that energy is real.
    loops = {name: search.loop for name, search in searches.items()}
    before = [loop.energies(loop.residual(loop.start)) / 2.0 for loop in loops.values()]

    def leaves(folds: Sequence[Models]) -> Remaining:
        energies, rms = [], {}
        for name, loop in loops.items():
            residuals = [loop.residual(models.get(name, loop.start)) for models in folds]
            energies.append(loop.held_out(residuals) / 2.0)
            floors = math.sqrt(float(energies[-1].sum() / loop.samples.sum()))
            rms[name] = {"force": floors * (examined.gap or {})[name]["force"].floor}
        return Remaining(np.column_stack(energies), rms)

    folds = [
        {name: search.folds[fold].model for name, search in searches.items()}
        for fold in range(FOLDS)
    ]
    without = {
        (name, index): leaves(
            [{**models, name: _without(models[name], effect)} for models in folds]
        )
        for name, search in searches.items()
        for index, effect in enumerate(search.best.model.names())
    }
    models = {name: search.best.model for name, search in searches.items()}
    stage = compose_stage(examined.settings, models)
    return HeldOut(
        np.column_stack([loop.samples for loop in loops.values()]),
        np.column_stack(before),
        folds,
        leaves,
        leaves(folds),
        without,
        {name: slice(at, at + 1) for at, name in enumerate(searches)},
        tuple(compare_along(motion, stage).floor.nominal for motion in examined.motions),
    )


def _without(model: AxisModel, name: str) -> AxisModel:
    names = model.names()
    return model.without(names.index(name)) if name in names else model


def fitted_figures(
    examined: Examination, results: Mapping[str, AxisResult], models: Mapping[str, AxisModel]
) -> tuple[FittedFigure, ...]:
    """What the machine file leaves unknown, as the final models have it."""
    figures = []
    for name, search in results.items():
        for figure in examined.unknown.get(name, ()):
            if figure not in FIGURES:
                continue
            at, base = BASE.index(figure), models[name].base
            value = plant_figure(with_base(search.axis, base), figure)
            relative = math.sqrt(max(float(search.covariance()[at, at]), 0.0)) * search.spread[at]
            sigma = float(relative / (1.0 + base[at]) * value)
            unit = search.axis.unit_of(FIGURES[figure])
            figures.append(FittedFigure(name, figure, value, sigma, unit))
    return tuple(figures)
