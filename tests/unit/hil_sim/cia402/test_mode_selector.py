"""The mode of operation: how one gives way to another; which there are: the conformance checks."""

import pytest

PP, PV, CSP = 1, 3, 8


def test_a_mode_left_in_motion_brakes_with_the_profile_deceleration(host, plant):
    host.write(1, 0x6083, 0, "I", 1_000_000)
    host.write(1, 0x6084, 0, "I", 2_000_000)  # 2 m/s^2
    host.write(1, 0x6081, 0, "I", 100_000_000)
    host.enable(PP)
    start = host.read_object(1, 0x6064, 0, "i")
    host.write(1, 0x607A, 0, "i", start + 50_000_000)
    host.control(0x1F)
    host.wait(150)
    speed = (plant.actual[0], host.wait(1), plant.actual[0])
    rate = (speed[2] - speed[0]) / 1e-3
    assert rate == pytest.approx(0.1, rel=0.02)
    left_at = plant.actual[0]
    host.write(1, 0x6060, 0, "b", PV)
    host.wait(200)
    # 2.5 mm at 2 m/s^2 from 100 mm/s, within 2 ms of travel; pv then holds its target of 0
    assert plant.actual[0] - left_at == pytest.approx(0.1**2 / 4.0, abs=2e-4)
    at_rest = plant.actual[0]
    host.wait(50)
    assert plant.actual[0] == at_rest


def test_the_torque_offset_does_not_survive_a_change_under_power(host):
    host.enable(CSP)
    host.write(1, 0x60B2, 0, "h", 40)
    host.write(1, 0x6060, 0, "b", PP)
    assert host.read_object(1, 0x60B2, 0, "h") == 0


def test_choosing_the_present_mode_again_changes_nothing(host):
    host.enable(CSP)
    host.write(1, 0x60B2, 0, "h", 40)
    host.write(1, 0x6060, 0, "b", CSP)
    assert host.read_object(1, 0x60B2, 0, "h") == 40


def test_after_reset_there_is_no_mode(host):
    host.enable(CSP)
    host.nmt(129, 1)
    host.wait(50)
    assert host.read_object(1, 0x6061, 0, "b") == 0
