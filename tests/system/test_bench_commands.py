"""scan, status, enable, home, jog, bus-budget as integrators meet them, on the virtual stage."""

import json
import re

import can
import pytest
from click.testing import CliRunner

from stagectl.cli import cli
from stagectl.errors import StagectlError, UnusableInput


@pytest.fixture
def call():
    """The command in this process: (exit code or exception, standard output)."""

    def go(*arguments):
        done = CliRunner().invoke(cli, [*map(str, arguments)], env={"COLUMNS": "160"})
        failure = done.exception if done.exit_code == 1 and done.exception else done.exit_code
        return failure, done.stdout, done.stderr

    return go


def test_scan_finds_both_drives(call):
    failure, out, _ = call("scan", "--simulate", "--json", "-")
    assert failure == 0
    found = json.loads(out)
    assert [(n["node"], n["axis"], n["profile"]) for n in found] == [(1, "x", 402), (2, "y", 402)]
    assert {n["name"] for n in found} == {"stagectl linear drive"}
    assert {n["state"] for n in found} == {"SWITCH ON DISABLED"}
    assert not any(n["doubled"] for n in found)


def test_nothing_of_scan_and_status_is_cut_off_at_80_columns():
    for command, known in (("scan", "vendor 0x535447"), ("status", "SWITCH ON")):
        out = CliRunner().invoke(cli, [command, "--simulate"], env={"COLUMNS": "80"}).stdout
        assert known in out
        assert "…" not in out


def test_a_passive_scan_of_a_silent_bus_says_so(call):
    failure, out, err = call("scan", "--simulate", "--passive")
    assert failure == 0
    assert "no node was heard" in out
    assert "axis x: node 1" in err


@pytest.mark.parametrize("more", [(), ("--json", "-"), ("--passive",)])
def test_a_scan_that_misses_a_node_of_the_machine_file_fails(call, more):
    failure, out, err = call("scan", "--bus", "virtual:nobody", "--listen", 0.01, *more)
    if "--passive" in more:
        asked = ""
        assert failure == 0
    else:
        asked = ", asked twice"
        assert isinstance(failure, SystemExit)  # no error, exit code 1
    assert f"axis y: node 2 of wafer-xy.yaml (packaged) was not heard{asked}\n" in err
    assert out.strip() == "[]" or "no node was heard" in out


def test_status_in_words_and_as_json(call):
    failure, out, _ = call("status", "--simulate")
    assert failure == 0
    assert out.count("off, no force") == 2
    failure, out, _ = call("status", "--simulate", "--json", "-")
    status = json.loads(out)
    assert list(status) == ["x", "y"]
    assert status["y"]["state"] == "SWITCH ON DISABLED"
    assert status["y"]["error_history"] == []
    assert (status["y"]["sto"], status["y"]["brake"]) == (False, True)
    assert status["y"]["words"] == "off, no force; brake set"


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


def test_a_bus_that_cannot_be_opened_is_one_line(call):
    failure, _, _ = call("status", "--bus", "no_such_interface:0")
    assert isinstance(failure, UnusableInput)
    assert str(failure).startswith("bus no_such_interface:0: cannot open")


def test_bus_budget_of_the_stage(call):
    failure, out, _ = call("bus-budget", "--json", "-")
    assert failure == 0
    assert json.loads(out)["bits_worst"] == 595
    failure, out, _ = call("bus-budget", "--tpdo", 8, "--tpdo", 8, "--bitrate", 500_000)
    assert isinstance(failure, StagectlError)
    assert "shortest SYNC period" in out


def test_check_passes_on_the_virtual_drive(call):
    failure, out, _ = call("check", 2, "--simulate", "--json", "-")
    assert failure == 0
    findings = json.loads(out)
    assert {f["verdict"] for f in findings} == {"pass"}
    failure, out, _ = call("check", 2, "--simulate", "--no-power", "--failures")
    assert failure == 0
    assert re.search(r"\d+ pass, 0 FAIL, 0 differs, 0 not offered", out)


def test_check_of_nobody_is_one_line(call):
    failure, _, _ = call("check", 9, "--simulate")
    assert str(failure) == "node 9 does not answer SDO"


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
