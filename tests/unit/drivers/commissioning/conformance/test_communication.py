"""Deviations from CiA 301 are found and named."""

import struct

from drivers.commissioning.conformance import Verdict, run
from hil_sim.cia301 import key
from tests.unit.drivers.commissioning.conftest import failures, network, world_of


def _abort(index, sub, code):
    """Every abort of this object carries another code."""

    def alter(can_id, data):
        if can_id == 0x581 and data[:4] == struct.pack("<BHB", 0x80, index, sub):
            return data[:4] + struct.pack("<I", code)
        return data

    return alter


def test_another_abort_code_differs_and_is_named(machine):
    with network(machine, _abort(0x1A00, 0, 0x08000000)) as (bus, _):
        findings = run(bus, 1, power=False)
    (found,) = [f for f in findings if f.name == "mapping while the PDO is valid"]
    assert found.verdict is Verdict.DIFFERS
    assert "abort 0x08000000 (General error), not 0x06010000" in found.detail
    assert not [f for f in findings if f.verdict is Verdict.FAIL]


def test_a_drive_that_maps_while_the_pdo_is_valid(machine):
    with network(machine) as (bus, stage):
        del stage.drives[0].dictionary.check[key(0x1A00)]
        findings = run(bus, 1, power=False)
    assert {"mapping while the PDO is valid", "more than 64 bits"} <= failures(findings)


def test_missing_heartbeats_and_emergencies_are_found(machine):
    with network(machine, lambda i, d: None if i in (0x701, 0x081) else d) as (bus, _):
        findings = run(bus, 1)
    failed = failures(findings)
    assert {"heartbeat shows OPERATIONAL", "boot-up message after reset communication"} <= failed
    assert {"an emergency is sent", "EMCY 0x8130 when a watched heartbeat ends"} <= failed
    assert "the rising edge of bit 7 does (transition 15)" not in failed


def test_a_synchronous_rpdo_that_takes_effect_on_arrival_is_found(machine):
    with network(machine) as (bus, stage):
        world = world_of(bus)

        def hasty(found):
            if found.name.startswith("type 3"):  # what comes next is the RPDO
                world.subscribe(0x201, lambda _: world.at(world.now_ns, stage.drives[0].pdo.latch))

        findings = run(bus, 1, power=False, on_finding=hasty)
    assert failures(findings) == {"a synchronous RPDO waits for the SYNC"}
