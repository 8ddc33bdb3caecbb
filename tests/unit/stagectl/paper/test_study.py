"""Each choice varied on its own, and what is known of it."""

import pytest

from stagectl.paper import Case, study
from stagectl.paper.tables import error

WANTED = {
    "sample rate", "profile", "gains", "filter", "start of zone A", "border of A and B",
    "duration of zone B", "initial forces", "first iterate",
}  # fmt: skip


@pytest.fixture(scope="module")
def rows():
    return {(row.group, row.choice): row for row in study.vary(Case())}


def off(rows, group, choice, name):
    return error(rows[group, choice].fit, name)


def test_everything_left_open_is_varied(rows):
    assert {group for group, _ in rows} == WANTED
    assert not any(isinstance(row.fit, str) for row in rows.values())


def test_lag_grows_with_the_sample_period(rows):
    by_rate = [off(rows, "sample rate", f"{r} kHz, logged", "viscous") for r in (20, 10, 4)]
    assert by_rate[1] / by_rate[0] == pytest.approx(2.0, rel=0.02)
    assert by_rate[2] / by_rate[0] == pytest.approx(5.0, rel=0.02)
    for rate in (20, 10, 4, 1):
        assert abs(off(rows, "sample rate", f"{rate} kHz, aligned", "viscous")) < 1e-4


def test_an_early_zone_a_ruins_c_and_a_late_one_does_not(rows):
    assert off(rows, "start of zone A", "1 mm", "attraction") > 10
    assert abs(off(rows, "start of zone A", "6 mm", "attraction")) < 0.01


def test_force_has_to_go_through_the_filter(rows):
    with_force = abs(off(rows, "filter", "100 Hz, force too", "stiffness"))
    assert abs(off(rows, "filter", "100 Hz, force not", "stiffness")) > 10 * with_force


def test_an_impossible_choice_is_a_row_with_its_reason():
    case = Case(rate=500, bandwidth=50.0)
    (why,) = (row.fit for row in study.vary(case) if row.choice == "200 Hz, aligned")
    assert "unstable" in why
