"""The stage stepped in control ticks, against the batch simulation."""

import numpy as np
import pytest

from hil_sim.plant import Plant, simulate
from hil_sim.ports import SetpointBlock
from tests.unit.hil_sim.inputs import effect_of, smooth_demand


def test_stepping_and_batch_are_the_same_to_the_bit(nominal):
    rng = np.random.default_rng(4)
    demand = np.cumsum(rng.normal(0.0, 2e-6, (120, 2)), axis=0)
    demand -= demand[0]
    offset = rng.normal(0.0, 1.0, (120, 2))
    offset[0] = 0.0
    batch = simulate(nominal, demand, offset, 7)
    plant = Plant(nominal, 7)
    for a in range(2):
        plant.power(a, True)
    seen = []
    for k in range(len(demand)):
        plant.advance_to(k * 1_000_000)
        seen.append([plant.encoder(a) * nominal.axes[a].increment for a in range(2)])
        for a in range(2):
            plant.command(a, demand[k, a], offset[k, a], nominal.ticks)
    np.testing.assert_array_equal(np.round(np.array(seen) / 1e-9), np.round(batch.position / 1e-9))


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


def test_stepping_with_effects_is_the_batch(nominal, with_effects, effects):
    demand = smooth_demand(11, 120)
    stage = with_effects(
        nominal,
        effects["dead_time"].at(delay=0.00042),
        effects["floor_vibration"].at(amplitude=0.5, frequency=40.0, phase=0.3),
        effects["thermal_drift"].at(amplitude=0.3, time_constant=0.1),
        y=(effects["base_motion"].at(frequency=8.0, damping=0.1, mass_ratio=0.03),),
    )
    batch = simulate(stage, demand, 0.0 * demand, 7)
    plant = Plant(stage, 7)
    for a in range(2):
        plant.power(a, True)
    seen = []
    for k in range(len(demand)):
        plant.advance_to(k * 1_000_000)
        seen.append([plant.encoder(a) for a in range(2)])
        for a in range(2):
            plant.command(a, demand[k, a], 0.0, stage.ticks)
    np.testing.assert_array_equal(np.array(seen), np.round(batch.position / 1e-9))


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


MS = 1_000_000
WIDE = np.tile([-1e12, 1e12, 1.0], (2, 1))


def powered(settings):
    """A plant that has been commanded to stay where it is, 1 ms ago."""
    plant = Plant(settings, 7)
    for a in range(2):
        plant.power(a, True)
    plant.advance_to(MS)
    for a in range(2):
        plant.command(a, 0.0, 0.0, settings.ticks)
    return plant


def one_by_one(plant, first, demand, offset, ticks):
    """Reports of the same instants, each advanced to by itself."""
    seen = []
    for k in range(len(demand)):
        plant.advance_to(first + k * MS)
        values = [
            [getattr(plant, name)(a) for name in ("encoder", "force", "demand", "velocity")]
            for a in range(2)
        ]
        for a in range(2):
            plant.command(a, demand[k, a], offset[k, a], ticks)
            values[a].append(plant.following_error(a))
        seen.append(values)
    return np.array(seen)


def test_a_block_of_instants_is_one_instant_after_the_other(nominal):
    """Also across the end of the noise drawn, before which a block ends."""
    demand = smooth_demand(5, 900)
    offset = np.linspace(-2.0, 2.0, 1800).reshape(900, 2)
    expected = one_by_one(powered(nominal), 2 * MS, demand, offset, nominal.ticks)
    plant, reports, done, sizes = powered(nominal), [], 0, []
    while done < len(demand):
        part = slice(done, done + 25)
        block = SetpointBlock((2 + done) * MS, MS, demand[part], offset[part], nominal.ticks, WIDE)
        plant.run_block(block)
        sizes.append(len(block.reports))
        reports.append(block.reports)
        done += sizes[-1]
        if sizes[-1] < len(block.positions):
            part = slice(done, done + 1)
            first = (2 + done) * MS
            reports.append(one_by_one(plant, first, demand[part], offset[part], nominal.ticks))
            done += 1
    np.testing.assert_array_equal(np.concatenate(reports), expected)
    assert max(sizes) == 25
    assert min(sizes) < 25


@pytest.mark.parametrize("column", [0, 4], ids=["counts", "following error"])
def test_a_block_ends_before_the_instant_at_which_a_bound_is_passed(nominal, column):
    demand = np.tile(1e-9 * np.arange(60.0)[:, None] ** 3, 2)
    offset = np.zeros_like(demand)
    expected = one_by_one(powered(nominal), 2 * MS, demand, offset, nominal.ticks)
    limit = expected[:30, 1, column].max()
    beyond = int((expected[:, 1, column] > limit).argmax())
    bounds = WIDE.copy()
    bounds[1, 1 if column == 0 else 2] = limit
    plant = powered(nominal)
    block = SetpointBlock(2 * MS, MS, demand, offset, nominal.ticks, bounds)
    plant.run_block(block)
    assert len(block.reports) == beyond > 0
    assert plant.time_ns == (2 + beyond) * MS
    rest = one_by_one(plant, plant.time_ns, demand[beyond:], offset[beyond:], nominal.ticks)
    np.testing.assert_array_equal(np.concatenate([block.reports, rest]), expected)


@pytest.mark.parametrize(
    "first", [2 * MS + 1, 3 * MS], ids=["inside a tick", "a SYNC was left out"]
)
def test_a_block_that_does_not_continue_the_grid_is_left_to_single_steps(nominal, first):
    plant = powered(nominal)
    block = SetpointBlock(first, MS, np.zeros((5, 2)), np.zeros((5, 2)), nominal.ticks, WIDE)
    plant.run_block(block)
    assert (len(block.reports), plant.time_ns) == (0, MS)
