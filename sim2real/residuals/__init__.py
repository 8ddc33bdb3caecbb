"""What a model leaves, seen from several sides, for people and for other programs.

`course` puts the samples of one axis from all recordings in one place; `velocity`, `plane`,
`reversal` and `response` each reduce them to the few numbers of one picture. Nothing is fitted.
"""

from sim2real.residuals.response import FrequencyResponse as FrequencyResponse
from sim2real.residuals.reversal import ReversalLoop as ReversalLoop
from sim2real.residuals.velocity import VelocityMeans as VelocityMeans
from sim2real.residuals.views import ResidualViews as ResidualViews
from sim2real.residuals.views import residuals_json as residuals_json
from sim2real.residuals.views import view_residuals as view_residuals
