"""The holding brake in 0x60FE: set without force, released under it, by hand only without power."""

from __future__ import annotations

import pytest

OUTPUTS, MASK = (1, 0x60FE, 1, "I"), (1, 0x60FE, 2, "I")


def set_by_drive(host):
    return bool(host.read_object(*OUTPUTS) & 1)


def test_the_brake_is_applied_without_force_and_released_under_it(host, stage):
    assert set_by_drive(host)
    host.enable(8)
    assert not set_by_drive(host)
    host.control(0x07)
    assert set_by_drive(host)
    host.enable(8)
    stage.drives[0].safe_torque_off(True)
    assert set_by_drive(host)


def test_a_fault_applies_the_brake_only_when_the_force_goes_off(host, stage, plant):
    host.write(1, 0x6085, 0, "I", 1_000_000)
    host.write(1, 0x60FF, 0, "i", 50_000_000)
    host.enable(3)
    host.wait(200)
    stage.drives[0].inject_fault(0x4310)
    host.wait(10)
    assert plant.powered[0]  # braking
    assert not set_by_drive(host)
    host.wait(100)
    assert not plant.powered[0]
    assert set_by_drive(host)


def test_the_host_releases_the_brake_until_the_axis_is_enabled(host):
    host.write(*MASK, 1)
    host.write(*OUTPUTS, 0)
    assert not set_by_drive(host)
    host.write(*OUTPUTS, 1)
    assert set_by_drive(host)
    host.write(*OUTPUTS, 0)
    host.enable(8)
    assert host.read_object(*MASK) == 0
    host.control(0x07)
    assert set_by_drive(host)


def test_the_brake_cannot_be_applied_under_power(host):
    host.enable(8)
    host.write(*MASK, 1)
    with pytest.raises(Exception, match="0x08000022"):
        host.write(*OUTPUTS, 1)
    assert not set_by_drive(host)
