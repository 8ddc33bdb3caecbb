"""Where a fit of an effect starts, in the free loop."""

from __future__ import annotations

import pytest

from hil_sim.effects.library import library
from sim2real.free_loop import FreeLoop
from sim2real.free_loop.candidates import FreeDictionary
from sim2real.free_loop.fit import fit_free
from sim2real.gap import compare_with_model
from tests.unit.sim2real.conftest import TOLERANCE, stage_with


@pytest.mark.parametrize("pitch", [3.1e-3, 4.47e-3, 7.3e-3])
def test_the_pitch_of_what_multiplies_the_motor_force_is_sought_in_the_force_over_it(
    nominal, pitch
):
    """The force itself changes sign on the way: its own waves have other pitches."""
    there = {"torque_ripple": {"ratio": 0.055, "pitch": pitch, "phase": 2.0}}
    measured = compare_with_model(stage_with(nominal, 41, x=there), nominal[1], 2)
    loop = FreeLoop("x", [measured], nominal[1], TOLERANCE["x"])
    dictionary = FreeDictionary(loop, fit_free(loop, loop.start, 0))
    (best,) = dictionary.best(library()["torque_ripple"])
    found = dict(zip(("ratio", "pitch", "phase"), best.term.values, strict=True))
    assert found["pitch"] == pytest.approx(pitch, rel=0.015)
    assert found["ratio"] == pytest.approx(0.055, rel=0.4)
