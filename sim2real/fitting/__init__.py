"""Fitting the model of one axis to tracked recordings (prediction-error method).

`axis_model` holds what is fitted (base parameters and effects), `coordinates` the scaled, bounded
form in which the fit sees an effect's parameters, and `plausibility` which values are credible.
`axis_problem` is the cost of the innovations, `gauss_newton` minimises it with `normal_equations`,
and `workers` shares the simulations among threads.
"""

from sim2real.fitting.axis_model import BASE as BASE
from sim2real.fitting.axis_model import MAX_SIGMAS as MAX_SIGMAS
from sim2real.fitting.axis_model import NUISANCES as NUISANCES
from sim2real.fitting.axis_model import STEP as STEP
from sim2real.fitting.axis_model import AxisModel as AxisModel
from sim2real.fitting.axis_model import Term as Term
from sim2real.fitting.axis_model import compose_stage as compose_stage
from sim2real.fitting.axis_model import plant_figure as plant_figure
from sim2real.fitting.axis_model import reported_values as reported_values
from sim2real.fitting.axis_model import with_base as with_base
from sim2real.fitting.axis_model import with_effects as with_effects
from sim2real.fitting.axis_model import with_figures as with_figures
from sim2real.fitting.axis_problem import AxisProblem as AxisProblem
from sim2real.fitting.axis_problem import Fitted as Fitted
from sim2real.fitting.coordinates import Coordinate as Coordinate
from sim2real.fitting.coordinates import coordinate as coordinate
from sim2real.fitting.coordinates import coordinates as coordinates
from sim2real.fitting.coordinates import effect_coordinates as effect_coordinates
from sim2real.fitting.coordinates import with_coordinates as with_coordinates
from sim2real.fitting.gauss_newton import fit as fit
from sim2real.fitting.normal_equations import invert_scaled as invert_scaled
from sim2real.fitting.plausibility import clip_to_plausible as clip_to_plausible
from sim2real.fitting.plausibility import implausibility as implausibility
from sim2real.fitting.plausibility import is_coulomb_drift as is_coulomb_drift
from sim2real.fitting.plausibility import is_coulomb_level as is_coulomb_level
from sim2real.fitting.plausibility import is_within_tolerance as is_within_tolerance
from sim2real.fitting.workers import Workers as Workers
