"""A Coulomb level over the table: statistics of the field, and that it enters over both axes."""

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.effects.friction_map import field_factor
from hil_sim.plant.ports.port_arrays import build_ports

AMPLITUDE, LENGTH = 0.2, 0.05
GRID = np.linspace(-0.15, 0.15, 61)


def field(seed, length=LENGTH, amplitude=AMPLITUDE):
    return field_factor(amplitude, length, seed, GRID[:, None], GRID[None, :])


def test_it_stays_within_its_amplitude_and_all_levels_are_equally_frequent():
    values = np.concatenate([field(seed).ravel() for seed in range(30)])
    assert np.abs(values - 1.0).max() <= AMPLITUDE
    assert values.mean() == pytest.approx(1.0, abs=0.02)
    quarters = np.quantile(values, [0.25, 0.75])
    np.testing.assert_allclose(quarters, [0.9, 1.1], atol=0.02)


def test_its_correlation_falls_over_its_length():
    products = {0: [], 10: [], 40: []}  # nodes 5 mm apart
    for seed in range(40):
        levels = (field(seed) - 1.0) / AMPLITUDE
        for lag, found in products.items():
            shifted = levels[:, lag:] * levels[:, : levels.shape[1] - lag]
            found.append(shifted.mean())
    variance = np.mean(products[0])
    assert variance == pytest.approx(1.0 / 3.0, abs=0.04)  # of a uniform level
    # exp(-r^2/(2 l^2)) of the normal field: 0.61 at r = l, 3e-4 at 4 l; 6/pi asin(rho/2) of ours
    assert np.mean(products[10]) / variance == pytest.approx(6 / np.pi * np.arcsin(0.303), abs=0.08)
    assert abs(np.mean(products[40]) / variance) < 0.12


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
