"""Effects on friction: forces of a stage moved by its closed loop, against the equations."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hil_sim.plant import simulate

FC, VISCOUS = 6.0, 20.0  # of axis x
SPEED = 0.1

both_steps = pytest.mark.parametrize("substeps", [5, 1])


@pytest.fixture(scope="module")
def sliding(nominal):
    """Axis x driven at ± SPEED for 0.6 s after a quick start: time, position, force of x."""

    def run(stage, direction=1.0, *, start=0.0, substeps=5, rows=600):
        speed = direction * SPEED * np.minimum(np.arange(rows) / 50.0, 1.0)
        demand = np.zeros((rows, 2))
        demand[:, 0] = start + np.cumsum(speed) * stage.sync_period
        response = simulate(
            stage, demand, np.zeros_like(demand), None, substeps=substeps, rounded=False
        )
        settled = slice(200, None)
        time = stage.sync_period * np.arange(rows)
        return time[settled], response.position[settled, 0], response.force[settled, 0]

    return run


@both_steps
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_coulomb_level_and_asymmetry_multiply(
    nominal, with_effects, effects, sliding, substeps, direction
):
    stage = with_effects(
        nominal,
        effects["coulomb_level"].at(ratio=1.25),
        effects["friction_asymmetry"].at(ratio=0.1),
    )
    _, _, force = sliding(stage, direction, substeps=substeps)
    expected = direction * (FC * 1.25 * (1.0 + 0.1 * direction) + VISCOUS * SPEED)
    assert force[-100:].mean() == pytest.approx(expected, abs=2e-3)


@both_steps
def test_friction_position_is_a_bell(nominal, with_effects, effects, sliding, substeps):
    spot = effects["friction_position"].at(amplitude=0.5, center=0.03, width=6e-3)
    _, position, force = sliding(with_effects(nominal, spot), substeps=substeps)
    factor = 1.0 + 0.5 * np.exp(-0.5 * ((position - 0.03) / 6e-3) ** 2)
    # The elements follow a changing level at the rate C/Fc = 100/s: 10 ms, 1 mm late.
    late = 1.0 + 0.5 * np.exp(-0.5 * ((position - 1e-3 - 0.03) / 6e-3) ** 2)
    assert force.max() > FC * 1.45 + VISCOUS * SPEED
    np.testing.assert_allclose(force, FC * late + VISCOUS * SPEED, atol=0.06)
    assert np.abs(force - FC * factor - VISCOUS * SPEED).max() > 0.15


@both_steps
def test_thermal_drift_fades(nominal, with_effects, effects, sliding, substeps):
    drift = effects["thermal_drift"].at(amplitude=0.4, time_constant=0.5)
    time, _, force = sliding(with_effects(nominal, drift), substeps=substeps)
    # First-order lag of 10 ms behind an exponential: it is late by tau/(1 - tau/time_constant).
    late = 0.4 / (1.0 - 0.01 / 0.5) * np.exp(-time / 0.5)
    np.testing.assert_allclose(force, FC * (1.0 + late) + VISCOUS * SPEED, atol=0.02)


@both_steps
def test_where_friction_and_warm_up_meet_they_multiply(
    nominal, with_effects, effects, sliding, substeps
):
    drift = effects["thermal_drift"].at(amplitude=0.3, time_constant=100.0)
    spot = effects["friction_position"].at(amplitude=0.4, center=0.05, width=20e-3)
    time, position, force = sliding(with_effects(nominal, drift, spot), substeps=substeps)
    bell = 1.0 + 0.4 * np.exp(-0.5 * ((position - 1e-3 - 0.05) / 20e-3) ** 2)
    expected = FC * bell * (1.0 + 0.3 * np.exp(-time / 100.0)) + VISCOUS * SPEED
    np.testing.assert_allclose(force, expected, atol=0.03)


def test_stribeck_replaces_the_static_ratio(nominal, with_effects, effects):
    rng = np.random.default_rng(2)
    demand = np.cumsum(rng.normal(0.0, 3e-6, (400, 2)), axis=0)
    x, y = nominal.axes
    told = replace(nominal, axes=(replace(x, friction=replace(x.friction, static_ratio=1.1)), y))
    stage = with_effects(nominal, effects["stribeck"].at(static_ratio=1.1))
    zero = np.zeros_like(demand)
    one, other = simulate(stage, demand, zero, 3), simulate(told, demand, zero, 3)
    assert one.position.tobytes() == other.position.tobytes()
    plain = simulate(nominal, demand, zero, 3)
    assert np.abs(plain.position - one.position)[:, 0].max() > 1e-8
    assert plain.position[:, 1].tobytes() == one.position[:, 1].tobytes()


def test_coulomb_level_is_fc_and_c_together(nominal, with_effects, effects):
    rng = np.random.default_rng(5)
    demand = np.cumsum(rng.normal(0.0, 3e-6, (400, 2)), axis=0)
    x, y = nominal.axes
    scaled = replace(x.friction, coulomb=1.2 * 6.0, attraction=1.2 * x.friction.attraction)
    told = replace(nominal, axes=(replace(x, friction=scaled), y))
    stage = with_effects(nominal, effects["coulomb_level"].at(ratio=1.2))
    zero = np.zeros_like(demand)
    one, other = simulate(stage, demand, zero, None), simulate(told, demand, zero, None)
    np.testing.assert_allclose(one.position, other.position, atol=2e-9)


@both_steps
def test_presliding_stiffness_is_a_spring(nominal, with_effects, effects, pushed, substeps):
    # Far below the first element's limit friction is a spring sigma0 * ratio: with open loops the
    # mass swings on it between 0 and twice the static deflection.
    open_loop = replace(
        nominal,
        axes=tuple(
            replace(
                a,
                control=replace(a.control, kp=1e-9, ki=0.0, kd=0.0),
                friction=replace(a.friction, viscous=0.0),
                increment=1e-13,
            )
            for a in nominal.axes
        ),
    )
    stage = with_effects(open_loop, effects["presliding_stiffness"].at(ratio=0.5))
    time, position, _ = pushed(stage, 0.05, substeps=substeps, duration=0.1)
    rate = math.sqrt(0.5 * 6e5 / 8.0)
    late = np.maximum(time - 1.0 / (2.0 * math.pi * 1500.0), 0.0)
    expected = 0.05 / 3e5 * (1.0 - np.cos(rate * late))
    np.testing.assert_allclose(position, expected, atol=0.02 * 0.05 / 3e5)


@both_steps
def test_cable_hysteresis_is_a_loop(nominal, with_effects, effects, substeps):
    # Slow sine by the closed loop without other friction: the motor's force is H, at each position.
    bare = replace(
        nominal,
        axes=tuple(
            replace(a, friction=replace(a.friction, coulomb=1e-9, viscous=0.0, stiffness=1e-6))
            for a in nominal.axes
        ),
    )
    stage = with_effects(bare, effects["cable_hysteresis"].at(force=1.5, stiffness=2000.0))
    time = 1e-3 * np.arange(4000)
    demand = np.column_stack([2e-3 * (1.0 - np.cos(2.0 * np.pi * 0.5 * time)), 0.0 * time])
    response = simulate(stage, demand, 0.0 * demand, None, substeps=substeps, rounded=False)
    position, force = response.position[:, 0], response.force[:, 0]
    expected, held = np.zeros(len(time)), 0.0
    for k in range(1, len(time)):
        held = min(max(held + 2000.0 * (position[k] - position[k - 1]), -1.5), 1.5)
        expected[k] = held
    acceleration = 2e-3 * np.pi**2 * np.cos(np.pi * time)
    begun = slice(100, None)
    np.testing.assert_allclose(force[begun], (expected + 8.0 * acceleration)[begun], atol=0.03)
    # Work lost in the second cycle: 4 f (amplitude - f/k).
    cycle = slice(2000, 4000)
    lost = np.trapezoid(force[cycle], position[cycle])
    assert lost == pytest.approx(4.0 * 1.5 * (2e-3 - 1.5 / 2000.0), rel=0.01)
