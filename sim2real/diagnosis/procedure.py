"""The procedure of a diagnosis: which effects cause the gap, and how much of it they explain.

The search works on innovations, the one-step prediction errors of a simulation that is kept on the
recorded course (`sim2real.tracking`): they are free of friction's wander. What it finds is then
judged by what users see, the free-run gap, on moves that took no part in fitting. Terms:

- free loop, free run: the closed loop simulated from its demands alone, nothing corrected
- complete: a model is, if its innovations are white, so that it leaves nothing to explain
- rival: a curve over one coordinate of the motion, which the effects of the library have to match
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
    drop_invisible,
    factor_instead,
    measure_closed,
    search_effects,
)
from sim2real.diagnosis.along_motion import search_along_motion
from sim2real.diagnosis.beside_curve import search_beside
from sim2real.diagnosis.examination import Examination, Progress, report_without_causes
from sim2real.diagnosis.verdict import Diagnosis, conclude
from sim2real.findings import Unlisted
from sim2real.fitting import AxisModel, AxisProblem, Workers, compose_stage
from sim2real.free_loop import FreeLoop, fit_alone, fit_free, search_free
from sim2real.held_out import FLOOR_LEVEL, axis_gap, predict_held_out
from sim2real.open_loop import MotionLoop, measure_motion
from sim2real.rivals import Beside, Curve, Innovations, Rivals, Screen, find_rivals
from sim2real.scoring.constants import (
    ENOUGH,
    FITTED,
    LONG,
    MASS,
    MOST_EFFECTS,
    MOST_FOR_CURVE,
    SCALED,
)
from sim2real.tracking import Tracker

_LEAST_TOLERANCE = 1e-4
"""Relative standard deviation of plant figures whose tolerance the machine file leaves at zero."""
_SAME_OVER = dict.fromkeys(("acceleration", "force", "frequency"), ("mass", "motor"))
"""Coordinate -> groups of effects that are part of a curve over it."""
_BELL = ["size", "place", "shape"]
"""Roles of the parameters of an effect that acts around one place."""


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
        with Workers(jobs) as workers:
            results, held_out = search_along_motion(examined, tolerance, library, workers, progress)
            return conclude(examined, results, held_out)
    settings = examined.settings
    # The workers are left first: on Ctrl-C they stop the searches that the pool waits for.
    with ThreadPoolExecutor(max_workers=max(1, jobs)) as pool, Workers(jobs) as workers:
        stage = _StageSearch(examined, tolerance, library, workers, progress)
        progress("effects", 0, 100 * len(stage.names))
        stage.take(pool.map(stage.search_axis, stage.names))
        progress("curves", 0, 3)
        stage.searches = _refit_coupled(stage.searches, settings)
        progress("curves", 1, 3)
        stage.searches = drop_invisible(stage.searches, examined.measured, settings)
        progress("curves", 2, 3)
        stage.take(map(stage.decide_in_loop, stage.names))
        searches = measure_closed(stage.searches, examined.measured, settings)
        progress("curves", 3, 3)
        told = partial(progress, "held-out moves")
        fitted = {name: (s.problem, s.best.model, s.folds) for name, s in searches.items()}
        held_out = predict_held_out(examined.measured, settings, fitted, pool, told)
        return conclude(examined, searches, held_out, stage.curves)


class _StageSearch:
    """The searches on all axes of a stage, and the steps that each goes through.

    In order: `search_axis`, `decide_in_loop`. Each returns the axis' search as it is then, and
    `take` keeps those of all axes.

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
        self._curves: dict[str, Rivals] = {}

    def take(self, searches: Iterable[AxisSearch]) -> None:
        """Continue with these searches of all axes."""
        self.searches = dict(zip(self.names, list(searches), strict=True))

    def search_axis(self, name: str) -> AxisSearch:
        """Search one axis for effects."""
        problem = AxisProblem(
            [Tracker(m.replay, self._settings, name) for m in self._measured],
            self._tolerance_of(name),
            self._workers,
        )

        def advance(share: float) -> None:
            self._done[name] = share
            done = round(100 * sum(self._done.values()))
            self._progress("effects", done, 100 * len(self.names))

        return search_effects(
            problem,
            self._library,
            partial(self._loop_gap, name),
            advance,
            partial(self.is_curve, name),
            partial(self._largest, name),
        )

    def _largest(self, name: str) -> AxisModel | None:
        """The effect of any size that alone closes nearly all of the gap in force; None without."""
        loop = self._motion_loop(name)
        plain = [effect for effect in self._library.values() if effect.any_size]

        def left(model: AxisModel) -> float:
            return loop.gap(loop.residual(model)) - FLOOR_LEVEL

        best = min(fit_alone(loop, plain), key=left, default=loop.start)
        return best if left(best) < (1.0 - ENOUGH) * left(loop.start) else None

    def _loop_gap(self, name: str, model: AxisModel) -> float:
        """Squared closed-loop gap over floor of an axis under a model; the others are nominal."""
        self._workers.check()
        return axis_gap(name, {name: model}, self._measured, self._settings)

    def decide_in_loop(self, name: str) -> AxisSearch:
        """Decide about an axis that the search by innovations leaves open, or needs several for.

        Where a curve over one coordinate is the answer, an effect may explain the rest beside it.
        """
        search = self._decide(name)
        if search.best.model.terms or not search.unlisted or search.unlisted[0].seen_in:
            return search
        curve = self._rivals(name).curves[0]
        loop = self._loop_beside(name, curve)
        left = loop.gap(loop.residual(loop.start))
        if left - FLOOR_LEVEL < (1.0 - ENOUGH) * (search.open_gap - FLOOR_LEVEL):
            return search
        groups = _SAME_OVER.get(search.unlisted[0].over, ())
        others = {n: e for n, e in self._library.items() if e.group not in groups}
        return self._name_beside(search, loop, curve, others, 1) or search

    def _loop_beside(self, name: str, curve: Curve) -> FreeLoop:
        """The free loop of an axis with a curve's force along the recorded motion as known."""
        known = self._rivals(name).screen.forces(curve)
        tolerance = self._tolerance_of(name)
        return FreeLoop(name, self._measured, self._settings, tolerance, self._workers, known)

    def _name_beside(
        self,
        search: AxisSearch,
        loop: FreeLoop,
        curve: Curve,
        sought: Mapping[str, Effect],
        most: int,
    ) -> AxisSearch | None:
        """The search with effects that explain an axis beside a curve, as `search_beside`."""
        found = search_beside(loop, self._rivals(loop.name), curve, sought, most)
        if found is None:
            return None
        free, doubted, unlisted = found
        return replace(search.decided_in_loop(free), doubted=doubted, unlisted=unlisted)

    def _decide(self, name: str) -> AxisSearch:
        """The effects of an axis, or the coordinate that is its answer.

        Where a curve over one coordinate explains what no few effects do, that is the answer. Else
        the free loop searches, and what it finds meets the curves, too.
        """
        search = self.searches[name]
        if not search.is_complete:
            search = self._start_at_peak(name, search)
        if search.is_complete and len(search.best.model.terms) < 2:
            return search
        first = [alternative.model for alternative in search.alternatives]
        is_open = not search.is_complete
        near = first[:FITTED] if is_open else []
        if self.is_curve(name, [search.best.model, *near], is_complete=not is_open):
            rivals = self._rivals(name)
            if not rivals.leave_names(self._transmitted(name), leaves_structure=is_open):
                return search.without_names(rivals.unlisted(name))
        if search.is_complete:
            doubted, unlisted = Beside(self._rivals(name)).doubts_of_complete(search.best.model)
            return replace(search, doubted=doubted, unlisted=unlisted)
        innovations, rivals = Innovations(search.problem), self._rivals(name)
        instead = innovations.unlisted()
        if instead and innovations.instead_of([*near, *self._transmitted(name)]):
            return search.without_names(_clearer(rivals.unlisted(name), instead))
        tolerance = float(search.problem.spread[0])
        loop = FreeLoop(name, self._measured, self._settings, tolerance, self._workers)
        most = MOST_FOR_CURVE if self._is_nearly_all(name) else MOST_EFFECTS
        beside = Beside(rivals)
        free = search_free(loop, self._all, rival=first[0], most=most, is_beaten=beside.beat)
        curve = beside.complement(free.best.model)
        if curve is not None:
            sought = {term.name: self._all[term.name] for term in free.best.model.terms}
            known = self._loop_beside(name, curve)
            both = self._name_beside(search, known, curve, sought, len(sought))
            if both is not None:
                return both
        found = search.decided_in_loop(free)
        model = found.best.model
        if not model.terms or not rivals.leave_names([model]):
            return found.without_names(rivals.unlisted(name) or innovations.unlisted())
        instead = innovations.instead_of([model])
        if instead:
            return found.without_names(_clearer(rivals.unlisted(name), instead))
        doubted, unlisted = beside.doubts(model)
        return replace(found, doubted=doubted, unlisted=unlisted)

    def _transmitted(self, name: str) -> list[AxisModel]:
        """Each effect of transmissions alone, fitted: the search by innovations has tried none."""
        transmitted = [e for n, e in self._all.items() if n not in self._library]
        return fit_alone(self._rivals(name).screen.loop, transmitted)

    def _start_at_peak(self, name: str, search: AxisSearch) -> AxisSearch:
        """The search with bells that start where a curve over position has a narrow bump.

        A grid over the travel is too coarse for these.
        """
        rivals = self._rivals(name)
        if rivals.peak is None:
            return search
        bells = [e for e in self._library.values() if [p.role for p in e.parameters] == _BELL]
        for model in fit_alone(rivals.screen.loop, bells, rivals.peak):
            search = search.with_start(model, partial(self._loop_gap, name))
        return search

    def curves(self, name: str) -> Sequence[Unlisted]:
        """The coordinate that the missing force of an axis depends on."""
        return self._rivals(name).unlisted(name)

    def is_curve(self, name: str, models: Sequence[AxisModel], is_complete: bool = False) -> bool:
        """Whether a curve explains an axis better than these models.

        Where these are not complete, it has to explain nearly all.

        Args:
            name: of the axis.
            models: of the library.
            is_complete: whether innovations show that these lack nothing.
        """
        rivals = self._rivals(name)
        unlisted = rivals.unlisted(name)
        if not unlisted or not (is_complete or self._is_nearly_all(name)):
            return False
        judged = {"leaves_structure": not is_complete, "is_complete": is_complete}
        if rivals.leave_names(models, **judged):
            return False
        # The search takes mass, friction and stiffness before a factor on all of these: it is tried
        # alone, and beside the friction and stiffness found.
        loop = rivals.screen.loop
        for model in models:
            start = factor_instead(model, loop.axis, self._all)
            if start is not None:
                rest = tuple(t for t in model.terms if t.name in SCALED and t.name != MASS)
                starts = (start, replace(start, terms=(*start.terms, *rest)))
                scaled = [fit_free(loop, each, LONG).model for each in starts if loop.allows(each)]
                return not scaled or not rivals.leave_names(scaled, **judged)
        return True

    def _is_nearly_all(self, name: str) -> bool:
        """Whether a curve over one coordinate explains nearly all of an axis' gap."""
        return any(each.gap_closed > ENOUGH for each in self._rivals(name).unlisted(name))

    def _rivals(self, name: str) -> Rivals:
        """The curves of an axis, fitted when they are asked for first."""
        if name not in self._curves:
            self._curves[name] = find_rivals(Screen(self._motion_loop(name)))
        return self._curves[name]

    def _motion_loop(self, name: str) -> MotionLoop:
        """The force of an axis along its motion."""
        motions = [
            measure_motion(m.replay.recording, replace(self._settings, start=m.replay.start))
            for m in self._measured
        ]
        tolerance = self._tolerance_of(name)
        return MotionLoop(name, motions, self._settings, tolerance, self._workers)

    def _tolerance_of(self, name: str) -> float:
        """Relative standard deviation of an axis' plant figures."""
        return max(self._tolerance.get(name, 0.0), _LEAST_TOLERANCE)


def _clearer(along: Sequence[Unlisted], other: Sequence[Unlisted]) -> Sequence[Unlisted]:
    """The coordinate seen along the motion, or another one that innovations show more clearly."""
    if not along:
        return other
    is_clearer = along[0].over != other[0].over and along[0].gap_closed < other[0].gap_closed
    return other if is_clearer else along


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
