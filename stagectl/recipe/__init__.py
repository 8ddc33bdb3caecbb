"""Recipes: files checked against a machine, and the flat plan of their steps."""

from stagectl.recipe.dry_run import dry_run
from stagectl.recipe.fiducial import Fiducial, make_fiducial
from stagectl.recipe.load import load_recipe, parse_recipe
from stagectl.recipe.model import Excite, Excursion, Pair, Recipe
from stagectl.recipe.plan import (
    DoneStep,
    ExposeStep,
    FiducialStep,
    MarkedStep,
    MoveStep,
    count_segments,
    plan_from,
)
from stagectl.recipe.schema import Dwell, NoMark, Profile, Settle, SiteLimits
from stagectl.recipe.sites import MAX_SITES, grid_positions
from stagectl.recipe.tables import read_sites

__all__ = [
    "MAX_SITES",
    "DoneStep",
    "Dwell",
    "Excite",
    "Excursion",
    "ExposeStep",
    "Fiducial",
    "FiducialStep",
    "MarkedStep",
    "MoveStep",
    "NoMark",
    "Pair",
    "Profile",
    "Recipe",
    "Settle",
    "SiteLimits",
    "count_segments",
    "dry_run",
    "grid_positions",
    "load_recipe",
    "make_fiducial",
    "parse_recipe",
    "plan_from",
    "read_sites",
]
