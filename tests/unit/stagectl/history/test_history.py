"""The friction history, one suite for every database behind the port."""

import math

import pytest

from stagectl.errors import StagectlError
from stagectl.history import StageKey, StepRecord

BEGIN = 1.7e9
STAGE = StageKey("wafer-xy", True)


def test_an_estimate_comes_back_as_it_was(where, opened, a_run, an_estimate):
    history = opened(where)
    run = a_run(lot="L7", wafer="W3", seed=5)
    number = history.start_run(run)
    first = an_estimate(number, temperature=22.4, measured=(1.02, 0.003), level=0.99)
    refused = an_estimate(
        number, accepted=False, reason="coulomb jumps by +20%", axis="y", time=BEGIN + 2, site=None
    )
    history.add([first, refused])
    history.end_run(number, "completed")
    history.close()

    again = opened(where, write=False)
    assert again.at_date(STAGE, math.inf) == [first]
    assert again.refused(STAGE) == [refused]
    assert again.runs(STAGE) == [(number, run, "completed")]
    assert again.counted(STAGE) == (1, 1)
    assert again.places(STAGE) == [(0.01, -0.02)]
    trend = again.trend(STAGE, "x", (0.01, -0.02))
    assert {name: v.tolist() for name, v in trend.values.items()} == {
        "coulomb": [6.0], "viscous": [20.0]
    }  # fmt: skip
    assert {name: v.tolist() for name, v in trend.sigma.items()} == {
        "coulomb": [0.2], "viscous": [0.5]
    }  # fmt: skip
    assert (trend.temperature[0], trend.level[0], trend.run) == (22.4, 0.99, (number,))


def test_a_date_gives_the_last_accepted_estimate_of_each_place_and_axis(
    where, opened, a_run, an_estimate
):
    history = opened(where)
    number = history.start_run(a_run())
    sites = [(0.0, 0.0), (0.01, 0.0), (0.0, 0.01)]
    for week in range(4):
        history.add(
            [
                an_estimate(
                    number, axis=axis, place=place, time=BEGIN + week * 1e5 + i,
                    figures={"coulomb": 10.0 * week + i, "viscous": 1.0},
                    accepted=week != 3, reason=None if week != 3 else "no",
                )
                for i, place in enumerate(sites) for axis in "xy"
            ]
        )  # fmt: skip
    for when, week in ((math.inf, 2), (BEGIN + 1.5e5, 1), (BEGIN + 50, 0)):
        rows = history.at_date(STAGE, when)
        assert len(rows) == 6
        got = {(r.axis, r.place): r.figures["coulomb"] for r in rows}
        assert got == {
            (a, p): 10.0 * week + i
            for i, p in enumerate(sites) for a in "xy"
        }  # fmt: skip
    assert history.at_date(STAGE, BEGIN - 1) == []
    trend = history.trend(STAGE, "y", sites[1], since=BEGIN + 1e4, until=BEGIN + 1.5e5)
    assert trend.values["coulomb"].tolist() == [11.0]
    assert len(history.trend(STAGE, "z", sites[1])) == 0


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
    assert trend(apart=30.0, until=BEGIN + 100.0, since=BEGIN + 30.0) == [3, 7, 10]
    measured = history.measurements(STAGE, each=2)
    assert [m.time for m in measured] == sorted(m.time for m in measured)
    assert {(m.axis, m.place, m.value) for m in measured} == {
        (axis, place, 6.0 + k) for axis in "xy" for place in places for k in (10, 11)
    }
    far = history.measurements(STAGE, each=9, apart=50.0)
    assert [m.value - 6.0 for m in far] == [5.0] * 4 + [11.0] * 4
    assert history.measurements(STAGE, since=BEGIN + 95.0, each=9) == history.measurements(
        STAGE, since=BEGIN + 95.0
    )
    assert history.newest(STAGE) == BEGIN + 110.0
    assert history.newest(StageKey("nobody's", False)) is None


def test_what_counts_as_a_calibration(where, opened, a_run, an_estimate):
    """Sites of a calibration, and such as were slipped into production; no other move."""
    history = opened(where)
    at = {"calibrated": (0.0, 0.0), "slipped": (0.01, 0.0), "moved": (0.02, 0.0)}
    shown = {"measured": (6.0, 0.1), "kind": "other"}
    number = history.start_run(a_run(purpose="calibration"))
    history.add([an_estimate(number, place=at["calibrated"], time=BEGIN, **shown)])
    number = history.start_run(a_run())
    history.add(
        [
            an_estimate(number, place=at["calibrated"], time=BEGIN + 5.0, **shown),
            an_estimate(number, place=at["slipped"], site=None, time=BEGIN + 6.0, **shown),
        ]
    )
    number = history.start_run(a_run())  # a list of moves has no sites
    history.add([an_estimate(number, place=at["moved"], site=None, time=BEGIN + 9.0, **shown)])
    assert dict(history.calibrated(STAGE)) == {
        at["calibrated"]: BEGIN, at["slipped"]: BEGIN + 6.0
    }  # fmt: skip


def test_stages_are_kept_apart(where, opened, a_run, an_estimate):
    history = opened(where)
    real = StageKey("wafer-xy", False)
    for stage, coulomb in ((STAGE, 1.0), (real, 2.0)):
        number = history.start_run(a_run(stage))
        history.add([an_estimate(number, figures={"coulomb": coulomb}, covariance=(0.1,))])
    assert set(history.stages()) == {STAGE, real}
    for stage, coulomb in ((STAGE, 1.0), (real, 2.0)):
        assert [r.figures["coulomb"] for r in history.at_date(stage, math.inf)] == [coulomb]
        assert len(history.trend(stage, "x", (0.01, -0.02))) == 1


def test_estimates_are_added_all_or_none(where, opened, a_run, an_estimate):
    history = opened(where)
    number = history.start_run(a_run())
    good = an_estimate(number, place=(0.05, 0.05))
    with pytest.raises((StagectlError, ValueError)):
        history.add([good, an_estimate(number + 1000)])
    assert history.at_date(STAGE, math.inf) == []
    history.add([good])  # the place of the failed one was rolled back with it
    assert history.at_date(STAGE, math.inf) == [good]


def test_filing_again_adds_nothing(where, opened, a_run, an_estimate):
    """After a connection was lost nobody knows whether the last rows got through."""
    history = opened(where)
    run = a_run(uuid="5eed")
    number = history.start_run(run)
    assert history.start_run(run) == number != history.start_run(a_run(uuid="0ther"))
    history.add([an_estimate(number, number=1)])
    history.add([an_estimate(number, number=n, time=BEGIN + n) for n in (1, 2, 3)])
    step = StepRecord(number, "x", (0.01, -0.02), BEGIN + 2.0, 0.1, "site", number=1)
    history.add_step(step)
    history.add_step(step)
    assert history.filed(number) == 3
    assert history.at_date(STAGE, BEGIN + 1.5)[0].time == BEGIN + 1.0  # as it was
    assert history.steps(STAGE) == [step]


def test_runs_with_estimates_that_may_be_missing_are_listed(where, opened, a_run):
    history = opened(where)
    runs = {name: history.start_run(a_run(uuid=name, folder=f"runs/{name}")) for name in "abcd"}
    history.start_run(a_run(StageKey("another", True), uuid="e"))
    history.start_run(a_run())  # of an older version: nobody could tell which files are its own
    history.end_run(runs["a"], "completed", estimates=7)
    history.end_run(runs["b"], None, estimates=2)  # killed, and filed since
    history.end_run(runs["c"], "fault", "axis x: ...")
    assert history.unfiled(STAGE) == [("d", "runs/d"), ("c", "runs/c")]
    assert history.unfiled(STAGE, last=1) == [("d", "runs/d")]
    outcomes = {number: outcome for number, _, outcome in history.runs(STAGE)}
    assert [outcomes[runs[name]] for name in "abcd"] == ["completed", None, "fault", None]


def test_a_reader_reads_while_the_writer_writes(where, opened, a_run, an_estimate):
    writer = opened(where)
    number = writer.start_run(a_run())
    readers = [opened(where, write=False) for _ in range(3)]
    for i in range(5):
        writer.add([an_estimate(number, time=BEGIN + i)])
        for reader in readers:
            assert len(reader.trend(STAGE, "x", (0.01, -0.02))) == i + 1
    with pytest.raises(StagectlError):
        readers[0].start_run(a_run())
