"""Machine and sequence for calibrations."""

import pytest

from stagectl.calibration import SiteSequence
from stagectl.recipe import Excursion, Profile

SITES = ((0.0, 0.0), (0.02, 0.0), (0.02, 0.02), (0.0, 0.02))
FILE = "calibrate: weekly\nsites: [[0, 0], [0.02, 0], [0.02, 0.02], [0, 0.02]]\n"
RECIPE = (
    "recipe: r\nmacro: {{velocity: 0.5, acceleration: 3.0, jerk: 200.0}}\n"
    "micro: {{velocity: 0.01, acceleration: 0.2, jerk: 20.0}}\n"
    "settle: {{window: 5.0e-8, hold: 0.005, timeout: 0.15}}\nexpose: 0\n"
    "sites: [{}]\nfiducial: {{source: none}}\n"
)


@pytest.fixture
def sequence():
    """One by hand: to choose one, the estimator has to be compiled."""
    slide = Profile(0.5, 3.0, 200.0)
    moves = tuple(
        Excursion((offset, offset), "other", slide) for offset in (1.5e-3, 0.0, -1.5e-3, 0.0)
    )
    return SiteSequence(moves, 1.2, {})
