"""enable, home and jog as integrators meet them, on the virtual stage."""

import re

import can
import pytest


def test_enable_holds_and_disables(call):
    failure, out, _ = call("enable", "--simulate", "--hold", "0.2")
    assert failure == 0
    assert out.splitlines()[-1] == "disabled"


def test_home_ends_at_zero(call):
    failure, out, _ = call("home", "--simulate")
    assert failure == 0
    x, y = map(float, re.findall(r"(-?[\d.]+) mm", out))
    assert abs(x) < 1e-3
    assert abs(y) < 1e-3


@pytest.mark.parametrize(
    ("distance", "options", "mm"),
    [("2mm", [], 2.0), ("-50um", ["--velocity", "1mm/s"], -0.05), ("0.001", ["--here"], 1.0)],
)
def test_jog_moves_by_the_distance(call, distance, options, mm):
    failure, out, _ = call("jog", "x", distance, "--simulate", *options)
    assert failure == 0
    assert float(re.search(r"moved by (-?[\d.]+) mm", out)[1]) == pytest.approx(mm, abs=2e-4)


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["z", "1mm"], "no axis 'z'"),
        (["x", "0.2"], "outside its travel"),
        (["x", "-0.4", "--here"], "more than its travel"),
        (["x", "1mm", "--velocity", "2m/s"], "must be in (0, 1] m/s"),
        (["x", "1N"], "is a force"),
    ],
)
def test_an_impossible_jog_is_refused_before_any_bus_is_opened(call, arguments, reason):
    # this bus cannot be opened: coming to it would be another error
    failure, _, err = call("jog", *arguments, "--bus", "no_such_interface:0")
    assert failure == 2
    assert reason in err


@pytest.mark.real_time
def test_a_bus_with_a_host_is_left_alone(call):
    beat = can.Message(arbitration_id=0x77F, data=[5], is_extended_id=False)
    with can.Bus(interface="virtual", channel="with-host") as host:
        host.send_periodic(beat, 0.01)
        for refused in (("check", 1), ("jog", "x", "1mm"), ("enable",)):
            failure, _, _ = call(*refused, "--bus", "virtual:with-host")
            assert "another host is on it: a heartbeat of node 127 (0x77F)" in str(failure)
        assert host.recv(0.0) is None
        failure, _, message = call("scan", "--passive", "--listen", 1, "--bus", "virtual:with-host")
        assert failure == 0
        assert "another host is active on this bus: a heartbeat of node 127" in message
