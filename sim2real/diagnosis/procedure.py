"""The procedure of a diagnosis: which effects cause the gap, and how much of it they explain.

The search works on innovations, the one-step prediction errors of a simulation that is kept on the
recorded course (`sim2real.tracking`): they are free of friction's wander. What it finds is then
judged by what users see, the free-run gap, on moves that took no part in fitting. Terms:

- free loop, free run: the closed loop simulated from its demands alone, nothing corrected
- complete: a model is, if its innovations are white, so that it leaves nothing to explain
- repeat: an effect fitted a second time beside itself. Where the second takes up what the first
  leaves, the effect is present in another shape than the library's: it departs from its equation
- free form: a kind of effect fitted in any shape, as a friction profile over position; the nearest
  effect of the library then stands for it
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

from hil_sim.effects import Effect
from hil_sim.plant import needs_all_axes
from hil_sim.settings import StageSettings
from sim2real.attribution import (
    AxisSearch,
    FreeFormTest,
    drop_invisible,
    fit_repeats,
    free_form_repeat,
    is_one_profile,
    measure_closed,
    of_size,
    search_effects,
)
from sim2real.diagnosis.along_motion import search_along_motion
from sim2real.diagnosis.examination import Examination, Progress, report_without_causes
from sim2real.diagnosis.verdict import Diagnosis, conclude
from sim2real.fitting import AxisModel, AxisProblem, Workers, compose_stage
from sim2real.free_loop import FreeLoop, fit_figures, search_free
from sim2real.held_out import axis_gap, predict_held_out
from sim2real.scoring.constants import REPEATED
from sim2real.tracking import Tracker

_LEAST_TOLERANCE = 1e-4
"""Relative standard deviation of plant figures whose tolerance the machine file leaves at zero."""


def diagnose(
    examined: Examination,
    tolerance: Mapping[str, float],
    library: Mapping[str, Effect],
    *,
    jobs: int = 2,
    progress: Progress = lambda *_: None,
) -> Diagnosis:
    """Diagnose the gap of examined recordings.

    Args:
        examined: channels, floor, gap and its location.
        tolerance: axis -> relative standard deviation of the plant's figures.
        library: effects to consider; those that are not searched for are ignored.
        jobs: threads for the axes, and for the fits that they wait for.
        progress: called with (what is being done, steps done, all steps).
    """
    if examined.insufficient is not None or examined.gap is None:
        return Diagnosis(report_without_causes(examined), {}, {})
    if examined.open_loop is not None:
        results, held_out = search_along_motion(examined, tolerance, library, jobs, progress)
        return conclude(examined, results, held_out)
    settings = examined.settings
    # The workers are left first: on Ctrl-C they stop the searches that the pool waits for.
    with ThreadPoolExecutor(max_workers=max(1, jobs)) as pool, Workers(jobs) as workers:
        stage = _StageSearch(examined, tolerance, library, workers, progress)
        progress("effects", 0, 100 * len(stage.names))
        stage.take(pool.map(stage.search_axis, stage.names))
        progress("shapes", 0, 3)
        stage.searches = _refit_coupled(stage.searches, settings)
        progress("shapes", 1, 3)
        stage.take(pool.map(stage.check_shapes, stage.names))
        progress("shapes", 2, 3)
        stage.searches = drop_invisible(stage.searches, examined.measured, settings)
        stage.take(map(stage.decide_in_loop, stage.names))
        stage.take(pool.map(stage.repeat_best, stage.names))
        searches = measure_closed(stage.searches, examined.measured, settings)
        progress("shapes", 3, 3)
        told = partial(progress, "held-out moves")
        fitted = {name: (s.problem, s.best.model, s.folds) for name, s in searches.items()}
        held_out = predict_held_out(examined.measured, settings, fitted, pool, told)
        return conclude(examined, searches, held_out)


class _StageSearch:
    """The searches on all axes of a stage, and the steps that each goes through.

    In order: `search_axis`, `check_shapes`, `decide_in_loop`, `repeat_best`. Each returns the axis'
    search as it is then, and `take` keeps those of all axes.

    Args:
        examined: the recordings.
        tolerance: axis -> relative standard deviation of the plant's figures.
        library: effects by name.
        workers: threads for the fits.
        progress: as in `diagnose`.
    """

    def __init__(
        self,
        examined: Examination,
        tolerance: Mapping[str, float],
        library: Mapping[str, Effect],
        workers: Workers,
        progress: Progress,
    ) -> None:
        self._measured = examined.measured
        self._settings = examined.settings
        self._tolerance = tolerance
        self._all = {name: effect for name, effect in library.items() if effect.searched}
        self._library = {n: effect for n, effect in self._all.items() if not effect.transmission}
        self._workers = workers
        self._progress = progress
        self.names = [axis.name for axis in self._settings.axes]
        self.searches: dict[str, AxisSearch] = {}
        self._done = dict.fromkeys(self.names, 0.0)
        self._free_forms = {
            name: FreeFormTest(name, self._measured, self._settings) for name in self.names
        }

    def take(self, searches: Iterable[AxisSearch]) -> None:
        """Continue with these searches of all axes."""
        self.searches = dict(zip(self.names, list(searches), strict=True))

    def search_axis(self, name: str) -> AxisSearch:
        """Search one axis for effects."""
        problem = AxisProblem(
            [Tracker(m.replay, self._settings, name) for m in self._measured],
            max(self._tolerance.get(name, 0.0), _LEAST_TOLERANCE),
            self._workers,
        )

        def advance(share: float) -> None:
            self._done[name] = share
            done = round(100 * sum(self._done.values()))
            self._progress("effects", done, 100 * len(self.names))

        return search_effects(problem, self._library, partial(self._loop_gap, name), advance)

    def _loop_gap(self, name: str, model: AxisModel) -> float:
        """Squared closed-loop gap over floor of an axis under a model; the others are nominal."""
        self._workers.check()
        return axis_gap(name, {name: model}, self._measured, self._settings)

    def free_loop(self, name: str) -> FreeLoop:
        """The free loop of an axis; the others are nominal."""
        tolerance = float(self.searches[name].problem.spread[0])
        return FreeLoop(name, self._measured, self._settings, tolerance, self._workers)

    def _nearest(self, name: str, starts: Sequence[AxisModel]) -> AxisModel:
        """The best of these models by free-run gap, its figures fitted in the free loop."""
        start = min(starts, key=partial(self._loop_gap, name))
        loop = self.free_loop(name)
        return fit_figures(loop, start)[0].model if loop.allows(start) else start

    def _repeated(self, search: AxisSearch, model: AxisModel) -> AxisSearch:
        """The search with each effect of a model fitted once more, unless that was done already."""
        if search.free is not None or tuple(search.repeats) == model.names():
            return search
        name = search.axis.name
        models = {other: found.best.model for other, found in self.searches.items()}

        def share(effect: Effect, model: AxisModel) -> float:
            return self._free_forms[name].share(effect, {**models, name: model})

        loop = partial(self._loop_gap, name)
        return replace(
            search, repeats=fit_repeats(search.problem, model, self._library, loop, share)
        )

    def repeat_best(self, name: str) -> AxisSearch:
        """Fit the effects found once more beside themselves."""
        return self._repeated(self.searches[name], self.searches[name].best.model)

    def decide_in_loop(self, name: str) -> AxisSearch:
        """Let the free loop decide about an axis that the search by innovations has left open.

        Of an effect in another shape it gives the figures; else it searches by itself.
        """
        search, loop = self.searches[name], self.free_loop(name)
        if search.is_complete:
            return search
        first = search.alternatives[0].model
        if search.repeats:
            return search.fitted_in_loop(loop, first)
        return search.decided_in_loop(search_free(loop, self._all, rival=first))

    def check_shapes(self, name: str) -> AxisSearch:
        """Look for an effect in another shape than the library's where a search is not complete.

        It is sought as a free form first, then as an effect that departs from its equation.
        """
        search, loop = self.searches[name], partial(self._loop_gap, name)
        pair = search.best.model
        if is_one_profile(pair, search.open_gap, search.axis, loop):
            search = search.discarding(pair.names())
        if search.is_complete:
            return search
        single = of_size(search.alternatives, 1)[:1]
        if single:
            search = self._repeated(search, single[0].model)
        formed = self._in_free_form(search)
        if formed is not None:
            return formed
        opened = search.open_gap
        search = replace(
            search, repeats={n: r for n, r in search.repeats.items() if r.is_family(opened)}
        )
        for effect, repeat in search.repeats.items():
            model = self._nearest(name, [single[0].model, *repeat.alone(effect)])
            search = search.preferring(model, loop(model))
        return search

    def _in_free_form(self, search: AxisSearch) -> AxisSearch | None:
        """The search with the library's effect nearest to a free form, if that explains the gap.

        It is the first alternative then, with its repeat. None where no free form explains the gap.
        """
        name = search.axis.name
        form = self._free_forms[name].most_likely(self._library.values())
        if form is None or form.share <= REPEATED:
            return None
        kind = form.effect
        starts = [search.problem.start.added(term) for term in form.starts]
        starts += [a.model for a in search.alternatives if a.model.names() == (kind.name,)]
        model = self._nearest(name, starts)
        shares = (form.share, self._free_forms[name].share(kind, {name: model}))
        repeat = free_form_repeat(model, shares, (search.open_gap, self._loop_gap(name, model)))
        if not repeat.is_family(search.open_gap):
            return None
        return replace(search.preferring(model, repeat.before), repeats={kind.name: repeat})


def _refit_coupled(
    searches: Mapping[str, AxisSearch], settings: StageSettings
) -> dict[str, AxisSearch]:
    """The searches with axes whose effects depend on other axes refitted beside those."""
    models = {name: search.best.model for name, search in searches.items()}
    refitted = dict(searches)
    for axis in settings.axes:
        elsewhere = any(model.terms for name, model in models.items() if name != axis.name)
        own = models[axis.name].settings(axis)
        if elsewhere and needs_all_axes(replace(settings, axes=(own,))):
            beside = compose_stage(settings, models).axes
            refitted[axis.name] = searches[axis.name].refitted_beside(beside)
    return refitted
