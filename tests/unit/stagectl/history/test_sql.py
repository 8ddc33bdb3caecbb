"""The friction history, one suite for every database behind the port."""

import math

import pytest

from stagectl.errors import StagectlError
from stagectl.history import AxisFriction, RunFilter, StageKey
from tests.unit.stagectl.rows import BEGIN, STAGE


def test_an_estimate_comes_back_as_it_was(where, opened, a_run, an_estimate):
    history = opened(where)
    run = a_run(lot="L7", wafer="W3", seed=5)
    number = history.start_run(run)
    first = an_estimate(number, temperature=22.4, measured=(1.02, 0.003), level=0.99)
    jump = {"accepted": False, "reason": "coulomb jumps by +20 %"}
    refused = an_estimate(number, axis="y", time=BEGIN + 2, site=None, **jump)
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
    assert trend.values == {"coulomb": [6.0], "viscous": [20.0]}
    assert trend.sigma == {"coulomb": [0.2], "viscous": [0.5]}
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
    assert history.trend(STAGE, "y", sites[1]).values["coulomb"].tolist() == [1.0, 11.0, 21.0]
    assert len(history.trend(STAGE, "z", sites[1])) == 0


def test_what_counts_as_a_calibration(where, opened, a_run, an_estimate):
    """Sites of a calibration, and such as were slipped into production; no other move."""
    history = opened(where)
    at = {"calibrated": (0.0, 0.0), "slipped": (0.01, 0.0), "moved": (0.02, 0.0)}
    shown = {"measured": (6.0, 0.1), "kind": "other"}
    number = history.start_run(a_run(purpose="calibration"))
    history.add([an_estimate(number, place=at["calibrated"], time=BEGIN, **shown)])
    number = history.start_run(a_run())
    history.add([an_estimate(number, place=at["calibrated"], time=BEGIN + 5.0, **shown)])
    history.add([an_estimate(number, place=at["slipped"], site=None, time=BEGIN + 6.0, **shown)])
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


def test_runs_are_listed_with_the_friction_they_accepted_last(where, opened, a_run, an_estimate):
    history = opened(where)
    told = [("A", "production"), ("B", "production"), ("A", "calibration")]
    runs = [
        history.start_run(a_run(started=BEGIN + 100 * k, lot=lot, wafer="W", purpose=purpose))
        for k, (lot, purpose) in enumerate(told)
    ]
    last = {"figures": {"viscous": 20.0, "coulomb": 6.5}, "covariance": (0.25, 0.0, 0.0, 0.04)}
    history.add([
        an_estimate(runs[0], time=BEGIN + 1), an_estimate(runs[0], time=BEGIN + 2, **last),
        an_estimate(runs[0], time=BEGIN + 3, accepted=False, reason="jump"),
        an_estimate(runs[0], axis="y", accepted=False, reason="jump"),
    ])  # fmt: skip
    history.end_run(runs[0], "completed")

    def numbers(**wanted):
        return [run.number for run in history.friction_of_runs(STAGE, RunFilter(**wanted))]

    assert numbers() == runs[::-1]
    assert numbers(lot="A") == [runs[2], runs[0]]
    assert numbers(lot="A", purpose="production", recipe="r", wafer="W") == [runs[0]]
    assert numbers(since=BEGIN + 50, until=BEGIN + 150) == [runs[1]]
    assert numbers(last=1) == [runs[2]]
    assert numbers(wafer="none") == []
    *_, first = history.friction_of_runs(STAGE, RunFilter())
    assert first.outcome == "completed"
    assert first.axes == {"x": AxisFriction(3, 2, 6.5, 0.2), "y": AxisFriction(1, 0, None, None)}
