"""Models along a motion, in the terms of the free loop."""

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.effects.library import library
from sim2real.fitting import Term
from sim2real.open_loop import MotionLoop, compare_along, measure_motion
from tests.unit.sim2real.open_loop.test_motion import imported
from tests.unit.sim2real.other_machines import TOOL

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
