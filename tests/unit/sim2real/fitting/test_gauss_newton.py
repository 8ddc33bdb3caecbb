"""One axis tracked and fitted: innovations, their response to effects, models that cannot be."""

from __future__ import annotations

import numpy as np
import pytest

from hil_sim.effects.library import library
from hil_sim.settings import SUBSTEPS
from sim2real.fitting import NUISANCES, STEP, AxisModel, Term, fit
from tests.unit.sim2real.conftest import FINER, problem_of, stage_with


def test_innovations_of_the_right_model_are_white(nominal):
    recording, settings = nominal
    problem = problem_of(recording, settings, "x")
    found = fit(problem, problem.start, 2, thorough=False)
    innovations = problem.positions(found.residual)
    lagged = np.corrcoef(innovations[:-10], innovations[10:])[0, 1]
    assert 0.7 < innovations.std() < 1.1
    assert abs(lagged) < 0.1
    assert problem.is_white(found.residual)


def test_how_finely_a_stage_is_stepped_is_found_beside_its_figures(nominal):
    problem = problem_of(stage_with(nominal, 20), nominal[1], "y")
    found = fit(problem, problem.start, 4, thorough=False)
    assert found.model.base[STEP] == pytest.approx(1.0 - SUBSTEPS / FINER, abs=0.05)
    assert np.abs(found.model.base[:STEP]).max() < 5.0 * 0.003


def test_a_fit_steps_back_from_what_physics_forbids(nominal):
    problem = problem_of(*nominal)
    stiff = AxisModel(np.zeros(NUISANCES), (Term(library()["presliding_stiffness"], (1e4,)),))
    with pytest.raises(ValueError, match="too stiff"):
        problem.residual(stiff)
    (worst,) = problem.residuals_or_worst([stiff])
    assert problem.cost(stiff, worst) > 10.0 * problem.cost(
        problem.start, problem.residual(problem.start)
    )
