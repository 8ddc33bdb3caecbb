"""Maps built from a history."""

import math

import numpy as np
import pytest

from stagectl.errors import UnusableInput
from stagectl.maps import build_map
from tests.unit.stagectl.maps.conftest import BEGIN, GRID, STAGE, calibrate, level


def test_a_map_knows_its_sites_and_places_between_them(mapped):
    for name, axis in mapped.first.map.axes.items():
        assert len(axis.sites) == 25
        assert {site.count for site in axis.sites} == {4, 8}
        errors = np.array([s.coulomb / level(name, s.place) - 1 for s in axis.sites])
        assert errors.std() < 0.008
        assert abs(errors.mean()) < 0.02  # the common level is the tracking's business
        assert np.median([site.sigma for site in axis.sites]) < 0.012
        places = np.random.default_rng(2).uniform(-0.04, 0.04, (100, 2))
        found = axis.field().at(places)
        truth = np.array([level(name, p) for p in places])
        assert np.sqrt(np.mean((found.value / truth - 1) ** 2)) < 0.02
        assert axis.figures["viscous"][0] == 20.0


@pytest.mark.parametrize("falls", [0.0, 1e-3])
def test_drift_during_a_calibration_is_not_mistaken_for_a_tilt(history, falls):
    """8 % in the 78 s from the first row of sites to the last; the first site is seen again."""
    calibrate(history, falls=falls, axes="yx")
    built = build_map(history, STAGE)
    assert list(built.axes) == ["x", "y"]  # whichever was measured first
    for name, axis in built.axes.items():
        off = np.log([site.coulomb / level(name, site.place) for site in axis.sites])
        off -= off.mean()
        said = math.sqrt(np.mean([site.sigma**2 for site in axis.sites]))
        assert np.sqrt(np.mean(off**2)) < min(0.012, 1.5 * said)
        assert abs(off[:5].mean() - off[-5:].mean()) < 0.012


def test_a_site_measured_alone_stays_uncertain(history):
    """Whether a change there is its own or that of all sites, nobody knows."""
    calibrate(history)
    calibrate(history, BEGIN + 3600, sites=GRID[12:13], seed=2)
    for axis in build_map(history, STAGE).axes.values():
        sigma = {site.place: site.sigma for site in axis.sites}
        assert 0.4 * np.median(list(sigma.values())) < sigma[GRID[12]] < 0.02


def test_too_few_places_make_no_map(history):
    calibrate(history, sites=GRID[:3])
    with pytest.raises(UnusableInput, match="stagectl calibrate"):
        build_map(history, STAGE)
