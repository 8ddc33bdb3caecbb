"""Curves and models fitted to a force along a motion."""

from dataclasses import replace

import numpy as np
import pytest

from sim2real.open_loop import MotionLoop, measure_motion
from sim2real.rivals import Screen, find_rivals
from sim2real.rivals.coordinates import Coordinate
from tests.unit.sim2real.open_loop.test_motion import imported
from tests.unit.sim2real.other_machines import TOOL, sliding


def dragged(t, x, v, a):
    return 300.0 * a + sliding(v, 250.0, 400.0) + 3000.0 * v * np.abs(v)


@pytest.mark.parametrize("rate", [100.0, 1000.0])
def test_a_fast_log_is_compared_at_as_few_samples_as_its_cutoff_needs(rate, tmp_path):
    machine = replace(TOOL, rate=rate, force=dragged, known=("300", "250", "400"))
    recording, stage = imported(machine, tmp_path)
    motion = measure_motion(recording, stage)
    screen = Screen(MotionLoop("a", [motion], stage, 0.01))
    usable, cutoff = int(motion.axes["a"].usable.sum()), motion.axes["a"].cutoff
    assert usable >= screen.samples > 3.0 * cutoff * usable / rate
    assert screen.samples < 10.0 * cutoff * usable / rate
    best = find_rivals(screen).best
    assert (best.coordinate.over, screen.closed(best.prediction) > 0.95) == ("velocity", True)
    fast = np.abs(best.at) > 0.1
    assert best.force[fast] == pytest.approx((3000.0 * best.at * np.abs(best.at))[fast], rel=0.2)


def test_a_force_that_rises_steadily_is_straight_beside_what_wanders(tmp_path):
    wander = 0.03 * np.random.default_rng(5).standard_normal(200)

    def rubs_more(t, x, v, a):
        level = 1.0 + 2e-3 * t + np.interp(t, 0.5 * np.arange(200.0), wander)
        return 300.0 * a + sliding(v, 250.0 * level, 400.0)

    recording, stage = imported(
        replace(TOOL, force=rubs_more, known=("300", "250", "400")), tmp_path
    )
    screen = Screen(MotionLoop("a", [measure_motion(recording, stage)], stage, 0.01))
    rise = screen.curve(Coordinate("time", "time", "friction"))
    slopes = np.diff(rise.force) / np.diff(rise.at)
    assert slopes == pytest.approx(np.full(len(slopes), 0.5), rel=0.3)
