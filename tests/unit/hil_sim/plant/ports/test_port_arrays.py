"""Ports as records and arena: offsets, counts, and what is refused."""

import numpy as np
import pytest

from hil_sim.plant.arrays import Arrays
from hil_sim.plant.ports.port_arrays import Arena, build_ports
from tests.unit.hil_sim.inputs import effect_of


def test_the_arena_knows_where_everything_begins():
    arena = Arena()
    assert arena.add([1.0, 2.0]) == 0
    assert arena.add(None) == arena.add([]) == -1
    assert arena.add([(3.0, 4.0), (5.0, 6.0)]) == 2
    assert arena.add(np.array([7.0])) == 6
    np.testing.assert_array_equal(arena.array(), [1, 2, 3, 4, 5, 6, 7, 0])
    assert len(Arena().array()) == 1  # never empty


def test_an_axis_without_effects_takes_the_plain_path(nominal, with_effects, effects):
    cogging = effects["cogging"].at(amplitude=0.5, pitch=0.03, phase=0.0)
    arrays = Arrays(with_effects(nominal, cogging), (0.0, 0.0))
    assert [bool(r["ported"]) for r in arrays.plant] == [True, False]
    assert arrays.plant[0]["position_force"] >= 0
    assert arrays.plant[1]["position_force"] == -1
    assert not arrays.plant["coupled"].any()


def test_lists_are_counted_from_their_offset(nominal, with_effects):
    def write(ports):
        ports.harmonics += [(1.0, 20.0, 0.0), (2.0, 50.0, 0.5)]
        ports.decays += [(0.3, 60.0)]
        ports.hysteresis += [(1.5, 1e4)]

    arrays = Arrays(with_effects(nominal, effect_of(write)), (0.0, 0.0))
    record = arrays.plant[0]
    assert (record["harmonic_count"], record["decay_count"], record["hysteresis_count"]) == (
        2,
        1,
        1,
    )
    begin = int(record["harmonics"])
    np.testing.assert_allclose(
        arrays.arena[begin : begin + 6],
        [1.0, 2 * np.pi * 20.0, 0.0, 2.0, 2 * np.pi * 50.0, 0.5],
    )
    begin = int(record["decays"])
    np.testing.assert_allclose(arrays.arena[begin : begin + 2], [0.3, 1.0 / 60.0])
    begin = int(record["hysteresis"])
    np.testing.assert_allclose(arrays.arena[begin : begin + 3], [1e4, 1.5, 0.0])


def test_a_dead_time_is_whole_ticks_and_a_share_of_each_substep(nominal, with_effects, effects):
    def shares(seconds):
        arrays = Arrays(with_effects(nominal, effects["dead_time"].at(delay=seconds)), (0.0, 0.0))
        record = arrays.plant[0]
        begin = int(record["delay_share"])
        return int(record["delay_ticks"]), arrays.arena[begin : begin + 5]

    ticks, share = shares(2e-4)  # two whole ticks
    assert ticks == 2
    np.testing.assert_allclose(share, 0.0)
    ticks, share = shares(2.6e-4)  # and three of five substeps
    assert ticks == 2
    np.testing.assert_allclose(share, [1, 1, 1, 0, 0], atol=1e-9)
    _, share = shares(2.5e-4)  # in the middle of the third: what has decayed since counts less
    assert 0.4 < share[2] < 0.5


def test_masses_of_parts_come_out_of_the_carriage(nominal, with_effects, effects):
    hanging = effects["resonance"].at(frequency=200.0, damping=0.02, mass_ratio=0.25)
    base = effects["base_motion"].at(frequency=10.0, damping=0.05, mass_ratio=0.1)
    arrays = Arrays(with_effects(nominal, hanging, base), (0.0, 0.0))
    record = arrays.plant[0]
    assert record["mass"] == pytest.approx(6.0)
    assert record["mobility"] == pytest.approx(1.0 / 6.0 + 1.0 / 80.0)
    hung = arrays.arena[int(record["hanging"]) :]
    reduced = 2.0 * 6.0 / 8.0
    assert hung[0] == pytest.approx(reduced * (2 * np.pi * 200.0) ** 2)
    assert hung[2] == pytest.approx(2.0)


def test_what_cannot_be_names_axis_and_effect(nominal, with_effects, effects):
    stage = with_effects(nominal, effects["cross_coupling"].at(mass=0.3))
    alone = type(stage)(stage.sync_period, stage.axes[:1])
    with pytest.raises(ValueError, match=r"^axis x: an effect that involves the other axis needs"):
        build_ports(alone, None)
