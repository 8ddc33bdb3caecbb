"""Series of estimates over time: trends, thinned from their end."""

import math

import pytest

from stagectl.history import StageKey
from tests.unit.stagectl.rows import BEGIN, STAGE


def test_a_trend_may_span_estimators_with_different_figures(where, opened, a_run, an_estimate):
    history = opened(where)
    number = history.start_run(a_run())
    history.add([an_estimate(number)])
    history.add([an_estimate(number, time=BEGIN + 9, figures={"bias": 0.1}, covariance=(0.09,))])
    trend = history.trend(STAGE, "x", (0.01, -0.02))
    assert trend.values["coulomb"].tolist() == [6.0, pytest.approx(math.nan, nan_ok=True)]
    assert trend.sigma["bias"].tolist() == [pytest.approx(math.nan, nan_ok=True), 0.3]


def test_series_are_thinned_backwards_from_the_last_estimate(where, opened, a_run, an_estimate):
    """However long production goes on: so many of each place, so far apart."""
    history = opened(where)
    number = history.start_run(a_run())
    places = ((0.0, 0.0), (0.01, 0.0))
    history.add(
        [
            an_estimate(
                number, axis=axis, place=place, time=BEGIN + 10.0 * k,
                measured=None if k % 3 == 0 else (6.0 + k, 0.1), accepted=k % 4 > 0,
            )
            for k in range(12) for place in places for axis in "xy"
        ]
    )  # fmt: skip

    def trend(**asked):
        found = history.trend(STAGE, "x", places[1], **asked)
        return [round((t - BEGIN) / 10.0) for t in found.time]

    assert trend() == [1, 2, 3, 5, 6, 7, 9, 10, 11]
    assert trend(last=3) == [9, 10, 11]
    assert trend(apart=40.0) == [3, 7, 11]
    assert trend(apart=40.0, last=2) == [7, 11]
    measured = history.measurements(STAGE, each=2)
    assert [m.time for m in measured] == sorted(m.time for m in measured)
    assert {(m.axis, m.place, m.value) for m in measured} == {
        (axis, place, 6.0 + k) for axis in "xy" for place in places for k in (10, 11)
    }
    far = history.measurements(STAGE, each=9, apart=50.0)
    assert [m.value - 6.0 for m in far] == [5.0] * 4 + [11.0] * 4
    part = history.measurements(STAGE, BEGIN + 30.0, BEGIN + 100.0, each=9, apart=30.0)
    assert [m.value - 6.0 for m in part] == [4.0] * 4 + [7.0] * 4 + [10.0] * 4
    assert history.measurements(STAGE, since=BEGIN + 95.0, each=9) == history.measurements(
        STAGE, since=BEGIN + 95.0
    )
    assert history.newest(STAGE) == BEGIN + 110.0
    assert history.newest(StageKey("nobody's", False)) is None
