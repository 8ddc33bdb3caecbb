"""Slips due sites into a production run, the most urgent first, within a time budget.

Each comes after the production site nearest to it. Its cost is the detour, the sequence and the
rests.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from scipy.spatial import cKDTree

from estimation.trajectory import Limits
from estimation.trajectory import plan as motion
from stagectl.calibration.due_sites import DueSite
from stagectl.calibration.sequence import REST, SiteSequence
from stagectl.recipe import Pair, Recipe


def insert_sites(
    recipe: Recipe, due: Sequence[DueSite], sequence: SiteSequence, budget: float
) -> tuple[Recipe, float]:
    """The recipe with calibration sites inserted, and the time they take [s].

    Args:
        recipe: of production, with sites.
        due: the most urgent first.
        sequence: of moves at each.
        budget: of time for all of them [s].
    """
    slipped: list[tuple[int, Pair]] = []
    spent = 0.0
    nearest = cKDTree(recipe.sites).query([site.place for site in due])[1] if due else []
    for site, found in zip(due, nearest, strict=True):
        behind = int(found)
        ahead = recipe.sites[min(behind + 1, len(recipe.sites) - 1)]
        here = recipe.sites[behind]
        detour = _time(recipe, here, site.place) + _time(recipe, site.place, ahead)
        cost = max(detour - _time(recipe, here, ahead), 0.0) + sequence.duration + REST
        if spent + cost <= budget:
            slipped.append((behind + 1, site.place))
            spent += cost
    if not slipped:
        return recipe, 0.0
    made = replace(recipe, slipped=tuple(slipped), slipped_excursions=sequence.excursions)
    return made, spent


def _time(recipe: Recipe, begin: Pair, end: Pair) -> float:
    """Of a macro-move with its rest [s]."""
    profile = recipe.macro
    limits = Limits(profile.velocity, profile.acceleration, profile.jerk)
    return max(motion(a, b, limits).duration for a, b in zip(begin, end, strict=True)) + REST
