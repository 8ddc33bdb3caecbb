"""The compiled stage: closed forms, stepping against batch, and the independent recordings."""

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from hil_sim.plant import Plant, simulate
from hil_sim.settings import StageSettings
from stagectl.config import load_machine, stage_settings

DATA = Path(__file__).parents[2] / "data"


@pytest.fixture(scope="module")
def stage() -> StageSettings:
    return stage_settings(load_machine())


def frictionless(stage: StageSettings) -> StageSettings:
    axes = []
    for axis in stage.axes:
        friction = replace(axis.friction, coulomb=1e-9, viscous=0.0, stiffness=1e-3, wander=0.0)
        axes.append(replace(axis, friction=friction, noise=0.0))
    return replace(stage, axes=tuple(axes))


def step_response(stage, demand, offset):
    return simulate(stage, np.column_stack([demand] * 2), np.column_stack([offset] * 2), None)


def test_constant_force_accelerates_a_free_mass(stage):
    free = frictionless(stage)
    loose = replace(
        free, axes=tuple(
            replace(a, control=replace(a.control, kp=1e-6, ki=0.0, kd=0.0)) for a in free.axes
        )
    )  # fmt: skip
    k = np.arange(101)
    response = step_response(loose, 0.0 * k, np.where(k > 0, 4.0, 0.0))
    # Half of the first SYNC period goes into the ramp of the offset, the current loop lags behind.
    lag = 1e-3 + 0.5 * (1e-3 - 1e-4) + 1.0 / (2 * np.pi * 1500.0)
    t = 0.1 - lag
    for a, mass in enumerate((8.0, 14.0)):
        assert response.position[-1, a] == pytest.approx(0.5 * 4.0 / mass * t**2, rel=2e-3)


def test_force_is_reported_in_thousandths_of_the_rated_force(stage):
    response = simulate(stage, np.zeros((50, 2)), np.full((50, 2), 1.234), 3)
    for a, axis in enumerate(stage.axes):
        counts = response.force[:, a] / (axis.control.rated_force / 1000.0)
        np.testing.assert_allclose(counts, np.round(counts), atol=1e-9)


def test_output_is_clamped_and_the_integrator_waits(stage):
    k = np.arange(300)
    demand = np.where((k > 10) & (k < 60), 5e-3, 0.0)
    response = step_response(frictionless(stage), demand, 0.0 * k)
    assert np.abs(response.force[:, 0]).max() <= 120.0 + 1e-9
    assert abs(response.position[-1, 0]) < 2e-5  # it comes back: nothing was wound up for long


def test_at_rest_nothing_happens(stage):
    start = np.tile([0.01, -0.02], (200, 1))
    response = simulate(stage, start, np.zeros((200, 2)), None)
    np.testing.assert_allclose(response.position, start, atol=1e-12)
    assert np.abs(response.force).max() == 0.0


def test_rest_force_is_balanced_by_friction(stage):
    start = np.zeros((300, 2))
    response = simulate(stage, start, np.zeros((300, 2)), None, rest_force=[4.0, -6.0])
    np.testing.assert_allclose(response.force, np.tile([4.0, -6.0], (300, 1)), atol=0.061)
    assert np.abs(response.position).max() <= 1e-9


def test_stepping_and_batch_are_the_same_to_the_bit(stage):
    rng = np.random.default_rng(4)
    demand = np.cumsum(rng.normal(0.0, 2e-6, (120, 2)), axis=0)
    demand -= demand[0]
    offset = rng.normal(0.0, 1.0, (120, 2))
    offset[0] = 0.0
    batch = simulate(stage, demand, offset, 7)
    plant = Plant(stage, 7)
    for a in range(2):
        plant.power(a, True)
    seen = []
    for k in range(len(demand)):
        plant.advance_to(k * 1_000_000)
        seen.append([plant.encoder(a) * stage.axes[a].increment for a in range(2)])
        for a in range(2):
            plant.command(a, demand[k, a], offset[k, a], stage.ticks)
    np.testing.assert_array_equal(np.round(np.array(seen) / 1e-9), np.round(batch.position / 1e-9))


def test_same_seed_same_noise_other_seed_other_noise(stage):
    demand, offset = np.zeros((50, 2)), np.zeros((50, 2))
    first, again = simulate(stage, demand, offset, 1), simulate(stage, demand, offset, 1)
    other = simulate(stage, demand, offset, 2)
    assert first.position.tobytes() == again.position.tobytes()
    assert first.position.tobytes() != other.position.tobytes()
    noise = simulate(stage, demand, offset, 1).position[:, 0]
    assert 0.5e-9 < noise.std() < 3e-9


def test_advance_does_not_go_back(stage):
    plant = Plant(stage, 1)
    plant.advance_to(5_000_000)
    assert plant.time_ns == 5_000_000
    before = plant.encoder(0)
    plant.advance_to(3_000_000)
    assert (plant.time_ns, plant.encoder(0)) == (5_000_000, before)


def test_power_off_leaves_no_force(stage):
    plant = Plant(stage, None)
    plant.power(0, True)
    plant.command(0, 1e-3, 10.0, 10)
    plant.advance_to(5_000_000)
    assert plant.force(0) > 1.0
    plant.power(0, False)
    plant.advance_to(15_000_000)
    assert plant.force(0) == pytest.approx(0.0, abs=1e-6)


def test_shapes_that_do_not_fit_are_refused(stage):
    with pytest.raises(ValueError, match="shape"):
        simulate(stage, np.zeros((5, 3)), np.zeros((5, 3)), None)


@pytest.mark.parametrize("name", ["null-1", "null-1-other-moves", "null-2", "null-3"])
def test_independent_recordings_are_reproduced(stage, name):
    # The figures of the first table in docs/reference-stage.md, with the margin asked for.
    with h5py.File(DATA / f"{name}.h5") as file:
        signals = {
            s: np.column_stack([file[f"axes/{a}/{s}"][:] for a in ("x", "y")])
            for s in ("position_demand", "force_offset", "position_actual", "force_actual")
        }
    response = simulate(stage, signals["position_demand"], signals["force_offset"], None)
    for a in range(2):
        position = signals["position_actual"][:, a] - response.position[:, a]
        force = signals["force_actual"][:, a] - response.force[:, a]
        assert np.sqrt(np.mean(position**2)) < 0.15e-6
        assert np.sqrt(np.mean(force**2)) < 0.14
