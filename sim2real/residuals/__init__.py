"""What a model leaves, seen from several sides, for people and for other programs.

`course` puts the samples of one axis from all recordings in one place; `velocity`, `plane`,
`reversal` and `response` each reduce them to the few numbers of one picture. Nothing is fitted.
"""

from sim2real.residuals.response import FrequencyResponse
from sim2real.residuals.reversal import ReversalLoop
from sim2real.residuals.velocity import VelocityMeans
from sim2real.residuals.views import ResidualViews, residuals_json, view_residuals

__all__ = [
    "FrequencyResponse",
    "ResidualViews",
    "ReversalLoop",
    "VelocityMeans",
    "residuals_json",
    "view_residuals",
]
