"""Models of an axis: base parameters, effects, and the stage they make."""

import numpy as np
import pytest

from hil_sim.effects.library import library
from hil_sim.settings import SUBSTEPS
from sim2real.fitting import NUISANCES, STEP, AxisModel, Term, compose_stage, with_base


def test_base_parameters_are_relative_deviations(stage):
    axis = stage.axes[0]
    base = np.zeros(NUISANCES)
    base[:2] = (0.02, -0.1)  # mass, coulomb
    moved = with_base(axis, base)
    assert moved.mass == pytest.approx(1.02 * axis.mass)
    assert moved.friction.coulomb == pytest.approx(0.9 * axis.friction.coulomb)
    assert moved.friction.viscous == axis.friction.viscous


def test_effects_are_added_changed_and_removed(stage):
    cogging = Term(library()["cogging"], (0.3, 0.03, 1.0))
    offset = Term(library()["force_offset"], (0.5,))
    both = AxisModel(np.zeros(NUISANCES)).added(cogging).added(offset)
    assert both.names() == ("cogging", "force_offset")
    assert both.with_value(0, "pitch", 0.04).terms[0].values == (0.3, 0.04, 1.0)
    assert both.without(0).names() == ("force_offset",)
    composed = compose_stage(stage, {"x": both})
    assert [e.effect.name for e in composed.axes[0].effects] == ["cogging", "force_offset"]
    assert composed.axes[1] == stage.axes[1]


def test_the_refinement_is_in_plant_steps():
    base = np.zeros(NUISANCES)
    base[STEP] = 0.5
    assert AxisModel(base).substeps == 2.0 * SUBSTEPS
