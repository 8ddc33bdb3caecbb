"""Tables I and II with zone A's initial force fixed: what decides where one window ends."""

from dataclasses import replace

import pytest

from stagectl.paper.fixed_force import fixed_as_json, on_bound, times_fewer
from stagectl.paper.tables import ALIGNMENTS, error


def fits(quick, method, bounds):
    return [
        v.tables[method][force] for v in quick.fixed if v.bounds == bounds for force in ALIGNMENTS
    ]


def test_both_forces_and_both_ways_to_keep_the_bounds_are_computed(quick):
    assert {(v.initial, v.bounds) for v in quick.fixed} == {
        (initial, bounds)
        for initial in ("reference", "measured")
        for bounds in ("bounded", "shortened")
    }


@pytest.mark.parametrize("bounds", ["bounded", "shortened"])
def test_two_windows_find_zone_a_either_way(quick, bounds):
    for fit in fits(quick, "two_windows", bounds):
        assert abs(error(fit, "coulomb")) < 0.005
        assert abs(error(fit, "attraction")) < 0.1
        assert not on_bound(fit)


def test_one_window_stops_on_a_bound_where_steps_are_shortened_as_a_whole(quick):
    for fit in fits(quick, "one_window", "shortened"):
        assert on_bound(fit)
        assert abs(error(fit, "coulomb")) > 0.3
    for fit in fits(quick, "one_window", "bounded"):
        assert not on_bound(fit)
        assert abs(error(fit, "coulomb")) < 0.01


def test_one_window_on_a_bound_is_far_less_sure_of_what_is_there(quick):
    for fit in fits(quick, "one_window", "shortened"):
        assert fit.sigma["stiffness"] > 1000.0


def test_exact_derivatives_stop_where_differences_do(quick):
    """Differences that shrink with the iterate are rounding where it is on its bound."""
    for force in ALIGNMENTS:
        options = replace(quick.case.options, initial="reference", bounds="shortened")
        case = replace(quick.case.with_force(force), options=options)
        own = replace(case, options=replace(options, jacobian="sensitivities"))
        ends = [c.fit("one_window").value["coulomb"] for c in (case, own)]
        assert ends[0] == pytest.approx(ends[1], rel=1e-3)


def test_times_fewer_are_ratios_of_all_evaluations(quick):
    tables = quick.fixed[0].tables
    one, two = (tables[m]["aligned"].evaluations for m in ("one_window", "two_windows"))
    assert times_fewer(tables)["aligned"] == pytest.approx(one[0] / (two[0] + two[1]))


def test_json_names_the_choices(quick):
    for entry, variant in zip(fixed_as_json(quick.fixed), quick.fixed, strict=True):
        assert (entry["initial"], entry["bounds"]) == (variant.initial, variant.bounds)
        assert set(entry["tables"]) == {"one_window", "two_windows"}
