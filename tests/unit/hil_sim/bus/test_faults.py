"""Plans of faults: what is refused when a fault is made."""

import math

import pytest

from hil_sim.bus import faults as f

TPDO_X = f.Frames(frozenset({0x181}), "drives")


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: f.Frames(probability=0.0), "probability"),
        (lambda: f.Frames(after=2.0, until=1.0), "until"),
        (lambda: f.Frames(after=math.nan), "after"),
        (lambda: f.Frames(node=1), "sender"),
        (lambda: f.Frames(nth=frozenset({0})), "nth"),
        (lambda: f.Resize(TPDO_X, 9), "length"),
        (lambda: f.Delay(TPDO_X, 2.0, 1.0), "most"),
        (lambda: f.DriveFault(1, 0x8611), "either"),
        (lambda: f.DriveFault(1, 0, at=1.0), "code"),
        (lambda: f.BusOff(1, 1.0, 0.0), "duration"),
    ],
)
def test_impossible_faults_are_refused_when_made(make, word):
    with pytest.raises(ValueError, match=word):
        make()
