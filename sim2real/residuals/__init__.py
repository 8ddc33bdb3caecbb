"""What a model leaves, seen from several sides, for people and for other programs.

`course` puts the samples of one axis from all recordings in one place; `velocity`, `plane`,
`reversal` and `response` each reduce them to the few numbers of one picture. Nothing is fitted.
"""

from sim2real.residuals.course import Course, gather_course
from sim2real.residuals.plane import ResidualPlane, average_over_plane
from sim2real.residuals.response import FrequencyResponse, estimate_response
from sim2real.residuals.reversal import ReversalLoop, average_reversals
from sim2real.residuals.velocity import VelocityMeans, average_over_velocity
from sim2real.residuals.views import ResidualViews, residuals_json, view_residuals

__all__ = [
    "Course",
    "FrequencyResponse",
    "ResidualPlane",
    "ResidualViews",
    "ReversalLoop",
    "VelocityMeans",
    "average_over_plane",
    "average_over_velocity",
    "average_reversals",
    "estimate_response",
    "gather_course",
    "residuals_json",
    "view_residuals",
]
