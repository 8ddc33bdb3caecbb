"""Scores of constructed outcomes, counted by hand."""

from __future__ import annotations

import math

import pytest

from sim2real.blind import is_wrong, score_outcomes, write_page
from sim2real.blind.score import calibration_bins
from tests.unit.sim2real.blind.outcomes import outcome


def test_one_effect_counts_where_axis_and_name_come_first():
    right = outcome("one", "x cogging", "x cogging 0.99", "explained", promised=0.95, second=0.9)
    beside = outcome(
        "one", "x cogging", "x cogging 0.99, y dead_time 0.9", "explained", promised=0.9,
        second=0.7, within=0.85,
    )  # fmt: skip
    axis = outcome("one", "x cogging", "y cogging 0.9", "explained")
    alike = outcome(
        "one", "x dead_time", "x current_bandwidth 0.6", "explained",
        confusable=(("x", ("current_bandwidth", "dead_time")),),
    )  # fmt: skip
    crashed = outcome("one", "x cogging", "", "", error="ValueError: no")
    counted = score_outcomes([right, beside, axis, alike, crashed])
    assert (counted.one.count, counted.one.of) == (2, 5)
    assert counted.one_with_sets.count == 3
    assert counted.one_only.count == 1
    assert counted.errors == 1
    assert (counted.promise.count, counted.promise.of) == (1, 2)
    assert (counted.within.count, counted.within.of) == (1, 1)
    assert counted.closed == pytest.approx(0.925)
    assert counted.confusion == {
        ("cogging", "cogging"): 2,
        ("cogging", "cogging (other axis)"): 1,
        ("cogging", "error"): 1,
        ("dead_time", "current_bandwidth"): 1,
    }
    assert [is_wrong(o) for o in (right, beside, axis, alike, crashed)] == [
        False,
        True,
        True,
        True,
        True,
    ]


def test_none_outside_two_and_departing():
    over_velocity = (("x", ("acceleration", "velocity")),)
    outcomes = [
        outcome("none", "", "", "no_gap"),
        outcome("none", "", "x cogging 0.6", "explained"),
        outcome("outside", "x quadratic_drag", "", "unexplained"),
        outcome("outside", "x quadratic_drag", "", "unexplained", unlisted=over_velocity),
        outcome("outside", "x quadratic_drag", "x viscous_damping 0.9", "partly_explained"),
        outcome("outside", "x quadratic_drag", "x viscous_damping 0.9", "explained"),
        outcome("two", "x cogging, y dead_time", "y dead_time 0.9, x cogging 0.9", "explained"),
        outcome("two", "x cogging, y dead_time", "x cogging 0.9", "partly_explained"),
        outcome("two", "x cogging, y dead_time", "x cogging 0.9, x stribeck 0.8", "explained"),
        outcome("departing", "x cogging_harmonics", "x cogging 0.9", "partly_explained"),
        outcome("departing", "x cogging_harmonics", "x cogging 0.9", "explained"),
        outcome(
            "departing", "x cogging_harmonics", "", "unexplained", unlisted=(("x", ("position",)),)
        ),
        outcome("departing", "x cogging_harmonics", "x stribeck 0.9", "partly_explained"),
        outcome("departing", "x cogging_harmonics", "", "unexplained", unlisted=over_velocity),
    ]
    counted = score_outcomes(outcomes)
    assert (counted.none.count, counted.alarms.count, counted.none.of) == (1, 1, 2)
    assert (counted.outside.count, counted.coordinate.count, counted.outside.of) == (2, 1, 4)
    assert (counted.two.count, counted.two_safe.count, counted.two.of) == (1, 2, 3)
    assert (counted.family.count, counted.remainder.count, counted.family.of) == (3, 2, 5)
    text = write_page(outcomes, {"version checked": "v"})
    assert "| 1, 0 | x cogging_harmonics | partly_explained | x stribeck 0.90 |" in text
    assert "| 1, 0 | x cogging_harmonics | unexplained | x over acceleration or velocity |" in text


def test_without_the_true_effect_a_near_relative_must_be_hesitant():
    def left(reported, verdict):
        return outcome("one", "x dead_time", reported, verdict, leave_out=True)

    hesitant = left("x current_bandwidth 0.7", "explained")
    sure = left("x current_bandwidth 0.95", "explained")
    far = left("x cogging 0.7", "explained")
    counted = score_outcomes([hesitant, sure, far, left("", "unexplained")])
    assert (counted.left_out.count, counted.left_out.of) == (2, 4)
    assert counted.one.of == 0
    assert counted.error is None


def test_parameters_without_a_sigma_are_outside():
    deviations = {"x.cogging.a": 2.9, "x.cogging.b": -3.1, "x.cogging.c": math.nan}
    counted = score_outcomes(
        [outcome("one", "x cogging", "x cogging 0.9", "explained", sigmas=deviations)]
    )
    assert (counted.parameters.count, counted.parameters.of) == (1, 3)


def test_calibration_is_the_mean_distance_in_bins_of_fifty():
    causes = [(0.6, i < 30) for i in range(50)] + [(0.9, i < 35) for i in range(50)]
    bins = calibration_bins(reversed(causes))
    assert [b.causes for b in bins] == [50, 50]
    assert [b.right for b in bins] == pytest.approx([0.6, 0.7])
    assert len(calibration_bins(causes[:99])) == 1
    reported = [
        outcome("one", "x cogging", f"{'x' if right else 'y'} cogging {p}", "explained")
        for p, right in causes
    ]
    assert score_outcomes(reported).error == pytest.approx(0.1)
