"""Faults of the drive: what triggers them, EMCY, error code, reaction, and how they go away."""

from __future__ import annotations

import struct

import pytest

from hil_sim.cia301 import ENCODER_LOST, OVER_CURRENT, OVER_TRAVEL, UNDER_VOLTAGE

FAULT, DISABLED, ENABLED = 0x08, 0x40, 0x27


def emergencies(host, node=1):
    return [struct.unpack_from("<HB", f.data) for f in host.take(0x080 + node)]


def reset(host):
    host.control(0x00)
    return host.control(0x80)


@pytest.mark.parametrize(
    ("code", "register"),
    [(ENCODER_LOST, 0x21), (OVER_CURRENT, 0x03), (UNDER_VOLTAGE, 0x05)],
)
def test_what_leaves_nothing_to_brake_with_takes_the_force_off(host, stage, plant, code, register):
    host.enable(8)
    stage.drives[0].inject_fault(code)
    assert emergencies(host) == [(code, register)]
    assert host.statusword() & 0x4F == FAULT
    assert not plant.powered[0]
    assert host.read_object(1, 0x603F, 0, "H") == code
    assert host.read_object(1, 0x1003, 1, "I") == code
    assert host.read_object(1, 0x1001, 0, "B") == register
    assert reset(host) & 0x4F == DISABLED
    assert emergencies(host) == [(0, 0)]
    assert host.read_object(1, 0x603F, 0, "H") == 0
    host.enable(8)


def test_others_are_braked_by_the_fault_reaction(host, stage, plant):
    host.write(1, 0x6084, 0, "I", 1_000_000)
    host.write(1, 0x60FF, 0, "i", 50_000_000)
    host.enable(3)
    host.wait(200)
    stage.drives[0].inject_fault(0x4310)  # too hot
    assert host.statusword() & 0x4F == 0x0F
    assert plant.powered[0]
    host.wait(20)
    assert host.statusword() & 0x4F == FAULT
    assert not plant.powered[0]


def test_a_fault_when_disabled_is_a_fault_too(host, stage):
    stage.drives[0].inject_fault(ENCODER_LOST)
    assert host.statusword() & 0x4F == FAULT
    stage.drives[0].inject_fault(OVER_CURRENT)  # one at a time
    assert emergencies(host) == [(ENCODER_LOST, 0x21)]
    assert host.statusword(2) & 0x4F == DISABLED


def test_a_lasting_cause_refuses_the_reset(host, stage):
    drive = stage.drives[0]
    assert host.statusword() & 0x10
    drive.inject_fault(UNDER_VOLTAGE, lasting=True)
    assert not host.statusword() & 0x10  # no supply
    assert reset(host) & 0x4F == FAULT
    drive.end_fault(UNDER_VOLTAGE)
    assert host.statusword() & 0x5F == FAULT | 0x10
    assert reset(host) & 0x4F == DISABLED
    host.enable(8)


@pytest.mark.parametrize("code", [0, -1, 0x10000])
def test_what_is_no_error_code(stage, host, code):
    with pytest.raises(ValueError, match="error code"):
        stage.drives[0].inject_fault(code)


def test_the_end_switch_stops_the_axis_and_lets_it_back(host, plant):
    host.write(1, 0x6065, 0, "I", 0xFFFFFFFF)
    host.enable(1)
    plant.blocked[0] = True  # somebody's hand
    plant.actual[0] = 0.1549  # the switch is 5 mm beyond the travel of 150 mm
    host.wait(5)
    assert host.statusword() & 0x6F == ENABLED
    plant.actual[0] = 0.1551
    host.wait(20)
    assert emergencies(host)[0][0] == OVER_TRAVEL
    assert host.statusword() & 0x4F == FAULT
    assert reset(host) & 0x4F == DISABLED
    host.enable(1)  # still beyond: it may be moved back
    host.wait(10)
    assert host.statusword() & 0x6F == ENABLED
    plant.actual[0] = 0.15
    host.wait(5)
    plant.actual[0] = -0.156
    host.wait(20)
    assert host.statusword() & 0x4F == FAULT


def test_full_force_against_an_obstacle_is_over_current(host, plant):
    host.write(1, 0x6065, 0, "I", 0xFFFFFFFF)  # nobody watches the following error
    plant.force = lambda axis: 120.0 if plant.blocked[axis] else 0.0
    host.write(1, 0x60FF, 0, "i", 1_000_000)
    host.enable(3)
    host.wait(100)
    assert host.statusword() & 0x6F == ENABLED
    plant.blocked[0] = True
    host.wait(150)
    assert host.statusword() & 0x6F == ENABLED
    host.wait(100)
    assert host.statusword() & 0x4F == FAULT
    assert emergencies(host)[0][0] == OVER_CURRENT


def test_the_sync_counter(host):
    assert host.refusal(lambda: host.write(1, 0x1019, 0, "B", 1)) == 0x06090030
    assert host.refusal(lambda: host.write(1, 0x1019, 0, "B", 241)) == 0x06090031
    host.write(1, 0x1006, 0, "I", 1000)
    assert host.refusal(lambda: host.write(1, 0x1019, 0, "B", 10)) == 0x08000022
    host.write(1, 0x1006, 0, "I", 0)
    host.write(1, 0x1019, 0, "B", 10)
    host.nmt(1)
    host.send(0x080, b"\x01")
    assert len(host.take(0x181)) == 1
    for _ in range(3):
        host.send(0x080)
    assert host.take(0x181) == []
    assert emergencies(host) == [(0x8240, 0x11)]  # once
    host.nmt(130)
    host.wait(30)
    host.nmt(1)
    host.send(0x080)
    assert len(host.take(0x181)) == 1


def test_safe_torque_off_takes_the_force_and_keeps_it(host, stage, plant):
    host.enable(8)
    stage.drives[0].safe_torque_off(True)
    assert not plant.powered[0]
    assert host.statusword() & 0x5F == DISABLED  # and no supply
    assert host.read_object(1, 0x60FD, 0, "I") == 1 << 3
    assert emergencies(host) == []
    for command in (6, 7, 15):
        assert host.control(command) & 0x5F == DISABLED
    stage.drives[0].safe_torque_off(False)
    assert host.statusword() & 0x5F == DISABLED | 0x10  # nothing comes back by itself
    assert host.read_object(1, 0x60FD, 0, "I") == 0
    host.enable(8)
    assert plant.powered[0]


def test_safe_torque_off_goes_before_what_would_brake(host, stage, plant):
    host.write(1, 0x6084, 0, "I", 1_000_000)
    host.write(1, 0x60FF, 0, "i", 50_000_000)
    host.enable(3)
    host.wait(200)
    stage.drives[0].inject_fault(0x4310)
    assert plant.powered[0]
    stage.drives[0].safe_torque_off(True)
    assert not plant.powered[0]
    assert host.statusword() & 0x4F == FAULT


def test_end_switches_show_in_the_digital_inputs(host, plant):
    assert host.read_object(1, 0x60FD, 0, "I") == 0
    plant.actual[0] = -0.156
    assert host.read_object(1, 0x60FD, 0, "I") == 1
    plant.actual[0] = 0.156
    assert host.read_object(1, 0x60FD, 0, "I") == 2
