"""Streams in csp on scripted drives."""

import dataclasses

import numpy as np
import pytest

from drivers.drive import Mode
from drivers.errors import AxisFault
from drivers.stage import Stage
from tests.unit.drivers.conftest import rest


def test_a_stream_needs_an_enabled_stage(stage, scripted):
    sent = len(scripted.sent)
    with pytest.raises(AxisFault, match="not enabled"):
        stage.stream(*rest(stage, 3))
    assert not [f for f in scripted.sent[sent:] if f[1] == 0x080]


def test_a_stream_in_another_mode_is_refused(opened, scripted):
    for drive in scripted.drives:
        drive.objects[0x6502, 0] = 0x1A1 | 0x200  # with csv and cst
    with opened:
        opened.boot()
        opened.enable()
        opened.stream_velocity(np.zeros((2, 2)))
        with pytest.raises(AxisFault, match=r"^axis x: the stage is not in csp: enable it first"):
            opened.stream(*rest(opened, 3))
        opened.enable()
        assert len(opened.stream(*rest(opened, 3))) == 3


def test_enabling_an_enabled_stage_changes_no_mode(enabled, scripted):
    for drive in scripted.drives:
        drive.writes.clear()
    enabled.enable()
    assert all(not drive.writes for drive in scripted.drives)
    assert all(drive.objects[0x6060, 0] == Mode.CYCLIC_SYNC_POSITION for drive in scripted.drives)


def test_samples_are_in_the_units_of_each_axis(scripted, bus_settings, axis_settings):
    coarse = dataclasses.replace(axis_settings[1], increment=1e-8, velocity_unit=1e-9)
    scripted.drives[1].objects[0x60A8, 0] = 0xF8010000
    with Stage.open(bus_settings, (axis_settings[0], coarse), bus_object=scripted) as stage:
        stage.boot()
        stage.enable()
        samples = stage.stream(*rest(stage, 2))
    np.testing.assert_allclose(samples.position[-1], (1.234e-6, 1.234e-5))
