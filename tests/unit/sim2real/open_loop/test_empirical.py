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
    return describe_residual("a", [motion], [compare_along(motion, stage)])


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


@pytest.mark.parametrize("key", ["position", "always", "against", "velocity", "over_velocity"])
def test_it_is_plain_json(tmp_path, key):
    found = described(replace(TOOL, force=odd, known=KNOWN), tmp_path).to_json()
    assert all(isinstance(value, float) for value in found[key])
