"""What a search found, checked against the free-run gap that users see.

The search works on one-step predictions. Where the library contains the stage's effects, these
predictions leave nothing and the closed loop agrees. Where it does not, effects may be chosen that
help the predictions and harm the loop: then the set that closes most of the gap is taken, a further
effect only if it closes much of what is left, and none if none closes enough.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from hil_sim.settings import StageSettings
from sim2real.attribution.alternatives import of_size
from sim2real.attribution.constants import CLOSES, SETS
from sim2real.attribution.search import AxisSearch
from sim2real.fitting import AxisModel, fit
from sim2real.free_loop import VISIBLE, FreeLoop
from sim2real.gap import Measured
from sim2real.shrinkage import FLOOR_LEVEL, axis_gap


def drop_ineffective(
    searches: Mapping[str, AxisSearch],
    measured: Sequence[Measured],
    settings: StageSettings,
    loop: Callable[[str], FreeLoop],
) -> None:
    """Drop effects that do nothing for the free-run gap.

    Args:
        searches: axis -> its search, changed in place.
        measured: recordings.
        settings: of the machine file.
        loop: the free loop of an axis.
    """
    models = {name: found.best.model for name, found in searches.items()}
    for name, found in searches.items():
        if found.is_complete and not found.best.model.terms:
            continue
        if found.is_complete:
            best = _drop_invisible(name, models, measured, settings)
            if best.names() != found.best.model.names():
                found.best = fit(found.problem.finer_if_close(found.best.residual), best, 3)
        else:
            found.fit_in_loop(loop(name), _best_closing(name, found, models, measured, settings))
        models[name] = found.best.model
        before = axis_gap(name, {**models, name: found.problem.start}, measured, settings)
        after = _gap(name, found, models, measured, settings)
        if before > FLOOR_LEVEL + VISIBLE:
            found.closes = 1.0 - (after - FLOOR_LEVEL) / (before - FLOOR_LEVEL)


def _drop_invisible(
    name: str,
    models: Mapping[str, AxisModel],
    measured: Sequence[Measured],
    settings: StageSettings,
) -> AxisModel:
    """The model without the effects whose removal hardly widens the gap (less than `VISIBLE`)."""
    model = models[name]
    gap = axis_gap(name, models, measured, settings)
    for index in reversed(range(len(model.terms))):
        fewer = {**models, name: model.without(index)}
        if axis_gap(name, fewer, measured, settings) - gap < VISIBLE:
            model = model.without(index)
    return model


def _gap(
    name: str,
    found: AxisSearch,
    models: Mapping[str, AxisModel],
    measured: Sequence[Measured],
    settings: StageSettings,
) -> float:
    """Squared gap of an axis over floor; of a single effect in another shape, with its repeat."""
    gap = axis_gap(name, models, measured, settings)
    names = models[name].names()
    if len(names) == 1 and names[0] in found.repeats and found.repeats[names[0]].departs:
        return min(gap, found.repeats[names[0]].gap)
    return gap


def _best_closing(
    name: str,
    found: AxisSearch,
    models: Mapping[str, AxisModel],
    measured: Sequence[Measured],
    settings: StageSettings,
) -> AxisModel:
    """The smallest set of effects that closes most of the gap."""
    best = found.problem.start
    least = axis_gap(name, {**models, name: best}, measured, settings)
    for size in (1, 2):
        sets = [r.model for r in of_size(found.alternatives, size)][:SETS]
        gaps = [_gap(name, found, {**models, name: m}, measured, settings) for m in sets]
        if not gaps:
            continue
        lowest = min(gaps)
        left = max(least - FLOOR_LEVEL, 0.0)
        if least - lowest > max(VISIBLE, CLOSES * left):
            best, least = sets[gaps.index(lowest)], lowest
    return best
