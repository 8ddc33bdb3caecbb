"""Effects beside a curve: what both explain of an axis, and neither alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from hil_sim.effects import Effect
from sim2real.findings import Unlisted
from sim2real.free_loop import FreeLoop, FreeSearch, search_free
from sim2real.rivals import Beside, Curve, Rivals
from sim2real.scoring.constants import ENOUGH


def search_beside(
    loop: FreeLoop, rivals: Rivals, curve: Curve, sought: Mapping[str, Effect], most: int
) -> tuple[FreeSearch, tuple[str, ...], tuple[Unlisted, ...]] | None:
    """Search an axis for effects that explain it beside a curve.

    Args:
        loop: the axis, with the curve's force along the recorded motion as known.
        rivals: its curves.
        curve: that is known.
        sought: effects to consider.
        most: effects sought.

    Returns:
        The search, those of its effects that are doubted, and the curve as fitted beside the
        others; None where the effects do not explain nearly all that the curve leaves, or a second
        curve does so as well.
    """
    free = search_free(loop, sought, most=most)
    model, beside = free.best.model, Beside(rivals)
    if free.closed < ENOUGH or not free.names_causes() or not beside.keep(model, curve):
        return None
    doubted, unlisted = beside.doubts(model, beside.hidden(model))
    if len(doubted) == len(model.terms):
        return None
    return replace(free, of_rest=True), doubted, unlisted
