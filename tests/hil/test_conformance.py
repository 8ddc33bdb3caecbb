"""The CiA 402 probe: our virtual drive passes all of it, and each deviation is found and named."""

from __future__ import annotations

import itertools
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import can
import pytest

from drivers.bench.conformance import Finding, Verdict, run
from drivers.bench.scan import scan
from drivers.canopen.bus import Network
from drivers.errors import NodeError
from hil_sim.bus.world import World
from hil_sim.cia301.dictionary import key
from hil_sim.stage import VirtualStage
from stagectl.config.machine import Machine
from stagectl.config.machine_file import load_machine
from stagectl.config.mapping import stage_settings

_names = itertools.count()


class Altering:
    """A node's connection on which frames are altered on their way out, or swallowed."""

    def __init__(self, world: World, alter: Callable[[int, bytes], bytes | None]) -> None:
        self._world, self._alter = world, alter

    @property
    def now_ns(self) -> int:
        return self._world.now_ns

    def emit(self, can_id: int, data: bytes) -> None:
        altered = self._alter(can_id, data)
        if altered is not None:
            self._world.emit(can_id, altered)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._world, name)


@contextmanager
def network(
    machine: Machine, alter: Callable[[int, bytes], bytes | None] = lambda i, d: d
) -> Iterator[tuple[Network, VirtualStage]]:
    world = World(f"conformance-{next(_names)}")
    stage = VirtualStage(stage_settings(machine), seed=1)
    stage.attach(Altering(world, alter))  # type: ignore[arg-type]
    with can.Bus(interface="lockstep", channel=world.name) as bus:
        made = Network(bus, "lockstep", beats=False)
        made.pump(0.05)
        yield made, stage


def world_of(network: Network) -> World:
    return network.bus.world  # type: ignore[union-attr, no-any-return]


@pytest.fixture(scope="module")
def machine() -> Machine:
    return load_machine()


def failures(findings: list[Finding]) -> set[str]:
    return {f.name for f in findings if f.verdict is not Verdict.PASS}


def test_the_virtual_drive_passes_everything(machine: Machine) -> None:
    told: list[Finding] = []
    with network(machine) as (bus, stage):
        before = [dict(d.dictionary.values) for d in stage.drives]
        findings = run(bus, 1, homing=True, told=told.append)
        after = [dict(d.dictionary.values) for d in stage.drives]
    assert [f for f in findings if f.verdict is not Verdict.PASS] == []
    assert len(findings) > 90
    assert told == findings
    # what it changed is as before; the rest is the drive's own doing
    own = {key(0x6041), key(0x6040), key(0x6061), key(0x607A), key(0x60B2)}
    own |= {key(0x1003, n) for n in range(9)}
    for old, new in zip(before, after, strict=True):
        assert {k: v for k, v in new.items() if old[k] != v and k not in own} == {}


def test_the_axis_is_not_moved(machine: Machine) -> None:
    with network(machine) as (bus, stage):
        before = stage.plant.encoder(0)
        seen = []
        run(bus, 1, told=lambda _: seen.append(stage.plant.encoder(0)))
    assert max(abs(x - before) for x in seen) < 2_000  # nm: it rings on its friction when enabled


def test_without_power_no_force(machine: Machine) -> None:
    seen: set[int] = set()

    def alter(can_id: int, data: bytes) -> bytes:
        if can_id == 0x581 and data[1:4] == b"\x41\x60\x00":
            seen.add(struct.unpack_from("<H", data, 4)[0] & 0x6F)
        return data

    with network(machine, alter) as (bus, _):
        run(bus, 1, power=False)
    assert 0x27 not in seen
    assert 0x23 in seen


def _abort(index: int, sub: int, code: int) -> Callable[[int, bytes], bytes]:
    """Every abort of this object carries another code."""

    def alter(can_id: int, data: bytes) -> bytes:
        if can_id == 0x581 and data[:4] == struct.pack("<BHB", 0x80, index, sub):
            return data[:4] + struct.pack("<I", code)
        return data

    return alter


def test_another_abort_code_differs_and_is_named(machine: Machine) -> None:
    with network(machine, _abort(0x1A00, 0, 0x08000000)) as (bus, _):
        findings = run(bus, 1, power=False)
    (found,) = [f for f in findings if f.name == "mapping while the PDO is valid"]
    assert found.verdict is Verdict.DIFFERS
    assert "abort 0x08000000 (General error), not 0x06010000" in found.detail
    assert not [f for f in findings if f.verdict is Verdict.FAIL]


def test_a_drive_without_acknowledge_in_pp(machine: Machine) -> None:
    """No bit 12 ever: told as not offered, the rest still checked."""

    def alter(can_id: int, data: bytes) -> bytes:
        if can_id == 0x581 and data[1:4] == b"\x41\x60\x00":
            word = struct.unpack_from("<H", data, 4)[0] & ~0x1000
            return data[:4] + struct.pack("<H", word) + data[6:]
        return data

    with network(machine, alter) as (bus, _):
        findings = run(bus, 1)
    by_name = {f.name: f for f in findings}
    assert by_name["bit 4 up: bit 12 comes up"].verdict is Verdict.ABSENT
    assert by_name["bit 10: target reached"].verdict is Verdict.PASS
    assert by_name["bit 12: follows the command value"].verdict is Verdict.FAIL


def test_a_drive_that_maps_while_the_pdo_is_valid(machine: Machine) -> None:
    with network(machine) as (bus, stage):
        del stage.drives[0].dictionary.check[key(0x1A00)]
        findings = run(bus, 1, power=False)
    assert {"mapping while the PDO is valid", "more than 64 bits"} <= failures(findings)


def test_a_silent_heartbeat_and_a_missing_emergency(machine: Machine) -> None:
    with network(machine, lambda i, d: None if i in (0x701, 0x081) else d) as (bus, _):
        findings = run(bus, 1)
    failed = failures(findings)
    assert {"heartbeat shows OPERATIONAL", "boot-up message after reset communication"} <= failed
    assert {"an emergency says so", "EMCY 0x8130 when a watched heartbeat stays away"} <= failed
    assert "the rising edge of bit 7 does (transition 15)" not in failed


def test_a_synchronous_rpdo_that_acts_on_arrival(machine: Machine) -> None:
    with network(machine) as (bus, stage):
        world = world_of(bus)

        def hasty(found: Finding) -> None:
            if found.name.startswith("type 3"):  # what comes next is the RPDO
                world.subscribe(0x201, lambda _: world.at(world.now_ns, stage.drives[0].pdo.latch))

        findings = run(bus, 1, power=False, told=hasty)
    assert failures(findings) == {"a synchronous RPDO waits for the SYNC"}


def test_nobody_there_is_one_error(machine: Machine) -> None:
    with network(machine) as (bus, _), pytest.raises(NodeError, match="node 9 does not answer"):
        run(bus, 9)


def test_scan_hears_and_asks(machine: Machine) -> None:
    with network(machine) as (bus, stage):
        for drive in stage.drives:
            drive.dictionary.set_data(0x1017, 0, b"\x64\x00")
        found = scan(bus)
        assert [(f.node, f.heard, f.nmt) for f in found] == [
            (n, ["heartbeat", "SDO"], "pre-operational") for n in (1, 2)
        ]
        stage.drives[0].inject_fault(0x7305)
        assert scan(bus)[0].error_code == 0x7305


def test_scan_sees_two_devices_on_one_id(machine: Machine) -> None:
    with network(machine) as (bus, _):
        twin = stage_settings(machine)
        VirtualStage(twin, seed=2).attach(world_of(bus))
        bus.pump(0.05)
        assert all(f.doubled for f in scan(bus))


def test_a_passive_scan_sends_nothing(machine: Machine) -> None:
    with network(machine) as (bus, _):
        sent: list[int] = []
        bus.tap = lambda t, can_id, data: sent.append(can_id)
        scan(bus, ask=False)
    assert sent == []
