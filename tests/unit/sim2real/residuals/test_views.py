"""All views of a recording, with and without a demand, and their JSON."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim2real.gap import compare_with_model
from sim2real.residuals import gather_course, residuals_json, view_residuals
from stagectl.config import load_machine, stage_settings
from stagectl.store import read_recording

DATA = Path(__file__).parents[3] / "data"


@pytest.fixture(scope="module")
def measured():
    return compare_with_model(
        read_recording(DATA / "null-2.h5"), stage_settings(load_machine()), draws=1
    )


def without_demand(measured):
    recording = measured.replay.recording
    axes = {
        name: replace(s, position_demand=s.position_actual, missing=("position_demand",))
        for name, s in recording.axes.items()
    }
    replay = replace(measured.replay, recording=replace(recording, axes=axes))
    return replace(measured, replay=replay)


def test_a_recording_is_viewed_from_all_sides(measured):
    views = view_residuals([measured], [measured.floor.nominal], stage_settings(load_machine()))
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


def test_without_a_demand_the_measured_motion_is_taken(measured):
    blind = without_demand(measured)
    seen = gather_course([measured], None, "x", 0.1)
    course = gather_course([blind], None, "x", 0.1)
    assert course.demand is None
    assert np.abs(course.position - seen.position).max() < 1e-3
    fast = np.abs(seen.velocity) > 0.05
    assert np.abs(course.velocity - seen.velocity)[fast].max() < 0.05
    assert course.moving[fast].all()
    view = view_residuals([blind], None, stage_settings(load_machine()))["x"]
    assert not view.has_demand
    assert view.response is None
    assert view.velocity
    assert view.reversals


def test_nothing_measured_is_nothing_seen():
    assert view_residuals([], None, stage_settings(load_machine())) == {}
