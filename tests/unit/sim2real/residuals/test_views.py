"""All views of a recording, with and without a demand, and their JSON."""

import json
from dataclasses import replace

import pytest

from sim2real.gap import compare_with_model
from sim2real.residuals import residuals_json, view_residuals
from sim2real.residuals.course import gather_course


@pytest.fixture(scope="module")
def measured(stage, recorded):
    return compare_with_model(recorded, stage, draws=1)


def test_a_recording_is_viewed_from_all_sides(measured, stage):
    views = view_residuals([measured], [measured.floor.nominal], stage)
    for view in views.values():
        assert view.has_demand
        assert {m.direction for m in view.velocity} == {-1, 1}
        assert set(view.plane.mean) == {"before", "after"}
        assert view.response.excited.any()
        assert view.reversals
    text = json.dumps(residuals_json(views), allow_nan=False)
    found = json.loads(text)["residuals"]
    assert set(found) == {"x", "y"}
    assert set(found["x"]) == {"over_velocity", "response", "reversals"}
    assert set(found["x"]["over_velocity"][0]["mean"]) == {"before", "after"}


def test_two_recordings_follow_one_another(measured):
    one = gather_course([measured], None, "x", 0.1)
    two = gather_course([measured, measured], None, "x", 0.1)
    count = len(one.position)
    assert two.starts == (0, count)
    assert len(two.strokes) == 2 * len(one.strokes)
    assert two.strokes[len(one.strokes)].start == one.strokes[0].start + count
    assert set(two.simulated) == {"before"}


def test_where_only_forces_are_compared_there_is_no_response(measured, stage):
    forces = {axis: {"force": of["force"]} for axis, of in measured.gap.items()}
    view = view_residuals([replace(measured, gap=forces)], None, stage)["x"]
    assert not view.has_demand
    assert view.response is None
    assert view.velocity
    assert view.plane is not None


def test_nothing_measured_is_nothing_seen(stage):
    assert view_residuals([], None, stage) == {}
