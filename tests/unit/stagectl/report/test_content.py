"""Sentences and tables of the report."""

from __future__ import annotations

from typing import Any

import pytest

from stagectl.report import content


@pytest.mark.parametrize(
    ("metres", "text"),
    [(9e-8, "0.0900"), (5.2e-5, "52.0"), (0.025, "25 000"), (0.0, "0"), (None, "–")],  # noqa: RUF001
)
def test_lengths_have_three_significant_digits(metres: float | None, text: str):
    assert content.format_micrometres(metres) == text


@pytest.mark.parametrize(("seconds", "text"), [(0.0, "0"), (0.1435, "143.5"), (0.002, "2")])
def test_times_in_milliseconds(seconds: float, text: str):
    assert content.format_milliseconds(seconds) == text


def test_interrupted_moves_are_not_in_the_table(summary: dict[str, Any]):
    moves = [{**move, "completed": False} for move in summary["moves"] if move["axis"] == "x"]
    moves += [move for move in summary["moves"] if move["axis"] == "y"]
    assert {row.axis for row in content.result_rows({**summary, "moves": moves}, ("x", "y"))} == {
        "y"
    }


def test_refused_figures_are_not_the_latest(summary: dict[str, Any]):
    assert content.latest_friction(summary, ("x", "y")) == [("x", "coulomb", "6.02", "0.0100", "N")]


def test_arrival_of_tpdos_is_told_only_where_there_was_a_bus():
    ledger = {
        "tardy": 0, "doubled": 0, "late_in_a_row": 0, "arrival": {"x": {"max": 0.0004}},
    }  # fmt: skip
    summary = {
        "outcome": "completed", "fault": None, "moves": [], "friction": [], "simulated": False,
        "cycle": {"period": 0.002, "missed": 0, "late": 0}, "punctuality": ledger,
    }  # fmt: skip
    assert content.notices(summary)[-1].text.endswith("the latest TPDO came 0.4 ms after its SYNC.")
    assert "latest" not in content.notices({**summary, "simulated": True})[-1].text


def test_the_headline_gives_the_worse_axis_where_one_is_fast():
    moves = [
        {
            "site": site, "axis": axis, "kind": "micro", "peak_error": error, "settled": True,
            "settling": {"5e-08": time, "2e-07": 0.0},
        }
        for site in (1, 2, 3)
        for axis, time, error in (("x", 0.0095, 6e-8), ("y", 0.0, 9e-8))
    ]  # fmt: skip
    summary = {"outcome": "completed", "moves": moves}
    assert content.headline(summary) == (
        "Median settling on the worse axis: ±50 nm in 9.5\u00a0ms (x), ±200 nm in 0\u00a0ms; "
        "median peak error 0.0900\u00a0µm (y) (6 micro-moves)."
    )
    alone = {**summary, "moves": [move for move in moves if move["axis"] == "y"]}
    assert content.headline(alone) == (
        "Median settling: ±50 nm in 0\u00a0ms, ±200 nm in 0\u00a0ms; median peak error "
        "0.0900\u00a0µm (3 micro-moves)."
    )
