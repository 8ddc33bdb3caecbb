"""Ports as records and arena: offsets, counts, and what is refused."""

import numpy as np

from hil_sim.plant.arrays import Arrays
from tests.unit.hil_sim.inputs import effect_of


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
    assert (record["harmonics_count"], record["decays_count"], record["hysteresis_count"]) == (
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
