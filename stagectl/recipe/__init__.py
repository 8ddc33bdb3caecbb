"""Recipes: files checked against a machine, and the flat plan of steps they come to."""

from stagectl.recipe.load import load_recipe as load_recipe
from stagectl.recipe.load import parse_recipe as parse_recipe
from stagectl.recipe.model import Recipe as Recipe
from stagectl.recipe.plan import plan as plan
