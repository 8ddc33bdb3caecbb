"""The floor of a force out of strokes that repeat."""

from dataclasses import replace

import numpy as np
import pytest

from sim2real.open_loop import compare_along, measure_motion
from tests.unit.sim2real.open_loop.test_motion import imported
from tests.unit.sim2real.other_machines import TOOL, sliding, strokes

COULOMB = 250.0
PERIOD = 1.7
"""Of a stroke [s], about: each has friction of its own."""


DRAWN = np.random.default_rng(3).standard_normal(200)
SPREAD = float(np.std(DRAWN[:36]))


def floor_of(folder, wander, motion=None, bump=0.0):
    level = 1.0 + wander * DRAWN

    def wandering(t, x, v, a):
        force = 300.0 * a + sliding(v, COULOMB * level[(t / PERIOD).astype(int)], 400.0)
        return force + bump * np.sin(40.0 * x)

    known = ("300", "250", "400")
    machine = replace(TOOL, force=wandering, known=known, duration=60.0, noise=(1e-8, 0.5))
    recording, stage = imported(
        machine if motion is None else replace(machine, motion=motion), folder
    )
    return compare_along(measure_motion(recording, stage), stage).floor.rms["a"]["force"]


@pytest.mark.parametrize("bump", [0.0, 100.0])
@pytest.mark.parametrize("wander", [0.03, 0.1])
def test_it_is_the_scatter_of_repeated_strokes_whatever_the_model_lacks(tmp_path, wander, bump):
    same = strokes(0.4, (0.3,), 3.0)
    found = floor_of(tmp_path, wander, same, bump)  # a median of some 30 repetitions
    assert 0.6 < found / (wander * SPREAD * COULOMB) < 1.7


def test_a_drift_from_stroke_to_stroke_is_no_scatter(tmp_path):
    def rising(t, x, v, a):
        return 300.0 * a + sliding(v, COULOMB * (1.0 + t / 60.0), 400.0)

    machine = replace(TOOL, force=rising, known=("300", "250", "400"), duration=60.0)
    machine = replace(machine, noise=(1e-8, 0.5), motion=strokes(0.4, (0.3,), 3.0))
    recording, stage = imported(machine, tmp_path)
    floor = compare_along(measure_motion(recording, stage), stage).floor.rms["a"]["force"]
    assert floor < 0.01 * COULOMB


def test_where_none_repeat_one_percent_is_assumed(tmp_path):
    def never_again(t):
        return 0.2 + 0.15 * np.sin(2.0 * t) * (0.3 + t / 100.0)

    wild, calm = (floor_of(tmp_path, wander, never_again) for wander in (0.2, 0.0))
    assert wild == pytest.approx(calm, rel=0.2)
    assert calm == pytest.approx(0.01 * COULOMB, rel=0.5)
