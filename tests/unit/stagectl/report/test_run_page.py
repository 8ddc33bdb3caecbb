"""The report: one file that needs nothing else, saying what the summary says."""

import json
import re
from dataclasses import replace
from statistics import median

import numpy as np

from stagectl.report.run_page import render_report
from stagectl.report.traces import BEFORE
from stagedata import aligned_demand
from tests.unit.stagectl.report.conftest import friction, summary_of
from tests.unit.stagectl.report.page import Page

TC, TS = 1e-4, 1e-3


def test_the_page_loads_nothing(recording, summary):
    html = render_report(recording, summary, control_period=TC)
    page = Page(html)
    assert page.loads == []
    assert page.stack == []
    assert "default-src 'none'" in html
    assert not re.search(r"@import|url\(|fetch\(|XMLHttpRequest|import\(", html)
    assert "uPlot" in html


def test_the_page_states_the_results_of_the_summary(recording, summary):
    text = Page(render_report(recording, summary, control_period=TC)).text
    assert "Completed" in text
    micro = [move for move in summary["moves"] if move["kind"] == "micro"]
    times = {a: [m["settling"]["5e-08"] for m in micro if m["axis"] == a] for a in "xy"}
    slower = max(map(median, times.values()))
    assert f"±50 nm in {1e3 * slower:g}\u00a0ms" in text
    assert "1 of 2 friction estimates were refused" in text
    assert "innovation <too> large" in text  # as text, not as a tag
    assert "6.02" in text


def test_text_of_files_cannot_become_markup(recording):
    evil = "</script><script>alert(1)</script>"
    bad = replace(recording, machine=evil, recipe=evil)
    entry = friction(2, "y", 1.0, evil)
    entry["parameters"] = {evil: {"value": 1.0, "sigma": 1.0, "unit": evil}}
    summary = summary_of(bad, recipe=evil, fault=evil, outcome="fault", friction=[entry])
    html = render_report(bad, summary, control_period=TC)
    assert html.count("<script>alert") == 0
    page = Page(html)
    assert page.stack == []
    assert json.loads(page.data)["friction"][0]["name"] == evil


def test_embedded_error_is_that_of_the_recording(recording, summary):
    data = json.loads(Page(render_report(recording, summary, control_period=TC)).data)
    assert len(data["moves"]) == len(recording.moves)
    number = 5
    move, shown = recording.moves[number], data["moves"][number]
    x = recording.axes["x"]
    first, end = move.start - BEFORE, recording.moves[number + 1].start
    error = (aligned_demand(x, TC / TS) - x.position_actual)[first:end] * 1e9
    np.testing.assert_allclose(shown["error"]["x"], error, rtol=0, atol=0.051)
    np.testing.assert_allclose(shown["force"]["x"], x.force_actual[first:end], atol=0.0051)
    assert shown["start"] == -BEFORE
    k = round(shown["arrived"]["x"]) + move.start
    assert abs(aligned_demand(x, TC / TS)[k] - move.target["x"]) < 1e-9
    assert abs(aligned_demand(x, TC / TS)[k - 1] - move.target["x"]) > 1e-9


def test_a_run_that_was_aborted_before_its_first_move(recording):
    empty = replace(recording, moves=())
    summary = summary_of(empty, outcome="aborted", compensation="none", friction=[])
    page = Page(render_report(empty, summary, control_period=TC))
    assert "Aborted" in page.text
    assert "No micro-move was completed." in page.text
    assert "Friction was not estimated" in page.text
    assert json.loads(page.data)["moves"] == []


def test_a_list_of_moves_has_no_sites(recording, summary):
    moves = tuple(replace(move, site=None) for move in recording.moves)
    entries = [{**entry, "site": None} for entry in summary["moves"]]
    friction = [{**entry, "site": 0} for entry in summary["friction"] * 2]
    bare = {**summary, "moves": entries, "friction": friction}
    page = Page(render_report(replace(recording, moves=moves), bare, control_period=TC))
    data = json.loads(page.data)
    # the n-th estimate of an axis stands at n, not all of them at one place
    places = {panel["axis"]: [p["place"] for p in panel["points"]] for panel in data["friction"]}
    assert places == {"x": [1, 2], "y": [1, 2]}
    assert (data["placeName"], data["estimateName"]) == ("move", "estimate")
    assert "Settling over moves" in page.text
    assert "no site" not in page.text
    assert "site 0" not in page.text
