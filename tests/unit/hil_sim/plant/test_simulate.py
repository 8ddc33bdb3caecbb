"""Batch simulation: closed forms, independent recordings, variants and threads."""

import tracemalloc
from dataclasses import replace
from pathlib import Path
from threading import Thread

import h5py
import numpy as np
import pytest

from hil_sim.plant import simulate
from hil_sim.plant.simulate import simulate_variants
from tests.unit.hil_sim.inputs import both_steps, change_axes, effect_of, smooth_demand

DATA = Path(__file__).parents[3] / "data"


def test_force_is_reported_in_thousandths_of_the_rated_force(nominal):
    response = simulate(nominal, np.zeros((50, 2)), np.full((50, 2), 1.234), 3)
    for a, axis in enumerate(nominal.axes):
        counts = response.force[:, a] / (axis.control.rated_force / 1000.0)
        np.testing.assert_allclose(counts, np.round(counts), atol=1e-9)


def test_output_is_clamped_and_the_integrator_waits(nominal):
    k = np.arange(300)
    demand = np.where((k > 10) & (k < 60), 5e-3, 0.0)
    bare = change_axes(nominal, {"coulomb": 1e-9, "viscous": 0.0, "stiffness": 1e-3})
    both = np.column_stack([demand] * 2)
    response = simulate(bare, both, 0.0 * both, None)
    assert np.abs(response.force[:, 0]).max() <= 120.0 + 1e-9
    assert abs(response.position[-1, 0]) < 2e-5  # it comes back: nothing was wound up for long


@pytest.mark.parametrize("substeps", [1, 5])
def test_a_stiff_plant_on_a_slow_tick_is_integrated_in_more_steps(nominal, substeps):
    """30000 N/m on 8 kg swing at 10 Hz: five steps of a tick of 0.1 s cannot follow them."""
    axes = tuple(
        replace(
            axis,
            friction=replace(axis.friction, stiffness=3e4, static_ratio=0.0),
            control=replace(axis.control, period=0.1, kp=20.0, ki=0.0, kd=10.0),
        )
        for axis in nominal.axes
    )
    slow = replace(nominal, sync_period=0.1, axes=axes)
    demand = 0.02 * np.sin(0.2 * np.arange(200))
    both = np.column_stack([demand] * 2)
    push = 40.0 * np.cos(0.2 * both / 0.02)
    made, finer = (simulate(slow, both, push, None, substeps=n) for n in (substeps, 200))
    scale = np.ptp(finer.position, axis=0)
    assert np.abs(made.position - finer.position).max() < 0.05 * scale.min()


def test_shapes_that_do_not_fit_are_refused(nominal):
    with pytest.raises(ValueError, match="shape"):
        simulate(nominal, np.zeros((5, 3)), np.zeros((5, 3)), None)


@pytest.mark.parametrize("name", ["null-1", "null-1-other-moves", "null-2", "null-3"])
def test_independent_recordings_are_reproduced(nominal, name):
    # The figures of the first table in docs/reference-nominal.md, with the margin asked for.
    with h5py.File(DATA / f"{name}.h5") as file:
        signals = {
            s: np.column_stack([file[f"axes/{a}/{s}"][:] for a in ("x", "y")])
            for s in ("position_demand", "force_offset", "position_actual", "force_actual")
        }
    response = simulate(nominal, signals["position_demand"], signals["force_offset"], None)
    for a in range(2):
        position = signals["position_actual"][:, a] - response.position[:, a]
        force = signals["force_actual"][:, a] - response.force[:, a]
        assert np.sqrt(np.mean(position**2)) < 0.15e-6
        assert np.sqrt(np.mean(force**2)) < 0.14


@both_steps
def test_level_over_time_is_the_ports_factor(nominal, with_effects, substeps):
    demand = smooth_demand(1)
    factor = 1.0 + 0.2 * np.sin(np.arange(len(demand)) / 40.0)
    table = effect_of(lambda ports: ports.scale_time_coulomb(np.append(factor, factor[-1])))
    level = np.column_stack([factor, np.ones_like(factor)])
    zero = np.zeros_like(demand)
    one = simulate(with_effects(nominal, table), demand, zero, None, substeps=substeps)
    other = simulate(nominal, demand, zero, None, substeps=substeps, level=level)
    assert one.position.tobytes() == other.position.tobytes()
    plain = simulate(nominal, demand, zero, None, substeps=substeps)
    assert np.abs(plain.force - one.force)[:, 0].max() > 0.5


def test_an_uncoupled_axis_alone_is_the_same(nominal, with_effects, effects):
    demand = smooth_demand(7)
    stage = with_effects(nominal, effects["force_ripple"].at(ratio=0.05, pitch=0.01, phase=0.3))
    whole = simulate(stage, demand, 0.0 * demand, None)
    alone = replace(stage, axes=stage.axes[:1])
    single = simulate(alone, demand[:, :1], 0.0 * demand[:, :1], None)
    np.testing.assert_array_equal(single.position[:, 0], whole.position[:, 0])
    np.testing.assert_array_equal(single.force[:, 0], whole.force[:, 0])


def test_variants_side_by_side_are_those_alone(nominal, effects):
    demand, offset = smooth_demand(12, 400)[:, 0], 3.0 * smooth_demand(13, 400)[:, 0] * 1e5
    x = nominal.axes[0]
    variants = [
        x,
        replace(x, mass=8.4),
        replace(x, effects=(effects["force_offset"].at(force=1.0),)),
        replace(x, friction=replace(x.friction, elements=4)),
    ]
    together = simulate_variants(
        replace(nominal, axes=tuple(variants)), demand, offset, 2.0, rounded=False
    )
    for i, axis in enumerate(variants):
        alone = simulate(
            replace(nominal, axes=(axis,)), demand[:, None], offset[:, None], None, [2.0],
            substeps=1, rounded=False,
        )  # fmt: skip
        np.testing.assert_array_equal(together.position[:, i], alone.position[:, 0])
        np.testing.assert_array_equal(together.force[:, i], alone.force[:, 0])
    tied = (x, replace(x, effects=(effects["cross_coupling"].at(mass=0.3),)))
    with pytest.raises(ValueError, match="that involve another one"):
        simulate_variants(replace(nominal, axes=tied), demand, offset)


def test_threads_do_not_disturb_one_another(nominal, with_effects, effects):
    demand = smooth_demand(8, 1500)
    stages = [
        with_effects(nominal, effects["cable_hysteresis"].at(force=f, stiffness=2e3))
        for f in (0.5, 1.5)
    ]
    alone = [simulate(s, demand, 0.0 * demand, None).force for s in stages]
    together = [None, None]

    def work(i):
        together[i] = simulate(stages[i], demand, 0.0 * demand, None).force

    threads = [Thread(target=work, args=(i,)) for i in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for one, other in zip(alone, together, strict=True):
        np.testing.assert_array_equal(one, other)


def test_rest_force_reaches_the_limit_of_its_own_direction(nominal, with_effects, effects):
    """6 N of Coulomb friction hold 8.4 N at rest; 12 % more one way, 9.4 N that way."""
    stage = with_effects(nominal, effects["friction_asymmetry"].at(ratio=0.12))
    still = np.zeros((5, 2))
    for held, force in ((9.3, 9.3), (-9.3, -8.4 * 0.88)):
        response = simulate(stage, still, still, None, rest_force=[held, 0.0], rounded=False)
        assert response.force[0, 0] == pytest.approx(force, abs=0.01)


def test_the_memory_for_noise_does_not_grow_with_the_recording(nominal):
    demand = np.zeros((30_000, len(nominal.axes)))
    simulate(nominal, demand[:10], demand[:10], 1)
    tracemalloc.start()
    try:
        response = simulate(nominal, demand, demand, 1)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    results = response.position.nbytes + response.force.nbytes
    noise = 2 * 8 * nominal.ticks * demand.size  # of all of it, bytes
    assert peak - results < noise
