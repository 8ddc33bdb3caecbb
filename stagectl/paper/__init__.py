"""Section IV of the source paper, reproduced: its tables, its claims, and their sensitivity.

M. Boegli, T. De Laet, J. De Schutter, J. Swevers: A Split-Horizon Scheme for On-line Friction
Parameter Estimation. `published` holds the paper's figures, `case` what it leaves open, `simulate`
the move and its measurement, `fit` the paper's unweighted Gauss-Newton, `tables` its Tables I and
II; `claims` judges them; `study` runs everything, varied too, `page` writes the report.

A run uses another estimator, with a whitened residual and an arrival cost (`estimation`).
"""

from stagectl.paper.case import Case as Case
from stagectl.paper.study import Study as Study
