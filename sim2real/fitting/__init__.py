"""Fitting the model of one axis to tracked recordings (prediction-error method).

`axis_model` holds what is fitted (base parameters and effects), `coordinates` the scaled, bounded
form in which the fit sees an effect's parameters, and `plausibility` which values are credible.
`axis_problem` is the cost of the innovations, `gauss_newton` minimises it with `normal_equations`,
and `workers` shares the simulations among threads.
"""

from sim2real.fitting.axis_model import (
    BASE,
    NUISANCES,
    STEP,
    AxisModel,
    Coordinate,
    Term,
    composed,
    coordinate,
    coordinates,
    fitted,
    implausible,
    is_course,
    is_level,
    moved,
    parameters,
    plausible,
    with_base,
    with_effects,
    within_tolerance,
)
from sim2real.fitting.axis_problem import AxisProblem, Fitted, structure
from sim2real.fitting.gauss_newton import fit
from sim2real.fitting.workers import Stopped, Workers

__all__ = [
    "BASE",
    "NUISANCES",
    "STEP",
    "AxisModel",
    "AxisProblem",
    "Coordinate",
    "Fitted",
    "Stopped",
    "Term",
    "Workers",
    "composed",
    "coordinate",
    "coordinates",
    "fit",
    "fitted",
    "implausible",
    "is_course",
    "is_level",
    "moved",
    "parameters",
    "plausible",
    "structure",
    "with_base",
    "with_effects",
    "within_tolerance",
]
