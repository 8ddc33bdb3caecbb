"""What no effect explains, described."""

from dataclasses import replace

import numpy as np
import pytest

from sim2real.open_loop import compare_along, describe_residual, measure_motion
from tests.unit.sim2real.open_loop.test_motion import imported
from tests.unit.sim2real.other_machines import TOOL

KNOWN = ("300", "250", "400")


def odd(t, x, v, a):
    """A force that no effect of the library has, beside the known machine's."""
    over_place = 60.0 * np.cos(2.0 * np.pi * x / 0.4) + 40.0 * np.sign(v) * (x > 0.2) * (x - 0.2)
    return TOOL.force(t, x, v, a) - 80.0 + over_place + 900.0 * v * np.abs(v)


def described(machine, folder):
    recording, stage = imported(machine, folder)
    motion = measure_motion(recording, stage)
    return describe_residual("a", [motion], [compare_along(motion, stage)], stage)


def test_a_force_of_any_smooth_shape(tmp_path):
    found = described(replace(TOOL, force=odd, known=KNOWN), tmp_path)
    assert found.gap_closed > 0.9
    place = np.array(found.position)
    always = np.array(found.always)
    expected = 60.0 * np.cos(2.0 * np.pi * place / 0.4)
    assert np.std((always - expected)[1:-1]) < 0.25 * np.std(expected)
    assert found.over_velocity[0] < 0.0 < found.over_velocity[-1]
    assert found.over_velocity[len(found.over_velocity) // 2] == 0.0
    assert len(found.velocity) == len(found.over_velocity)


def test_noise_is_not_described(tmp_path):
    plain = replace(TOOL, force=lambda *args: TOOL.force(*args) - 80.0, known=KNOWN)
    assert described(plain, tmp_path) is None


def test_forces_that_change_within_a_period_are_not_described(nominal):
    recording, stage = nominal  # accelerates at the same places again and again
    motion = measure_motion(recording, stage)
    along = compare_along(motion, stage)
    floor = along.floor.rms["x"]["force"]
    assert np.std(along.residual["x"]["force"][motion.axes["x"].usable]) > 5.0 * floor
    for name in ("x", "y"):
        assert describe_residual(name, [motion], [along], stage) is None


def test_it_is_a_table_beside_the_model(tmp_path):
    found = described(replace(TOOL, force=odd, known=KNOWN), tmp_path)
    coulomb = 250.0
    assert found.coulomb == pytest.approx(
        np.maximum(1.0 + np.array(found.against) / coulomb, 0.0), rel=1e-6
    )
    assert found.table()["force"] == found.always


@pytest.mark.parametrize(
    "key", ["position", "always", "against", "coulomb", "velocity", "over_velocity"]
)
def test_it_is_plain_json(tmp_path, key):
    found = described(replace(TOOL, force=odd, known=KNOWN), tmp_path).to_json()
    assert all(isinstance(value, float) for value in found[key])
