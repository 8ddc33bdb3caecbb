"""Facts of a run for the report's header."""

from typing import Any

import pytest

from stagectl.report import facts as header


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
    assert header.friction_map_used({"compensation": "estimated", **facts}) == text


def test_learned_feedforward_names_what_differs_from_the_machine_file():
    learned = {
        "x": {"mass": 0.0931, "lead": 0.0, "coupling": -0.02},
        "y": {"mass": 0.0, "lead": 0.0, "coupling": 0.0},
    }
    assert header.learned_feedforward({"feedforward": learned}) == (
        "x: mass +9.3\u00a0%, coupling -2.0\u00a0%; y: as in the machine file"
    )
    assert header.learned_feedforward({}) == ""
