"""The end of a run in words, from its summary alone."""

import pytest

from stagectl.report.ending import interruption, reason, resume_command, verdict


def ended(**told):
    return {"fault": None, "interrupted": {"unit": "site", "done": 7, "of": 20, "at": 8, **told}}


@pytest.mark.parametrize(
    ("told", "text"),
    [
        ({}, "at site 8 of 20"),
        ({"at": None}, "after site 7 of 20"),
        ({"at": None, "done": 0}, "before the first of 20 sites"),
        ({"unit": "move", "at": None, "done": 0}, "before the first of 20 moves"),
    ],
)
def test_where_it_ended(told, text):
    assert interruption(ended(**told)) == text


def test_a_complete_run_has_no_place_no_reason_and_no_command():
    summary = {"fault": None}
    assert interruption(summary) is None
    assert reason(summary) == ""
    assert resume_command(summary) is None


def test_the_reason_of_the_interruption_comes_before_the_fault():
    assert reason({**ended(reason="stopped by the operator"), "fault": "axis x: ..."}) == (
        "stopped by the operator"
    )
    assert reason({**ended(), "fault": "axis x: lost"}) == "axis x: lost"
    assert resume_command(ended(resume="stagectl run --resume a")) == "stagectl run --resume a"


@pytest.mark.parametrize(
    ("limits", "text"),
    [
        (("pass", 20, 0), "wafer W1 passes: all 20 sites are within the limits"),
        (("fail", 17, 2), "wafer W1 fails: 2 of 19 sites miss the limits"),
        (("incomplete", 5, 0), "wafer W1 incomplete: 5 of 20 sites judged, all within the limits"),
        (("incomplete", 0, 0), "wafer W1 incomplete: 0 of 20 sites judged"),
    ],
)
def test_the_verdict_counts_sites(limits, text):
    how, passed, failed = limits
    judged = {"verdict": how, "passed": passed, "failed": failed, "of": 20}
    assert verdict({"wafer": "W1", "limits": judged}) == text
    assert verdict({"wafer": None}) is None
