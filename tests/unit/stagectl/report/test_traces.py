"""The data of the report's charts."""

from dataclasses import replace

import numpy as np
import pytest

from stagectl.report.traces import BEFORE, chart_data, friction_panels, panel_range
from tests.unit.stagectl.report.conftest import summary_of

TC, TS = 1e-4, 1e-3


def test_missed_samples_are_gaps(recording):
    k = recording.moves[2].start
    x = replace(recording.axes["x"], valid=np.arange(len(recording)) != k)
    masked = replace(recording, axes={"x": x, "y": recording.axes["y"]})
    data = chart_data(masked, summary_of(masked), TC)
    assert data["moves"][2]["error"]["x"][BEFORE] is None
    assert data["moves"][2]["force"]["x"][BEFORE] is None
    assert data["moves"][2]["error"]["y"][BEFORE] is not None


def test_a_move_outside_a_window_at_its_end_is_marked_for_that_window(recording, summary):
    drawn = chart_data(recording, summary, TC)["settling"]
    assert [("5e-08" in e["outside"]) for e in drawn] == [
        not m["settled"] for m in summary["moves"]
    ]
    wider = [e for e in drawn if "2e-07" in e["outside"]]
    assert 0 < len(wider) < sum("5e-08" in e["outside"] for e in drawn)
    for entry in wider:  # outside the wider window at the end: the whole time for both
        assert entry["times"]["2e-07"] == entry["times"]["5e-08"]


def test_a_long_run_embeds_its_slowest_micro_moves_and_says_how_many_it_leaves_out(
    recording, summary
):
    data = chart_data(recording, summary, TC, max_samples=2000)
    assert 0 < len(data["moves"]) < 15
    assert data["left_out"] == len(recording.moves) - len(data["moves"])
    assert {move["kind"] for move in data["moves"]} == {"micro"}
    assert len(data["settling"]) == len(summary["moves"])  # the overview stays whole
    assert data["moves"][data["first"]]["kind"] == "micro"


def test_a_summary_of_another_recording_is_refused(recording, summary):
    with pytest.raises(ValueError, match="not those of the recording"):
        chart_data(replace(recording, moves=recording.moves[:5]), summary, TC)


def point(value, sigma, accepted=True):
    return {"value": value, "sigma": sigma, "accepted": accepted}


def entry(axis, site, **values):
    figures = {name: {"value": v, "sigma": 0.01 * v, "unit": "N"} for name, v in values.items()}
    return {"axis": axis, "site": site, "accepted": True, "parameters": figures}


COURSE = [point(6.0e5 + d, 2e3) for d in (0.0, 500.0, -800.0, 300.0)]


@pytest.mark.parametrize(
    ("points", "lowest", "highest"),
    [
        ([point(3.0e5, 2.4e5), point(6.07e5, 3.9e4), *COURSE], (5.9e5, 5.972e5), (6.025e5, 6.1e5)),
        ([point(6.0 + 0.1 * k, 0.05) for k in range(20)], (0.0, 5.95), (7.95, 99.0)),
        ([*(point(6.0, 0.01) for _ in range(9)), point(9.0, 1.0)], (0.0, 6.0), (10.0, 99.0)),
    ],
    ids=["before it was known", "a known drift", "the last one, however uncertain"],
)
def test_the_range_has_all_that_matters_and_is_not_widened_by_the_rest(points, lowest, highest):
    low, high = panel_range(points)
    assert lowest[0] < low < lowest[1]
    assert highest[0] < high < highest[1]


def test_refused_estimates_count_only_if_all_were_refused():
    assert panel_range([point(6.0, 0.1), point(99.0, 0.1, accepted=False)])[1] < 7.0
    assert panel_range([point(99.0, 1.0, accepted=False)])[0] > 90.0


@pytest.mark.parametrize(
    "points",
    [
        *([point(*one)] for one in ((None, None), (0.0, 0.0), (0.0, None), (5.0, None))),
        [point(-1.7e308, 1e307), point(1.7e308, 1e307)],
    ],
)
def test_a_range_is_never_empty_nor_infinite(points):
    low, high = panel_range(points)
    assert -float("inf") < low < high < float("inf")


def test_each_parameter_and_axis_has_a_panel_with_estimates_of_a_site_side_by_side():
    entries = [
        entry("x", 1, coulomb=6.0, viscous=20.0), entry("y", 1, coulomb=9.0),
        entry("x", 1, coulomb=6.1, viscous=20.0), entry("x", 2, coulomb=6.0),
    ]  # fmt: skip
    panels = friction_panels(entries, ("x", "y", "z"), by_site=True)
    assert [(p["name"], p["axis"]) for p in panels] == [
        ("coulomb", "x"), ("coulomb", "y"), ("viscous", "x"),
    ]  # fmt: skip
    assert [p["place"] for p in panels[0]["points"]] == [0.9, 1.1, 2.0]
    assert [p["place"] for p in panels[2]["points"]] == [0.9, 1.1]
    assert panels[0]["high"] < panels[1]["low"]


def test_many_estimates_of_a_site_stay_near_it():
    (panel,) = friction_panels([entry("x", 3, coulomb=6.0)] * 18, ("x",), by_site=True)
    places = [p["place"] for p in panel["points"]]
    assert 2.6 <= places[0] < places[1] < places[-1] <= 3.4
