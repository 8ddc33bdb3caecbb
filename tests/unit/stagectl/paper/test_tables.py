"""Tables I and II at 20 kHz: what must come out."""

import pytest

from stagectl.paper import tables
from stagectl.paper.published import PARAMETERS
from stagectl.paper.tables import ALIGNMENTS, error, on_bound, times_fewer


def test_two_windows_aligned_find_the_reference(quick):
    fit = quick.tables["two_windows"]["aligned"]
    assert abs(error(fit, "coulomb")) <= 1e-4
    assert abs(error(fit, "viscous")) <= 1e-4
    assert abs(error(fit, "stiffness")) <= 3e-3
    assert abs(error(fit, "attraction")) <= 1e-2
    assert fit.mse <= 1e-8


def test_half_a_sample_of_lag_biases_as_the_closed_form_says(quick):
    """d(sigma_v) = -m w^2 tau and d(Fc) = m A w tau for a sine move; tau = 25 us."""
    w, tau = 27.459, 25e-6
    for method in quick.tables:
        fit = quick.tables[method]["logged"]
        assert fit.value["viscous"] - 1.0 == pytest.approx(-(w**2) * tau, rel=0.05)
        assert fit.value["coulomb"] - 2.0 == pytest.approx(3.0 * w * tau, rel=0.05)


def test_lag_goes_into_sigma0_of_two_windows(quick):
    one, two = (quick.tables[m]["logged"] for m in ("one_window", "two_windows"))
    assert abs(error(two, "stiffness")) > 3 * abs(error(one, "stiffness"))


def test_json_has_every_figure(quick):
    found = tables.as_json(quick.tables)
    assert set(found) == {"one_window", "two_windows"}
    for by_force in found.values():
        assert set(by_force) == set(ALIGNMENTS)
        for figures in by_force.values():
            assert set(figures) == {*PARAMETERS, "mse", "iterations", "evaluations"}
            for name in PARAMETERS:
                assert set(figures[name]) == {"value", "sigma"}
                assert figures[name]["sigma"] > 0
            assert isinstance(figures["iterations"], int)
            assert figures["evaluations"] > figures["iterations"] > 0


# With zone A's initial force fixed: what decides where one window ends.


def fits(quick, method, bounds):
    found = [tables[method] for (kept, _), tables in quick.fixed.items() if kept == bounds]
    return [by_force[force] for by_force in found for force in ALIGNMENTS]


def test_both_forces_and_both_ways_to_keep_the_bounds_are_computed(quick):
    assert set(quick.fixed) == {
        (bounds, initial)
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


def test_times_fewer_are_ratios_of_all_evaluations(quick):
    tables = quick.fixed["bounded", "reference"]
    one, two = (tables[m]["aligned"].evaluations for m in ("one_window", "two_windows"))
    assert times_fewer(tables)["aligned"] == pytest.approx(one[0] / (two[0] + two[1]))
