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


@pytest.mark.parametrize(
    ("facts", "text"),
    [
        ({"map": 3, "map_comment": "after service"}, "map 3 (after service)"),
        ({"map": 3}, "map 3"),
        ({}, "none"),
        ({"map": None, "compensation": "model"}, "none (compensation model)"),
    ],
)
def test_the_friction_map_of_a_run_in_words(facts: dict[str, Any], text: str):
    assert content.friction_map_used({"compensation": "estimated", **facts}) == text


def test_interrupted_moves_are_not_in_the_table(summary: dict[str, Any]):
    moves = [{**move, "completed": False} for move in summary["moves"] if move["axis"] == "x"]
    moves += [move for move in summary["moves"] if move["axis"] == "y"]
    assert {row.axis for row in content.result_rows({**summary, "moves": moves}, ("x", "y"))} == {
        "y"
    }


def test_refused_figures_are_not_the_latest(summary: dict[str, Any]):
    assert content.latest_friction(summary, ("x", "y")) == [("x", "coulomb", "6.02", "0.0100", "N")]
