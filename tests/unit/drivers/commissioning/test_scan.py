"""Nodes are found by listening and by asking, and two devices with one id are noticed."""

from drivers.commissioning import scan
from hil_sim.stage import VirtualStage
from stagectl.config.settings.package_settings import stage_settings
from tests.unit.drivers.commissioning.conftest import network, world_of


def test_scan_listens_and_asks(machine):
    with network(machine) as (bus, stage):
        for drive in stage.drives:
            drive.dictionary.set_data(0x1017, 0, b"\x64\x00")
        found = scan(bus)
        assert [(f.node, f.heard, f.nmt) for f in found] == [
            (n, ["heartbeat", "SDO"], "pre-operational") for n in (1, 2)
        ]
        stage.drives[0].inject_fault(0x7305)
        assert scan(bus)[0].error_code == 0x7305


def test_scan_asks_twice_who_is_expected_and_does_not_answer(machine):
    with network(machine) as (bus, _):
        asked = []
        bus.tap = lambda t, can_id, data: asked.append(can_id)
        found = scan(bus, expected=(1, 2, 9))
        assert asked.count(0x609) == 2
        assert asked.count(0x60A) == 1
        assert [f.node for f in found] == [1, 2]


def test_scan_finds_two_devices_with_one_id(machine):
    with network(machine) as (bus, _):
        twin = stage_settings(machine)
        VirtualStage(twin, seed=2).attach(world_of(bus))
        bus.pump(0.05)
        assert all(f.doubled for f in scan(bus))


def test_a_passive_scan_sends_nothing(machine):
    with network(machine) as (bus, _):
        sent = []
        bus.tap = lambda t, can_id, data: sent.append(can_id)
        scan(bus, ask=False)
    assert sent == []
