"""A stage as arrays: at rest, balanced, and what cannot be stepped is refused."""

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.plant.arrays import Arrays
from tests.unit.hil_sim.inputs import effect_of


def test_at_the_start_everything_is_at_rest_where_the_encoder_says(nominal):
    arrays = Arrays(nominal, (0.0123456789, -0.05))
    for a, axis in enumerate(nominal.axes):
        reading = float(arrays.state[a]["encoder"])
        assert reading == pytest.approx((0.0123456789, -0.05)[a], abs=0.5 * axis.increment)
        assert reading / axis.increment == pytest.approx(round(reading / axis.increment))
        assert arrays.loop[a]["demand"] == reading
        assert arrays.state[a]["velocity"] == 0.0
    assert not arrays.forces.any()


def test_a_reading_error_is_taken_off_the_true_position(nominal, with_effects):
    misread = effect_of(lambda ports: ports.add_misreading(np.full_like(ports.positions, 2e-6)))
    arrays = Arrays(with_effects(nominal, misread), (0.01, 0.0))
    assert arrays.state[0]["position"] == pytest.approx(0.01 - 2e-6)
    assert arrays.state[0]["encoder"] == pytest.approx(0.01)


def test_motor_friction_and_disturbance_hold_each_other(nominal, with_effects, effects):
    spring = effects["cable_stiffness"].at(stiffness=20.0, center=0.0)
    constant = effects["force_constant"].at(ratio=0.9)
    stage = with_effects(nominal, spring, constant)
    arrays = Arrays(stage, (0.05, 0.0))
    arrays.balance(0, 2.0, stage.axes[0])
    friction = arrays.forces[:10].sum()
    assert friction == pytest.approx(0.9 * 2.0 - 20.0 * 0.05)
    assert arrays.state[0]["motor_force"] == pytest.approx(2.0)
    assert arrays.loop[0]["integral"] == pytest.approx(2.0)
    assert not arrays.forces[10:].any()  # the other axis


@pytest.mark.parametrize(
    ("name", "values", "level"),
    [
        ("coulomb_level", {"ratio": 1.2}, 1.2),
        ("thermal_drift", {"amplitude": 0.3, "time_constant": 20.0}, 1.3),
        ("friction_position", {"amplitude": 0.4, "center": 0.05, "width": 0.01}, 1.4),
        ("friction_spot", {"amplitude": 0.4, "center": 0.05, "other": -0.02, "width": 0.01}, 1.4),
    ],
)
def test_friction_holds_at_the_start_what_it_does_there_and_then(
    nominal, with_effects, effects, name, values, level
):
    stage = with_effects(nominal, effects[name].at(**values))
    arrays = Arrays(stage, (0.05, -0.02), 1.0)
    arrays.balance(0, 100.0, stage.axes[0])
    friction = nominal.axes[0].friction
    static = level * friction.coulomb * (1.0 + friction.static_ratio)
    assert arrays.state[0]["friction"] == pytest.approx(static, rel=2e-3)


@pytest.mark.parametrize("substeps", [2, 3, 4])
def test_steps_between_coarse_and_reference_are_refused(nominal, substeps):
    with pytest.raises(ValueError, match=f"substeps must be 1 or at least 5, is {substeps}"):
        Arrays(nominal, (0.0, 0.0), substeps=substeps)


def test_the_coarse_step_needs_gms(nominal):
    figures = replace(
        nominal.axes[1].friction, law="coulomb", elements=0, stiffness=0.0, relaxation_rate=0.0
    )
    stage = replace(nominal, axes=(nominal.axes[0], replace(nominal.axes[1], friction=figures)))
    with pytest.raises(ValueError, match="axis y: the friction law coulomb needs at least 5"):
        Arrays(stage, (0.0, 0.0), substeps=1)
    assert len(Arrays(stage, (0.0, 0.0)).forces) == nominal.axes[0].friction.elements
