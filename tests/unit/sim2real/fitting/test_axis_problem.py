"""The cost of an axis: whiteness, gains, and models that physics does not allow."""

from __future__ import annotations

import numpy as np
import pytest

from hil_sim.effects.library import library
from sim2real.fitting import NUISANCES, AxisModel, Term, fit
from sim2real.fitting.axis_problem import slow_energy
from tests.unit.sim2real.conftest import problem_of, stage_with


def test_structure_of_white_noise_is_one_and_of_a_drift_is_more():
    rng = np.random.default_rng(5)
    noise = rng.standard_normal(20_000)
    assert slow_energy(noise) == pytest.approx(1.0, abs=0.25)
    assert slow_energy(noise + np.sin(np.arange(20_000) / 50.0)) > 3.0


def test_gains_of_another_model_change_every_cost(nominal):
    recording = stage_with(nominal, 21, x={"coulomb_level": {"ratio": 1.3}})
    problem = problem_of(recording, nominal[1])
    known = Term(library()["coulomb_level"], (1.3,))
    before = fit(problem, AxisModel(np.zeros(NUISANCES), (known,)), 2, thorough=False)
    problem.retune(before.model)
    after = problem.reweighted(before)
    assert after.cost < before.cost  # the filter that knows the friction foretells more
    assert after.cost == problem.cost(after.model, after.residual)
