"""Models along a motion, in the terms of the free loop."""

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.effects.library import library
from sim2real.fitting import Term
from sim2real.open_loop import MotionLoop, compare_along, fit_figures, measure_motion
from tests.unit.sim2real.open_loop.test_motion import imported
from tests.unit.sim2real.other_machines import ROBOT, TOOL, sliding

KNOWN = replace(TOOL, known=("300", "250", "400"))


@pytest.fixture(scope="module")
def tool(tmp_path_factory):
    recording, stage = imported(KNOWN, tmp_path_factory.mktemp("tool"))
    return measure_motion(recording, stage), stage


def test_the_right_model_leaves_the_floor(tool):
    motion, stage = tool
    loop = MotionLoop("a", [motion], stage, 0.01)
    plain = loop.gap(loop.residual(loop.start))
    offset = loop.start.added(Term(library()["force_offset"], (80.0,)))
    assert plain > 30.0
    assert loop.gap(loop.residual(offset)) < 3.0


def test_a_gear_that_rubs_under_load_is_an_effect(tmp_path):
    """A joint whose motor has a quarter of the inertia, with a weight behind the gear."""

    def force(t, q, v, a):
        weight = 15.0 * np.sin(q + 0.3)
        return 1.2 * a + weight + sliding(v, 4.0 + 0.15 * np.abs(0.9 * a + weight), 3.0)

    gear = replace(ROBOT, force=force, noise=(1e-6, 0.3), rate=500.0, known=("1.2", "4", "3"))
    recording, stage = imported(gear, tmp_path)
    motion = measure_motion(recording, stage)
    stiff = fit_figures([motion], stage, {"a": ("stiffness",)})
    loop = MotionLoop("a", [motion], stiff, 0.01)
    unbalanced = loop.start.added(Term(library()["unbalance"], (15.0, 0.3)))
    loaded = unbalanced.added(Term(library()["load_friction"], (0.15, 0.25)))
    before, after = (loop.gap(loop.residual(model)) for model in (unbalanced, loaded))
    assert before > 10.0 * after


def test_the_gap_is_that_of_the_force_alone(tool):
    motion, stage = tool
    measured = compare_along(motion, stage)
    loop = MotionLoop("a", [motion], stage, 0.01)
    figures = measured.gap["a"]
    assert set(figures) == {"force"}
    ratio = (figures["force"].nominal / figures["force"].floor) ** 2
    assert loop.gap(loop.residual(loop.start)) == pytest.approx(2.0 * ratio, rel=1e-6)
    usable = motion.axes["a"].usable
    assert np.mean(measured.residual["a"]["force"][usable]) == pytest.approx(80.0, rel=0.05)
