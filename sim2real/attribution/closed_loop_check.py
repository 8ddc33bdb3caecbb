"""What a search found, checked against the free-run gap that users see.

The search works on one-step predictions. Where these leave nothing, the closed loop agrees, except
that an effect may not show in it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from hil_sim.settings import StageSettings
from sim2real.attribution.search import AxisSearch
from sim2real.fitting import AxisModel, fit
from sim2real.gap import Measured
from sim2real.scoring.constants import VISIBLE
from sim2real.shrinkage import FLOOR_LEVEL, axis_gap


def drop_invisible(
    searches: Mapping[str, AxisSearch], measured: Sequence[Measured], settings: StageSettings
) -> None:
    """Drop effects whose removal hardly widens the free-run gap (less than `VISIBLE`).

    Axes that are not complete are left to the free loop.

    Args:
        searches: axis -> its search, changed in place.
        measured: recordings.
        settings: of the machine file.
    """
    models = {name: found.best.model for name, found in searches.items()}
    for name, found in searches.items():
        if not found.is_complete or not found.best.model.terms:
            continue
        best = _visible(name, models, measured, settings)
        if best.names() != found.best.model.names():
            found.best = fit(found.problem.finer_if_close(found.best.residual), best, 3)
        models[name] = found.best.model


def measure_closed(
    searches: Mapping[str, AxisSearch], measured: Sequence[Measured], settings: StageSettings
) -> None:
    """Set the share of each axis' gap that its model closes; arguments as `drop_invisible`.

    A single effect in another shape is measured with its repeat.
    """
    models = {name: found.best.model for name, found in searches.items()}
    for name, found in searches.items():
        before = axis_gap(name, {**models, name: found.problem.start}, measured, settings)
        after = axis_gap(name, models, measured, settings)
        names = models[name].names()
        if len(names) == 1 and names[0] in found.repeats and found.repeats[names[0]].departs:
            after = min(after, found.repeats[names[0]].gap)
        if before > FLOOR_LEVEL + VISIBLE:
            found.closes = 1.0 - (after - FLOOR_LEVEL) / (before - FLOOR_LEVEL)


def _visible(
    name: str,
    models: Mapping[str, AxisModel],
    measured: Sequence[Measured],
    settings: StageSettings,
) -> AxisModel:
    """The model without the effects that do not show in the gap."""
    model = models[name]
    gap = axis_gap(name, models, measured, settings)
    for index in reversed(range(len(model.terms))):
        fewer = {**models, name: model.without(index)}
        if axis_gap(name, fewer, measured, settings) - gap < VISIBLE:
            model = model.without(index)
    return model
