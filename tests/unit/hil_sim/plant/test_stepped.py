"""The stage stepped in control ticks, against the batch simulation."""

import numpy as np
import pytest

from hil_sim.plant import Plant, simulate
from tests.unit.hil_sim.inputs import effect_of, smooth_demand


@pytest.mark.parametrize("loaded", [False, True])
def test_stepping_and_batch_are_the_same_to_the_bit(nominal, with_effects, effects, loaded):
    demand = smooth_demand(11, 120)
    offset = np.random.default_rng(4).normal(0.0, 1.0, demand.shape)
    offset[0] = 0.0
    stage = with_effects(
        nominal,
        effects["dead_time"].at(delay=0.00042),
        effects["floor_vibration"].at(amplitude=0.5, frequency=40.0, phase=0.3),
        effects["thermal_drift"].at(amplitude=0.3, time_constant=0.1),
        y=(effects["base_motion"].at(frequency=8.0, damping=0.1, mass_ratio=0.03),),
    )
    stage = stage if loaded else nominal
    batch = simulate(stage, demand, offset, 7)
    plant = Plant(stage, 7)
    for a in range(2):
        plant.power(a, True)
    seen = []
    for k in range(len(demand)):
        plant.advance_to(k * 1_000_000)
        seen.append([plant.encoder(a) for a in range(2)])
        for a in range(2):
            plant.command(a, demand[k, a], offset[k, a], stage.ticks)
    np.testing.assert_array_equal(np.array(seen), np.round(batch.position / 1e-9))


def test_advance_does_not_go_back(nominal):
    plant = Plant(nominal, 1)
    plant.advance_to(5_000_000)
    assert plant.time_ns == 5_000_000
    before = plant.encoder(0)
    plant.advance_to(3_000_000)
    assert (plant.time_ns, plant.encoder(0)) == (5_000_000, before)


def test_power_off_leaves_no_force(nominal):
    plant = Plant(nominal, None)
    plant.power(0, True)
    plant.command(0, 1e-3, 10.0, 10)
    plant.advance_to(5_000_000)
    assert plant.force(0) > 1.0
    plant.power(0, False)
    plant.advance_to(15_000_000)
    assert plant.force(0) == pytest.approx(0.0, abs=1e-6)


def test_time_begins_when_setpoints_do(nominal, with_effects):
    blow = effect_of(lambda ports: ports.add_time_force(np.where(ports.times > 0.06, 3.0, 0.0)))
    plant = Plant(with_effects(nominal, blow), None)
    plant.power(0, True)
    plant.advance_to(50_000_000)
    plant.start_clock()
    forces = []
    for k in range(1, 100):
        plant.advance_to(50_000_000 + k * 1_000_000)
        forces.append(plant.force(0))
        plant.start_clock()  # for every axis, and again: once is enough
    assert np.abs(forces[:59]).max() < 0.01
    assert np.abs(forces[61:]).min() > 0.1
