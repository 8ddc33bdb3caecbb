"""Tables I and II at 20 kHz: what must come out."""

import pytest

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


def test_with_the_initial_force_fixed_one_window_stops_on_a_bound(quick):
    """Where steps are shortened as a whole; two windows find zone A either way."""
    for (bounds, _), fixed in quick.fixed.items():
        for force in ALIGNMENTS:
            one, two = (fixed[method][force] for method in ("one_window", "two_windows"))
            assert bool(on_bound(one)) is (bounds == "shortened")
            off = abs(error(one, "coulomb"))
            assert off > 0.3 if on_bound(one) else off < 0.01
            assert not on_bound(one) or one.sigma["stiffness"] > 1000.0, "far less sure"
            assert not on_bound(two)
            assert abs(error(two, "coulomb")) < 0.005
            assert abs(error(two, "attraction")) < 0.1


def test_times_fewer_are_ratios_of_all_evaluations(quick):
    tables = quick.fixed["bounded", "reference"]
    one, two = (tables[m]["aligned"].evaluations for m in ("one_window", "two_windows"))
    assert times_fewer(tables)["aligned"] == pytest.approx(one[0] / (two[0] + two[1]))
