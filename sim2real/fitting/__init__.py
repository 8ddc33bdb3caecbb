"""Fitting the model of one axis to tracked recordings (prediction-error method).

`axis_model` holds what is fitted (base parameters and effects), `coordinates` the scaled, bounded
form in which the fit sees an effect's parameters, and `plausibility` which values are credible.
`axis_problem` is the cost of the innovations, `gauss_newton` minimises it with `normal_equations`,
and `workers` shares the simulations among threads.
"""

from sim2real.fitting.axis_model import (
    BASE,
    MAX_SIGMAS,
    NUISANCES,
    STEP,
    AxisModel,
    Term,
    compose_stage,
    plant_figure,
    reported_values,
    with_base,
    with_effects,
)
from sim2real.fitting.axis_problem import AxisProblem, Fitted
from sim2real.fitting.coordinates import (
    Coordinate,
    coordinate,
    coordinates,
    effect_coordinates,
    with_coordinates,
)
from sim2real.fitting.gauss_newton import fit
from sim2real.fitting.normal_equations import invert_scaled
from sim2real.fitting.plausibility import (
    clip_to_plausible,
    implausibility,
    is_coulomb_drift,
    is_coulomb_level,
    is_within_tolerance,
)
from sim2real.fitting.workers import Workers

__all__ = [
    "BASE",
    "MAX_SIGMAS",
    "NUISANCES",
    "STEP",
    "AxisModel",
    "AxisProblem",
    "Coordinate",
    "Fitted",
    "Term",
    "Workers",
    "clip_to_plausible",
    "compose_stage",
    "coordinate",
    "coordinates",
    "effect_coordinates",
    "fit",
    "implausibility",
    "invert_scaled",
    "is_coulomb_drift",
    "is_coulomb_level",
    "is_within_tolerance",
    "plant_figure",
    "reported_values",
    "with_base",
    "with_coordinates",
    "with_effects",
]
