"""Results of a calibration."""

import math
from dataclasses import replace

import pytest

from stagectl.calibration.outcome import site_outcomes, visited_sites
from stagectl.calibration.sequence import START
from stagectl.maps import AxisChange, FrictionMap, MapSite, SiteChange
from stagectl.maps.model import MapAxis
from tests.unit.stagectl.calibration.conftest import SITES
from tests.unit.stagectl.calls import count_calls


def test_change_and_refusals_decide_what_to_do_at_a_site():
    def entry(site, accepted, reason=None):
        of = {"coulomb": {"value": 6.0, "sigma": 0.06, "unit": "N"}}
        told = {"accepted": accepted, "reason": reason, "parameters": of}
        return {"site": site, "axis": "x", **told}

    sizes = zip(SITES, (0.2, 0.05, 0.05), (0.01, 0.01, 0.04), strict=False)
    changes = [AxisChange("x", 0.0, 0.1, tuple(SiteChange(*size) for size in sizes))]
    friction = [entry(i, True) for i in (1, 2, 3)] + [entry(4, False, "residual 9 times")]
    found = site_outcomes([*SITES, SITES[0]], friction, ("x",), None, changes)
    assert [o.severity for o in found] == ["act", "watch", "good", "failed"]
    assert "dirt" in found[0].suggestion
    assert "residual 9 times" in found[3].suggestion
    assert found[0].gains["coulomb"].bits == pytest.approx(math.log2(0.3 / 0.01))
    sigmas = {"coulomb": 0.03, "viscous": 0.05, "stiffness": 0.01, "attraction": 0.05}
    figures = {name: {"value": 1.0, "sigma": sigma} for name, sigma in sigmas.items()}
    rows = site_outcomes(SITES[:1], [{**entry(1, True), "parameters": figures}], ("x",), None, [])
    # What is predicted is reached of: C/Fc instead of C, whose variance has that of Fc in it.
    assert set(rows[0].gains) == set(START)
    assert rows[0].gains["relaxation_rate"].after == pytest.approx(0.04)
    down = [replace(changes[0], sites=(SiteChange(SITES[0], -0.2, 0.01),))]
    assert "grease" in site_outcomes(SITES[:1], friction, ("x",), None, down)[0].suggestion


def test_a_site_of_the_map_is_found_by_its_place():
    """The history keeps places to the micrometre."""
    changes = [AxisChange("x", 0.0, 0.1, (SiteChange((0.02, 0.0), 0.2, 0.01),))]
    site = MapSite((0.02, 0.0), 6.1, 0.007, 1.7e9, 4)
    built = FrictionMap(None, 1.7e9, {"x": MapAxis((site,), (), {})})
    for place, there in (((0.0200004, 0.0), True), ((0.0200015, 0.0), False)):
        (found,) = site_outcomes([place], [], ("x",), built, changes)
        assert (found.coulomb == 6.1, found.sigma == 0.007, found.change == 0.2) == (there,) * 3


def test_work_grows_with_the_sites_and_not_with_their_square():
    def work(count):
        places = [(0.002 * i, 0.0) for i in range(count)]
        changes = [AxisChange("x", 0.0, 0.1, tuple(SiteChange(p, 0.2, 0.01) for p in places))]
        refused = {"axis": "x", "accepted": False, "reason": "r"}
        friction = [{"site": i, **refused} for i in range(1, count + 1)]
        return count_calls(lambda: site_outcomes(places, friction, ("x",), None, changes))

    assert work(200) < 2.5 * work(100)


def test_sites_that_an_interrupted_calibration_did_not_reach_have_no_outcome():
    friction = [{"site": 1, "accepted": True}, {"site": 2, "accepted": False}]
    assert visited_sites(SITES, friction) == SITES[:2]
    assert visited_sites(SITES, []) == ()
