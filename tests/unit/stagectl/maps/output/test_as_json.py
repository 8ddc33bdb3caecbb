"""Maps as JSON for other programs: docs/formats/history.md."""

import json

import pytest

from stagectl.history import Activation
from stagectl.maps import compare
from stagectl.maps.applicable import Problem
from stagectl.maps.output import version_as_json
from stagectl.maps.output.as_json import activation_as_json, changes_as_json, versions_as_json
from tests.unit.stagectl.maps.conftest import BEGIN, GRID, STAGE, level


def through_json(value):
    return json.loads(json.dumps(value, allow_nan=False))


def test_every_answer_names_its_format_and_stage(mapped):
    first, second = mapped.first, mapped.second
    for said in (
        version_as_json(first), versions_as_json(STAGE, [first], []),
        changes_as_json(STAGE, 1, 2, compare(first.map, second.map)),
        activation_as_json(STAGE, 2, [], "activated"),
    ):  # fmt: skip
        found = through_json(said)
        assert found["version"] == 1
        assert (found["machine"], found["simulated"]) == ("wafer-xy", True)


def test_a_version_has_its_sites_and_on_request_a_place(mapped):
    found = through_json(version_as_json(mapped.first, GRID[3]))
    for name, axis in found["axes"].items():
        assert len(axis["sites"]) == len(GRID)
        at = axis["at"]
        assert at["low"] < at["coulomb"] < at["high"]
        assert at["coulomb"] == pytest.approx(level(name, GRID[3]), rel=0.05)
        assert at["inside"] is True
    assert "at" not in through_json(version_as_json(mapped.first))["axes"]["x"]


def test_changes_are_listed_with_the_largest_first(mapped):
    changes = compare(mapped.first.map, mapped.second.map)
    found = through_json(changes_as_json(STAGE, 1, 2, changes))
    assert (found["old"], found["new"]) == (1, 2)
    for axis in found["axes"].values():
        sizes = [abs(site["change"]) for site in axis["sites"]]
        assert sizes == sorted(sizes, reverse=True)
        assert axis["sites"][0]["place"] == list(GRID[7])
        assert axis["sites"][0]["significant"] is True


def test_versions_and_their_use(mapped):
    used = [Activation(1, BEGIN, "activated"), Activation(None, BEGIN + 1.0, "rolled back")]
    found = through_json(versions_as_json(STAGE, [mapped.first] * 2, used))
    assert [entry["sites"] for entry in found["maps"]] == [{"x": 25, "y": 25}] * 2
    assert [entry["map"] for entry in found["used"]] == [1, None]


def test_a_grave_problem_makes_a_version_inapplicable():
    mild, grave = Problem(False, "old"), Problem(True, "another machine")
    assert activation_as_json(STAGE, 1, [mild], "activated")["applicable"] is True
    refused = activation_as_json(STAGE, None, [mild, grave], None)
    assert refused["applicable"] is False
    assert [p["grave"] for p in refused["problems"]] == [False, True]
