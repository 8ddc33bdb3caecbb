"""Machine and sequence for calibrations."""

import pytest

from stagectl.calibration import SiteSequence
from stagectl.config.machine.file import load_machine
from stagectl.recipe import Excursion, Profile


@pytest.fixture(scope="module")
def machine():
    return load_machine()


@pytest.fixture
def sequence():
    """One by hand: to choose one, the estimator has to be compiled."""
    slide = Profile(0.5, 3.0, 200.0)
    moves = tuple(
        Excursion((offset, offset), "other", slide) for offset in (1.5e-3, 0.0, -1.5e-3, 0.0)
    )
    return SiteSequence(moves, 1.2, {})
