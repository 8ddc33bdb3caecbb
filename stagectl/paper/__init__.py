"""Section IV of the source paper, simulated again: its tables, its claims, what they hang on.

M. Boegli, T. De Laet, J. De Schutter, J. Swevers: A Split-Horizon Scheme for On-line Friction
Parameter Estimation. `published` holds the paper's figures; `simulate` the move, `signals` what is
measured of it, `window` and `fit` the paper's unweighted Gauss-Newton, `tables` its Tables I and
II; `claims` and `sensitivity` what can be said about them; `study` runs all of it, `page` writes it
down.

Not the estimator of a run: that one whitens the residual and keeps an arrival cost (`estimation`).
"""

from stagectl.paper.signals import Processing
from stagectl.paper.simulate import Setup
from stagectl.paper.study import Study
from stagectl.paper.tables import Case
from stagectl.paper.window import Options

__all__ = [
    "Case",
    "Options",
    "Processing",
    "Setup",
    "Study",
]
