"""Reports of an axis that turns are in rad and N m."""

from __future__ import annotations

from dataclasses import replace

import pytest

from hil_sim.effects.library import library
from sim2real.audit import audit_channels
from sim2real.diagnosis import diagnose, examine
from stagedata import angular_unit
from tests.unit.sim2real.conftest import TOLERANCE, stage_with


@pytest.fixture(scope="module")
def turning(nominal):
    """The same figures on an axis y that turns."""
    recording, settings = nominal
    axes = tuple(replace(axis, rotary=axis.name == "y") for axis in settings.axes)
    return recording, replace(settings, axes=axes)


def test_gap_places_and_causes_have_the_units_of_their_axis(turning):
    settings = turning[1]
    there = {"payload_mass": {"mass": 0.8}}
    recording = stage_with(turning, 11, y=there, x={"force_offset": {"force": 3.0}})
    known = {name: library()[name] for name in ("payload_mass", "force_offset", "cogging")}
    report = diagnose(examine([recording], settings), TOLERANCE, known).report
    assert report.gap is not None
    units = {axis: {s: f.unit for s, f in of.items()} for axis, of in report.gap.items()}
    assert units == {
        "x": {"position": "m", "force": "N"},
        "y": {"position": "rad", "force": "N m"},
    }
    shown = {(c.axis, c.effect): {p.unit for p in c.parameters.values()} for c in report.causes}
    assert shown == {("y", "payload_mass"): {"kg m²"}, ("x", "force_offset"): {"N"}}
    assert not any("mm" in cell.text for cell in report.where if cell.axis == "y")
    assert {cell.unit for cell in report.where if cell.axis == "y"} <= {
        "", "s", "Hz", "rad", "rad/s", "1/rad",
    }  # fmt: skip


def test_channels_of_an_axis_that_turns_are_not_in_metres(turning):
    recording, settings = turning
    degrees = replace(
        recording.axes["y"], position_actual=1e3 * recording.axes["y"].position_actual
    )
    wrong = replace(recording, axes={**recording.axes, "y": degrees})
    texts = [f.text for f in audit_channels(wrong, settings).findings]
    assert "y: position_actual is in mrad, not in radians" in texts


def test_units_without_length_force_or_mass_stay():
    assert [angular_unit(unit) for unit in ("", "Hz", "s", "rad", "N m")] == [
        "", "Hz", "s", "rad", "N m",
    ]  # fmt: skip


def test_every_unit_of_the_library_has_an_angular_one():
    units = {p.unit for effect in library().values() for p in effect.parameters}
    plain = {"", "Hz", "s", "rad", "N m"}
    assert all(angular_unit(unit) != unit for unit in units - plain)
