"""Figures that a machine file leaves unknown."""

from dataclasses import replace

import pytest

from sim2real.open_loop import fit_figures, measure_motion
from tests.unit.sim2real.open_loop.test_motion import imported
from tests.unit.sim2real.other_machines import BELT, TOOL


def test_figures_beside_a_force_that_is_nobodys(tmp_path):
    recording, stage = imported(TOOL, tmp_path)
    found = fit_figures([measure_motion(recording, stage)], stage, {"a": ("mass", "coulomb")})
    axis = fit_figures(
        [measure_motion(recording, found)], stage, {"a": ("mass", "coulomb", "viscous")}
    ).axes[0]
    assert axis.mass == pytest.approx(300.0, rel=0.02)
    assert axis.friction.coulomb == pytest.approx(250.0, rel=0.02)
    assert axis.friction.viscous == pytest.approx(400.0, rel=0.05)


def test_what_is_known_stays(tmp_path):
    recording, stage = imported(replace(BELT, known=("12", "20", "18")), tmp_path)
    motion = measure_motion(recording, stage)
    axis = fit_figures([motion], stage, {"a": ("coulomb", "stiffness")}).axes[0]
    assert (axis.mass, axis.friction.viscous) == (12.0, 18.0)
    reach = stage.axes[0].friction.coulomb / stage.axes[0].friction.stiffness
    assert axis.friction.coulomb / axis.friction.stiffness == pytest.approx(reach)


def test_a_force_with_the_wrong_sign_has_no_mass(tmp_path):
    recording, stage = imported(TOOL, tmp_path)
    signals = recording.axes["a"]
    turned = replace(recording, axes={"a": replace(signals, force_actual=-signals.force_actual)})
    with pytest.raises(ValueError, match="axis a: the mass is unknown"):
        fit_figures([measure_motion(turned, stage)], stage, {"a": ("mass",)})
