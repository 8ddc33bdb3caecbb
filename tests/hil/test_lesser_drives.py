"""Drives without optional features of CiA 402: they are driven, and limitations are reported."""

from contextlib import contextmanager

import numpy as np
import pytest

from drivers.errors import AxisFault, ConfigurationError
from hil_sim.cia301 import key
from stagectl.config.machine.file import load_machine
from tests.lockstep import open_on, power_up, switch_on


@contextmanager
def stage_without(*absent, alter=None, booted_only=False):
    """A stage whose axis x lacks these objects, though its EDS lists them."""
    machine = load_machine()
    drives, world = switch_on(machine, alter=alter)
    for k in list(drives.drives[0].dictionary.variables):
        if k >> 8 in absent:
            del drives.drives[0].dictionary.variables[k]
    with open_on(world, machine) as stage:
        if booted_only:
            stage.boot()
        else:
            power_up(stage)
        yield stage, drives


def test_without_torque_offset_the_axis_streams_and_records_no_offset():
    with stage_without(0x60B2) as (stage, _):
        assert stage.limitations == (
            "axis x: 0x60B2:00 torque offset is not offered: nothing is compensated",
        )
        target = np.tile(stage.targets, (50, 1))
        samples = stage.stream(target + 1e-6, np.full((50, 2), 1.8))
        assert samples.valid.all()
        assert (samples.force_offset[:, 0] == 0).all()
        assert np.allclose(samples.force_offset[:, 1], 1.8)
        assert samples.position[-1, 0] - target[0, 0] == pytest.approx(1e-6, abs=5e-7)


def test_without_torque_offset_there_is_nothing_to_correct():
    class Correction:
        def begin(self, targets, planned, target, continued):
            assert (planned[:, 0] == 0.0).all()

        def offsets(self, row, periods, doubt, channels):
            return [10, 10]

    with stage_without(0x60B2) as (stage, _):
        stage.correct_offsets(Correction())
        samples = stage.hold(0.02)
        assert (samples.force_offset[:, 0] == 0).all()
        assert np.allclose(samples.force_offset[:, 1], 0.6)
        assert stage.notices == ()


def test_without_torque_actual_value_force_reads_zero():
    with stage_without(0x6077) as (stage, _):
        assert stage.limitations == (
            "axis x: 0x6077:00 torque actual value is not offered: "
            "force reads 0, friction cannot be learned",
        )
        samples = stage.hold(0.05)
        assert (samples.force[:, 0] == 0).all()
        assert (samples.statusword[:, 0] & 0x6F == 0x27).all()


def test_without_option_codes_and_windows_the_consequence_is_reported():
    with stage_without(0x6007, 0x605A, 0x605B, 0x605C, 0x605D, 0x605E, 0x6065) as (stage, _):
        assert any("without its host the reaction is manufacturer" in x for x in stage.limitations)
        assert any("does not monitor the following error" in x for x in stage.limitations)
        stage.halt()
        assert stage.enabled


def test_without_what_limits_force_and_stops_the_consequence_is_reported():
    with stage_without(0x6085, 0x6072, 0x605E, 0x60C2) as (stage, _):
        assert [line.split(" ")[2] for line in stage.limitations] == [
            "0x60C2:01", "0x605E:00", "0x6085:00", "0x6072:00",
        ]  # fmt: skip
        assert all("is not offered: " in line for line in stage.limitations)


def test_a_fault_merges_all_that_is_known():
    with stage_without() as (stage, drives):
        target = np.tile(stage.targets, (100, 1))
        count = 0

        def until(_):
            nonlocal count
            count += 1
            if count == 20:
                drives.drives[1].inject_fault(0x7305)
            return False

        with pytest.raises(AxisFault) as caught:
            stage.stream(target, np.zeros_like(target), until=until)
    text = str(caught.value)
    assert text.startswith("axis y: emergency: incremental sensor 1 fault (0x7305)")
    assert "last commands: " in text
    assert "enable operation, mode 8" in text
    assert "\n" not in text
    assert text.count("0x7305") == 1
    report = caught.value.report
    assert report is not None
    assert report.code == caught.value.code == 0x7305
    assert report.error_code == 0x7305
    assert report.error_register == 0x21
    assert report.history[0] == 0x7305
    assert report.emergencies == (0x7305,)
    assert report.controlwords[-1] == 0x0F


def test_halt_holds_where_it_comes_to_rest():
    with stage_without() as (stage, _):
        s = np.linspace(0, 1, 300)[:, None]
        start = np.array(stage.targets)
        moving = stage.stream(start + s * 5e-3, np.zeros((300, 2)))
        stage.halt()
        assert stage.enabled
        rest = stage.hold(0.1)
        assert np.ptp(rest.position[:, 0]) < 1e-6
        braked = rest.position[-1, 0] - moving.position[-1, 0]
        assert 0 < braked < 1e-3  # 17 mm/s at 1 m/s^2: 0.14 mm
        stage.stream(np.tile(stage.targets, (10, 1)), np.zeros((10, 2)))


def test_halt_needs_an_enabled_stage():
    with stage_without() as (stage, _):
        stage.disable()
        with pytest.raises(AxisFault, match=r"^axis x: the stage is not enabled"):
            stage.halt()


def test_without_a_homing_method_nothing_is_homed_nor_powered():
    with stage_without(0x6098, booted_only=True) as (stage, drives):
        with pytest.raises(ConfigurationError, match=r"^axis x: 0x6098:00 .*not offered: homing"):
            stage.home()
        assert not stage.homed
        operation_enabled = 0x04
        for drive in drives.drives:
            assert not drive.dictionary.integer(key(0x6041)) & operation_enabled


@pytest.mark.parametrize("absent", [0x6081, 0x6083, 0x6084])
def test_a_profile_that_cannot_be_written_is_found_before_power(absent):
    with stage_without(absent, booted_only=True) as (stage, _):
        with pytest.raises(ConfigurationError, match=rf"^axis x: 0x{absent:X}:00 .*not offered"):
            stage.check_move_to("x", 0.01, 1.0)
        stage.check_move_to("y", 0.01, 1.0)
