"""Where a fit of an effect starts."""

from __future__ import annotations

import numpy as np
import pytest

from hil_sim.effects.library import library
from sim2real.attribution import signature_similarity
from sim2real.attribution.candidates import TrackedDictionary, summit
from tests.unit.sim2real.conftest import problem_of, stage_with


def test_a_wander_with_a_course_is_a_start_for_what_scales_friction(nominal):
    recording = stage_with(nominal, 17, y={"coulomb_level": {"ratio": 0.9}})
    settings = nominal[1]
    problem = problem_of(recording, settings, "y")
    start = problem.nominal_fit()
    dictionary = TrackedDictionary(
        problem, start, problem.base_columns(start.model, start.residual)
    )
    known = library()
    followed = dictionary.follow(known["coulomb_level"])
    assert len(followed) == 1
    assert followed[0].term.values[0] == pytest.approx(0.9, abs=0.03)
    assert not dictionary.follow(known["force_offset"])
    offsets = dictionary.best(known["force_offset"])
    signatures = {"coulomb_level": followed[0].signature, "force_offset": offsets[0].signature}
    ((_, alike),) = signature_similarity(signatures, list(signatures)).items()
    assert 0.0 < alike < 0.5


def test_a_vibration_starts_at_its_frequency(nominal):
    """Half a line of a short recording's spectrum off, a third of its size would be missing."""
    floor = library()["floor_vibration"]
    there = {"amplitude": 0.6, "frequency": 23.125, "phase": 3.14}
    settings = nominal[1]
    problem = problem_of(stage_with(nominal, 17, y={"floor_vibration": there}), settings, "y")
    start = problem.nominal_fit()
    dictionary = TrackedDictionary(
        problem, start, problem.base_columns(start.model, start.residual)
    )
    found = dict(zip(there, dictionary.best(floor)[0].term.values, strict=True))
    assert found["frequency"] == pytest.approx(there["frequency"], abs=0.01)


@pytest.mark.parametrize("lines", [[9.0, 8.0, 7.5, 7.2], [7.2, 7.5, 8.0, 9.0]])
def test_a_slope_of_a_spectrum_has_no_top_far_away(lines):
    """Of a band the highest line is at its edge where the spectrum falls into it."""
    assert all(abs(summit(np.array(lines), line) - line) <= 0.5 for line in range(4))
    assert summit(np.array([1.0, 4.0, 3.0]), 1) == pytest.approx(1.25)
