"""Objections to a map."""

from dataclasses import replace

from stagectl.history import StageKey
from stagectl.maps import MapVersion, outdated, problems, sites_outside
from tests.unit.stagectl.maps.conftest import BEGIN, GRID


def test_objections_to_a_map_name_their_reason(mapped, machine):
    built = mapped.second.map
    found = problems(built, machine)
    assert not any(p.grave for p in found)
    assert any("neighbours" in p.text and "axis x: site (0, -20) mm" in p.text for p in found)
    x = built.axes["x"]
    far = replace(x.sites[0], place=(0.4, 0.0))
    wild = tuple(replace(site, coulomb=site.coulomb * 9) for site in x.sites)
    vague = tuple(replace(site, sigma=0.4) for site in x.sites)
    for reason, other in {
        "outside the travel": {"axes": {"x": replace(x, sites=(far, *x.sites[1:]))}},
        "times the machine file's": {"axes": {"x": replace(x, sites=wild)}},
        "not known to": {"axes": {"x": replace(x, sites=vague)}},
        "the machine has none": {"axes": {"z": x}},
        "only 2 sites": {"axes": {"x": replace(x, sites=x.sites[:2])}},
        "the machine is wafer-xy": {"stage": StageKey("another", True)},
    }.items():
        grave = [p.text for p in problems(replace(built, **other), machine) if p.grave]
        assert any(reason in text for text in grave), reason


def test_an_old_map_and_sites_outside_it_are_reported(mapped):
    built = mapped.first.map
    day = 86400.0
    assert outdated(built, built.date + 29 * day, 365.0) == []
    for days, limit, grave in ((31, 365.0, False), (366, 365.0, True), (2, 1.0, True)):
        (found,) = outdated(built, built.date + days * day, limit)
        assert found.grave is grave
        assert f"{days} days old" in found.text
    assert "clock" in outdated(built, built.date - 2 * day, 365.0)[0].text
    version = MapVersion(3, BEGIN, "", True, built)
    assert sites_outside(version, [*GRID, (0.045, 0.0)]) == sites_outside(version, []) == []
    (said,) = sites_outside(version, [*GRID, (0.06, 0.0), (0.07, 0.0)])
    assert "map 3 ends short of 2 of 27 sites, the first at (60, 0) mm" in said
