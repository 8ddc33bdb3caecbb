"""`stagectl scan` on the virtual stage."""

import json

import pytest
from click.testing import CliRunner

from hil_sim.bus import World
from hil_sim.stage import VirtualStage
from stagectl.cli import cli
from stagectl.config import load_machine, stage_settings


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
    asked = "" if "--passive" in more else ", asked twice"
    assert (failure != 0) is bool(asked)
    assert f"axis y: node 2 of wafer-xy.yaml (packaged) was not heard{asked}\n" in err
    assert out.strip() == "[]" or "no node was heard" in out


def test_two_devices_with_one_id_fail_the_scan(call):
    world = World("scan-twins")
    for seed in (1, 2):
        VirtualStage(stage_settings(load_machine()), seed).attach(world)
    world.sleep_until_ns(50_000_000)
    failure, out, err = call("scan", "--bus", f"lockstep:{world.name}")
    assert isinstance(failure, SystemExit)
    assert "TWO DEVICES" in out
    assert "node 1: two devices have this id" in err
