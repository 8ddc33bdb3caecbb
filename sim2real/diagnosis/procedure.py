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

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

from hil_sim.effects.effect import Effect
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
    refit_beside,
    search_effects,
)
from sim2real.diagnosis.examination import Examination, Progress, report_without_causes
from sim2real.diagnosis.open_loop import diagnose_open_loop, with_description
from sim2real.diagnosis.verdict import Diagnosis, conclude
from sim2real.findings import PARTLY_EXPLAINED, UNEXPLAINED
from sim2real.fitting import (
    AxisModel,
    AxisProblem,
    Workers,
    compose_stage,
)
from sim2real.free_loop import FreeLoop, fit_figures, search_free
from sim2real.scoring.constants import REPEATED
from sim2real.shrinkage import HeldOut, axis_gap
from sim2real.tracking import Tracker, needs_other_axes

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
    if examined.open_loop is not None and examined.insufficient is None:
        return diagnose_open_loop(examined, tolerance, library, jobs=jobs, progress=progress)
    plain = report_without_causes(examined)
    if examined.insufficient is not None or examined.gap is None:
        return Diagnosis(plain, {}, {})
    settings = examined.settings
    # The workers are left first: on Ctrl-C they stop the searches that the pool waits for.
    with ThreadPoolExecutor(max_workers=max(1, jobs)) as pool, Workers(jobs) as workers:
        stage = _StageSearch(examined, tolerance, library, workers, progress)
        names = stage.names
        progress("effects", 0, 100 * len(names))
        searches = dict(zip(names, pool.map(stage.search_axis, names), strict=True))
        stage.searches = searches
        progress("shapes", 0, 3)
        _refit_coupled(searches, settings)
        progress("shapes", 1, 3)
        list(pool.map(stage.check_shapes, names))
        progress("shapes", 2, 3)
        drop_invisible(searches, examined.measured, settings)
        for name in names:
            stage.decide_in_loop(name)
        list(pool.map(lambda name: stage.fit_repeats(name, searches[name].best.model), names))
        measure_closed(searches, examined.measured, settings)
        progress("shapes", 3, 3)
        held_out = HeldOut(
            examined.measured, settings, searches, pool, partial(progress, "held-out moves")
        )
        found = conclude(examined, plain, searches, held_out)
    if found.report.verdict not in (UNEXPLAINED, PARTLY_EXPLAINED):
        return found
    report = with_description(found.report, examined, found.models, found.report.causes)
    return replace(found, report=report)


class _StageSearch:
    """The searches on all axes of a stage, and the steps that each goes through.

    In order: `search_axis`, `check_shapes`, `decide_in_loop`, `fit_repeats`.

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

    def fit_repeats(self, name: str, model: AxisModel) -> None:
        """Fit each effect of a model once more beside itself, unless that was done already."""
        found = self.searches[name]
        if found.free is not None or tuple(found.repeats) == model.names():
            return
        models = {name: other.best.model for name, other in self.searches.items()}

        def share(effect: Effect, model: AxisModel) -> float:
            return self._free_forms[name].share(effect, {**models, name: model})

        found.repeats = fit_repeats(
            found.problem, model, self._library, partial(self._loop_gap, name), share
        )

    def decide_in_loop(self, name: str) -> None:
        """Let the free loop decide about an axis that the search by innovations has left open.

        Of an effect in another shape it gives the figures; else it searches by itself.
        """
        found, loop = self.searches[name], self.free_loop(name)
        if found.is_complete:
            return
        if found.repeats:
            found.fit_in_loop(loop, found.alternatives[0].model)
        else:
            found.decide_in_loop(search_free(loop, self._all, rival=found.alternatives[0].model))

    def check_shapes(self, name: str) -> None:
        """Look for an effect in another shape than the library's where a search is not complete.

        It is sought as a free form first, then as an effect that departs from its equation.
        """
        found, loop = self.searches[name], partial(self._loop_gap, name)
        problem = found.problem
        pair = found.best.model
        if is_one_profile(pair, found.open_gap, problem.axis, loop):
            found.discard(pair.names())
        if found.is_complete:
            return
        single = of_size(found.alternatives, 1)[:1]
        if single:
            self.fit_repeats(name, single[0].model)
        if self._take_free_form(name):
            return
        found.repeats = {n: r for n, r in found.repeats.items() if r.is_family(found.open_gap)}
        for effect, repeat in found.repeats.items():
            model = self._nearest(name, [single[0].model, *repeat.alone(effect)])
            found.prefer(model, loop(model))

    def _take_free_form(self, name: str) -> bool:
        """Take the library's effect nearest to a free form, if the free form explains the gap.

        Returns whether it was taken: as the first alternative, with its repeat.
        """
        found, loop = self.searches[name], partial(self._loop_gap, name)
        start = found.problem.start
        form = self._free_forms[name].most_likely(self._library.values())
        if form is None or form.share <= REPEATED:
            return False
        kind = form.effect
        starts = [start.added(term) for term in form.starts]
        starts += [r.model for r in found.alternatives if r.model.names() == (kind.name,)]
        model = self._nearest(name, starts)
        shares = (form.share, self._free_forms[name].share(kind, {name: model}))
        repeat = free_form_repeat(model, shares, (found.open_gap, loop(model)))
        if not repeat.is_family(found.open_gap):
            return False
        found.prefer(model, repeat.before)
        found.repeats = {kind.name: repeat}
        return True


def _refit_coupled(searches: Mapping[str, AxisSearch], settings: StageSettings) -> None:
    """Refit the axes whose effects depend on other axes, beside what was found on those."""
    models = {name: found.best.model for name, found in searches.items()}
    for axis in settings.axes:
        elsewhere = any(model.terms for name, model in models.items() if name != axis.name)
        own = models[axis.name].settings(axis)
        if elsewhere and needs_other_axes(own, settings.sync_period):
            refit_beside(searches[axis.name], compose_stage(settings, models).axes)
