"""Several recordings on one clock: what has faded in one is not there again in the next."""

from __future__ import annotations

from dataclasses import replace

import pytest

from hil_sim.effects.library import library
from sim2real.diagnosis import diagnose, examine
from sim2real.diagnosis.clock import find_common_clock
from tests.unit.sim2real.conftest import TOLERANCE, stage_with

FIRST, LATER = "2026-03-01T10:00:00+01:00", "2026-03-01T09:04:00+00:00"
APART = 240.0


def test_start_times_of_any_zone_and_order_make_a_clock(nominal):
    pair = [replace(nominal[0], started=started) for started in (LATER, FIRST)]
    clock = find_common_clock(pair)
    assert clock.starts == (APART, 0.0)
    assert "240 s later" in str(clock.text)


@pytest.mark.parametrize(
    ("started", "why"),
    [
        ("", "no start time"),
        ("2026-03-01T10:04:00", "no start time with a zone"),
        (FIRST, "overlap"),
        ("2026-03-01T10:30:00+01:00", "cooled down"),
    ],
)
def test_without_a_clock_the_reason_is_told(nominal, started, why):
    pair = [replace(nominal[0], started=at) for at in (FIRST, started)]
    clock = find_common_clock(pair)
    assert clock.starts == (0.0, 0.0)
    assert why in str(clock.text)


def test_one_recording_needs_no_clock(nominal):
    assert find_common_clock([nominal[0]]).text is None


WORN = {"friction_position": {"amplitude": 0.3, "center": 0.05, "width": 0.03}}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "values", "then"),
    [
        ("thermal_drift", {"amplitude": 0.35, "time_constant": 20.0}, {}),
        ("friction_position", WORN["friction_position"], WORN),
    ],
)
def test_recordings_minutes_apart_part_drift_from_a_worn_place(nominal, effect, values, then):
    before = replace(stage_with(nominal, 11, x={effect: values}), started=FIRST)
    after = replace(stage_with(nominal, 11, x=then), started=LATER)
    examined = examine([before, after], nominal[1])
    assert [m.replay.start for m in examined.measured] == [0.0, APART]
    known = library()
    tried = {name: known[name] for name in ("thermal_drift", "friction_position", "coulomb_level")}
    report = diagnose(examined, TOLERANCE, tried, jobs=1).report
    assert [(c.axis, c.effect) for c in report.causes] == [("x", effect)]
    assert report.causes[0].probability > 0.9
    assert report.clock == examined.clock.text
