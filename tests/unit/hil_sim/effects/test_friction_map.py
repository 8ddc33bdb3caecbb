"""A Coulomb level over the table: drawn by the seed, entering over both axes."""

from dataclasses import replace

import numpy as np

from hil_sim.effects.friction_map import field_factor
from hil_sim.plant.ports.port_arrays import build_ports

AMPLITUDE, LENGTH = 0.2, 0.05
GRID = np.linspace(-0.15, 0.15, 61)


def field(seed, length=LENGTH, amplitude=AMPLITUDE):
    return field_factor(amplitude, length, seed, GRID[:, None], GRID[None, :])


def test_the_integer_part_of_the_seed_draws_it():
    np.testing.assert_array_equal(field(7), field(7.9))
    assert np.abs(field(7) - field(8)).max() > 0.1


def test_it_enters_over_both_positions_finely_enough(nominal, with_effects, effects):
    effect = effects["friction_map"].at(amplitude=AMPLITUDE, length=0.02, seed=3)
    (ports, _) = build_ports(with_effects(nominal, effect), None)
    (own,) = ports.fields
    low, high = nominal.axes[0].travel
    assert own.own[0] < low < high < own.own[-1]
    assert np.diff(own.own).max() <= 0.02 / 10.0 + 1e-12
    expected = field_factor(AMPLITUDE, 0.02, 3, own.own[:, None], own.other[None, :])
    np.testing.assert_allclose(own.values, expected)


def test_a_field_finer_than_a_hundredth_of_the_travel_is_refused(nominal, with_effects, effects):
    effect = effects["friction_map"]
    values = {"amplitude": 0.1, "length": 5e-3, "seed": 0.0}
    assert effect.refusal(values, nominal.axes[0]) is None
    long = replace(nominal.axes[0], travel=(-0.4, 0.4))
    assert effect.refusal(values, long) == ("length: must be >= 1/100 of the travel, 0.008 m")
