"""Recipes: files checked against a machine, and the flat plan of their steps."""

from stagectl.recipe.dry_run import dry_run as dry_run
from stagectl.recipe.fiducial import Fiducial as Fiducial
from stagectl.recipe.fiducial import make_fiducial as make_fiducial
from stagectl.recipe.load import load_recipe as load_recipe
from stagectl.recipe.load import parse_recipe as parse_recipe
from stagectl.recipe.model import Excite as Excite
from stagectl.recipe.model import Excursion as Excursion
from stagectl.recipe.model import Pair as Pair
from stagectl.recipe.model import Recipe as Recipe
from stagectl.recipe.plan import DoneStep as DoneStep
from stagectl.recipe.plan import ExposeStep as ExposeStep
from stagectl.recipe.plan import FiducialStep as FiducialStep
from stagectl.recipe.plan import MarkedStep as MarkedStep
from stagectl.recipe.plan import MoveStep as MoveStep
from stagectl.recipe.plan import count_segments as count_segments
from stagectl.recipe.plan import plan_from as plan_from
from stagectl.recipe.schema import Dwell as Dwell
from stagectl.recipe.schema import NoMark as NoMark
from stagectl.recipe.schema import Profile as Profile
from stagectl.recipe.schema import Settle as Settle
from stagectl.recipe.schema import SiteLimits as SiteLimits
from stagectl.recipe.sites import MAX_SITES as MAX_SITES
from stagectl.recipe.sites import grid_positions as grid_positions
from stagectl.recipe.tables import read_sites as read_sites
