"""Ports beyond the library's effects, what is refused, and that the plain plant stays as it was."""

from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest

from hil_sim.effects.ports import EffectPorts
from hil_sim.plant import needs_all_axes, simulate
from tests.unit.hil_sim.inputs import MASS, both_steps, change_axes, effect_of, smooth_demand


@both_steps
def test_force_over_time(free, with_effects, pushed, substeps):
    push = effect_of(lambda ports: ports.add_time_force(-2.0 * ports.times))
    time, position = pushed(with_effects(free, push), 0.0, substeps=substeps)
    np.testing.assert_allclose(position, 2.0 / MASS * time**3 / 6.0, atol=2e-3 * 4e-5)


@both_steps
def test_misreading_encoder(nominal, with_effects, substeps):
    # The loop keeps the reading on the demand: the carriage is off by the error, and the motor has
    # to accelerate it along.
    def error(x):
        return 2e-6 * np.sin(2.0 * np.pi * x / 0.02)

    bent = effect_of(lambda ports: ports.add_misreading(error(ports.positions)))
    rows = 800
    speed = 0.1 * np.minimum(np.arange(rows) / 100.0, 1.0)
    demand = np.column_stack([np.cumsum(speed) * 1e-3, np.zeros(rows)])
    quiet = change_axes(nominal, {"coulomb": 1e-9, "viscous": 0.0, "stiffness": 1e-6})
    response = simulate(
        with_effects(quiet, bent), demand, 0.0 * demand, None, substeps=substeps, rounded=False
    )
    cruise = slice(400, None)
    rate = 2.0 * np.pi * 0.1 / 0.02
    expected = MASS * rate**2 * error(response.position[cruise, 0])
    np.testing.assert_allclose(response.force[cruise, 0], expected, atol=0.1 * np.ptp(expected))
    assert np.ptp(response.position[cruise, 0] - demand[cruise, 0]) < 1e-6


@both_steps
def test_field_over_both_positions(nominal, with_effects, substeps):
    # Fc rises along y: x slides at one speed while y moves, and its friction follows y.
    grid = np.linspace(-0.15, 0.15, 31)
    field = effect_of(
        lambda ports: ports.scale_field_coulomb(
            grid, grid, np.broadcast_to(1.0 + 4.0 * grid, (31, 31)).copy()
        )
    )
    rows = 1000
    speed = 0.05 * np.minimum(np.arange(rows) / 50.0, 1.0)
    demand = np.column_stack([np.cumsum(speed) * 1e-3, 0.5 * np.cumsum(speed) * 1e-3])
    stage = with_effects(nominal, field)
    response = simulate(stage, demand, 0.0 * demand, None, substeps=substeps, rounded=False)
    across = response.position[300:, 1] - 0.025 * 0.01  # the elements follow 10 ms late
    expected = 6.0 * (1.0 + 4.0 * across) + 20.0 * 0.05
    np.testing.assert_allclose(response.force[300:, 0], expected, atol=0.02)
    assert needs_all_axes(stage)
    assert not needs_all_axes(nominal)


def test_an_effect_that_does_nothing_changes_nothing(nominal, with_effects, effects):
    demand = smooth_demand(6)
    idle = with_effects(
        nominal,
        effects["coulomb_level"].at(ratio=1.0),
        effects["payload_mass"].at(mass=0.0),
        effects["force_constant"].at(ratio=1.0),
        effects["dead_time"].at(delay=0.0),
        effects["resonance"].at(frequency=100.0, damping=0.02, mass_ratio=0.0),
        effects["viscous_damping"].at(ratio=1.0),
    )
    one = simulate(idle, demand, 0.0 * demand, 4)
    other = simulate(nominal, demand, 0.0 * demand, 4)
    assert one.position.tobytes() == other.position.tobytes()
    assert one.force.tobytes() == other.force.tobytes()


def test_mismatched_shapes_and_impossible_effects_are_refused(nominal, with_effects, effects):
    zero = np.zeros((5, 2))
    stage = with_effects(
        nominal, *[effects["resonance"].at(frequency=90, damping=0.02, mass_ratio=0.6)] * 2
    )
    with pytest.raises(ValueError, match=r"axis x: effects hang 1\.2 of the mass"):
        simulate(stage, zero, zero, None)
    stage = with_effects(nominal, effects["cross_coupling"].at(mass=0.3))
    with pytest.raises(ValueError, match="axis x: an effect that involves the other axis"):
        simulate(replace(stage, axes=stage.axes[:1]), zero[:, :1], zero[:, :1], None)
    with pytest.raises(ValueError, match=r"level must have shape \(5, 2\)"):
        simulate(nominal, zero, zero, None, level=np.ones((4, 2)))
    wrong = effect_of(lambda ports: ports.add_position_force(np.ones(3)))
    with pytest.raises(ValueError, match=r"axis x: own: table has shape \(3,\)"):
        simulate(with_effects(nominal, wrong), zero, zero, None)
    endless = effect_of(lambda ports: ports.scale_position_gain(ports.positions / 0.0))
    with np.errstate(all="ignore"), pytest.raises(ValueError, match="not finite"):
        simulate(with_effects(nominal, endless), zero, zero, None)


@both_steps
@pytest.mark.parametrize("scale", [0.1, 10.0])
def test_extreme_values_are_simulated_or_refused(nominal, with_effects, effects, substeps, scale):
    demand = 30.0 * smooth_demand(9, 300)
    for effect in (e for e in effects.values() if e.searched):
        for axis_range in (0, -1):
            values = {
                p.key: scale * p.ranges(nominal.axes[0])[axis_range][1] for p in effect.parameters
            }
            with suppress(ValueError):  # refused
                stage = with_effects(nominal, effect.at(**values))
                response = simulate(stage, demand, 0.0 * demand, 1, substeps=substeps)
                assert np.isfinite(response.position).all(), effect.name
                assert np.isfinite(response.force).all(), effect.name


@both_steps
@pytest.mark.parametrize(
    ("name", "values", "reason"),
    [
        ("payload_mass", {"mass": -7.9999999}, "N s/m on 1e-07 kg cannot be simulated in 1000"),
        ("viscous_damping", {"ratio": 1e8}, r"friction of 2e\+09 N s/m on 8 kg cannot"),
        ("presliding_stiffness", {"ratio": 1e9}, "springs of 6e.14 N/m on 8 kg cannot"),
        ("cable_hysteresis", {"force": 1.0, "stiffness": 1e15}, "springs of 1e.15 N/m on 8 kg"),
    ],
)
def test_dynamics_too_fast_for_the_steps_are_refused(
    nominal, with_effects, effects, substeps, name, values, reason
):
    stage = with_effects(nominal, effects[name].at(**values))
    with pytest.raises(ValueError, match=reason):
        simulate(stage, np.zeros((5, 2)), np.zeros((5, 2)), None, substeps=substeps)


def test_nodes_cover_travel_speed_and_time(nominal):
    axis = nominal.axes[0]
    ports = EffectPorts(axis, 1e-3, 2.0)
    assert ports.positions[0] < axis.travel[0] - 5e-3
    assert ports.positions[-1] > axis.travel[1] + 5e-3
    assert ports.velocities[-1] > axis.velocity
    assert ports.velocities[len(ports.velocities) // 2] == 0.0
    assert ports.times[0] == 0.0
    assert ports.times[-1] >= 2.0
