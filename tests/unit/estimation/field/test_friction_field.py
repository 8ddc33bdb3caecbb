"""The friction map's field: what it knows, how sure it is, and where it ends."""

import math

import numpy as np
import pytest

from estimation.field.friction_field import FrictionField

SIDE = 0.1
GRID = np.stack(np.meshgrid(np.linspace(0, SIDE, 5), np.linspace(0, SIDE, 5)), -1).reshape(-1, 2)


def waves(generator):
    """A table that no kernel of the map's has drawn: three plane waves, +-25 % at most."""
    k = generator.normal(0.0, 1.0 / 0.04, (3, 2))
    phase = generator.uniform(0.0, 6.3, 3)
    return lambda p: 6.0 * (1.0 + 0.25 / 3.0 * np.cos(p @ k.T + phase).sum(axis=1))


def test_unvisited_sites_are_predicted_and_the_band_is_honest():
    generator = np.random.default_rng(1)
    errors, inside = [], []
    for _ in range(4):
        truth = waves(generator)
        measured = truth(GRID) * (1 + 0.01 * generator.standard_normal(25))
        field = FrictionField(GRID, measured, np.full(25, 0.01))
        places = generator.uniform(0, SIDE, (100, 2))
        predicted = field.at(places)
        low, high = predicted.band()
        errors.append(predicted.value / truth(places) - 1)
        inside.append((low <= truth(places)) & (truth(places) <= high))
    assert np.sqrt(np.mean(np.square(errors))) <= 0.02
    assert 0.9 <= np.mean(inside) <= 1.0
    # ... and the band says something: it is no wider than it has to be.
    assert np.mean(predicted.sigma) <= 0.025


def test_a_flat_table_is_found_flat():
    generator = np.random.default_rng(3)
    field = FrictionField(GRID, 6 * (1 + 0.005 * generator.standard_normal(25)), np.full(25, 0.005))
    predicted = field.at(generator.uniform(0, SIDE, (50, 2)))
    assert predicted.value == pytest.approx(6.0, rel=0.01)
    assert predicted.sigma.max() < 0.012


def test_beyond_the_edge_the_edge_stands_with_more_doubt_and_says_so():
    field = FrictionField(GRID, waves(np.random.default_rng(4))(GRID), np.full(25, 0.003))
    edge, beyond, far = (SIDE + field.edge, 0.05), (SIDE + 0.03, 0.05), (SIDE + 1.0, 0.05)
    predicted = field.at(np.array([(SIDE, 0.05), edge, beyond, far]))
    assert field.edge == pytest.approx(0.0125)
    assert predicted.inside.tolist() == [True, True, False, False]
    assert predicted.value[2] == predicted.value[3] == pytest.approx(predicted.value[1])
    assert (np.diff(predicted.sigma) > 0).all()
    # Infinitely far away nothing is known but what any place may be.
    assert predicted.sigma[3] >= field.amplitude


@pytest.mark.parametrize("count", [1, 2, 3])
def test_few_sites_give_a_cautious_map(count):
    places = np.array([[0.0, 0.0], [0.02, 0.0], [0.04, 0.0]])[:count]
    field = FrictionField(places, np.array([6.0, 6.3, 6.6])[:count], np.full(count, 0.005))
    predicted = field.at(np.array([[0.0, 0.0], [0.01, 0.05]]))
    assert predicted.value[0] == pytest.approx(6.0, rel=0.05)
    assert not predicted.inside[1]
    assert predicted.sigma[1] > 0.02


def test_what_one_site_says_is_shared_with_its_neighbours():
    field = FrictionField(GRID[::3], waves(np.random.default_rng(5))(GRID[::3]), np.full(9, 0.003))
    places = np.array([[0.063, 0.038], [0.066, 0.038], [0.01, 0.09]])
    mean, covariance = field.joint(places)
    alone = field.at(places)
    assert np.exp(mean) == pytest.approx(alone.value)
    assert np.sqrt(np.diag(covariance)) == pytest.approx(alone.sigma, rel=1e-4)
    correlation = covariance / np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    assert correlation[0, 1] > 0.5 > abs(correlation[0, 2])


def test_a_site_that_does_not_fit_its_neighbours_stands_out_when_left_out():
    generator = np.random.default_rng(6)
    values = waves(generator)(GRID) * (1 + 0.003 * generator.standard_normal(25))
    values[12] *= 1.3
    error, sigma = FrictionField(GRID, values, np.full(25, 0.003)).left_out()
    assert np.abs(error / sigma).argmax() == 12
    assert error[12] == pytest.approx(math.log(1.3), abs=0.08)


def test_the_same_nodes_give_the_same_map_without_a_fit():
    values = waves(np.random.default_rng(7))(GRID)
    fitted = FrictionField(GRID, values, np.full(25, 0.01))
    again = FrictionField(GRID, values, np.full(25, 0.01), nodes=fitted.nodes)
    places = np.array([[0.012, 0.034]])
    assert again.at(places).value.tolist() == fitted.at(places).value.tolist()


@pytest.mark.parametrize(
    ("places", "values", "sigma"),
    [
        (np.zeros((0, 2)), np.zeros(0), np.zeros(0)),
        (np.zeros((1, 2)), np.array([-1.0]), np.ones(1)),
        (np.zeros((1, 2)), np.array([math.nan]), np.ones(1)),
        (np.full((1, 2), math.inf), np.ones(1), np.ones(1)),
        (np.zeros((2, 2)), np.ones(1), np.ones(1)),
    ],
)
def test_what_is_no_site_is_refused(places, values, sigma):
    with pytest.raises(ValueError, match=r"must be|needed"):
        FrictionField(places, values, sigma)


def test_the_figure_alone_is_that_with_its_uncertainty():
    field = FrictionField(GRID, waves(np.random.default_rng(5))(GRID), np.full(25, 0.01))
    places = np.random.default_rng(6).uniform(-0.5 * SIDE, 1.5 * SIDE, (50, 2))  # beyond it, too
    assert field.value(places) == pytest.approx(field.at(places).value, rel=1e-12)
