"""Conformance checks: the virtual drive passes them, and each deviation is found and named."""

from __future__ import annotations

import functools
import itertools
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import can
import pytest
from canopen import SdoAbortedError

from drivers.bench import scan
from drivers.bench.conformance import Finding, Verdict, run
from drivers.canopen import Network
from drivers.errors import NodeError
from hil_sim.bus import World
from hil_sim.cia301 import key
from hil_sim.stage import VirtualStage
from stagectl.config.machine import Machine
from stagectl.config.machine_file import load_machine
from stagectl.config.package_settings import stage_settings

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


def test_the_virtual_drive_passes_all_checks(machine: Machine) -> None:
    reported: list[Finding] = []
    with network(machine) as (bus, stage):
        before = [dict(d.dictionary.values) for d in stage.drives]
        findings = run(bus, 1, homing=True, on_finding=reported.append)
        after = [dict(d.dictionary.values) for d in stage.drives]
    assert [f for f in findings if f.verdict is not Verdict.PASS] == []
    assert len(findings) > 90
    assert reported == findings
    # what it changed is as before; the rest is the drive's own doing
    own = {key(0x6041), key(0x6040), key(0x6061), key(0x607A), key(0x60B2)}
    own |= {key(0x1003, n) for n in range(9)}
    for old, new in zip(before, after, strict=True):
        assert {k: v for k, v in new.items() if old[k] != v and k not in own} == {}


def test_the_axis_is_not_moved(machine: Machine) -> None:
    with network(machine) as (bus, stage):
        before = stage.plant.encoder(0)
        seen = []
        run(bus, 1, on_finding=lambda _: seen.append(stage.plant.encoder(0)))
    assert max(abs(x - before) for x in seen) < 2_000  # nm: it rings on its friction when enabled


def test_without_power_the_axis_is_not_enabled(machine: Machine) -> None:
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
    """No bit 12 ever: reported as not offered, the rest still checked."""

    def alter(can_id: int, data: bytes) -> bytes:
        if can_id == 0x581 and data[1:4] == b"\x41\x60\x00":
            word = struct.unpack_from("<H", data, 4)[0] & ~0x1000
            return data[:4] + struct.pack("<H", word) + data[6:]
        return data

    with network(machine, alter) as (bus, _):
        findings = run(bus, 1)
    by_name = {f.name: f for f in findings}
    assert by_name["bit 12 rises with bit 4"].verdict is Verdict.ABSENT
    assert by_name["bit 10: target reached"].verdict is Verdict.PASS
    assert by_name["bit 12: follows the command value"].verdict is Verdict.FAIL


def test_a_drive_that_maps_while_the_pdo_is_valid(machine: Machine) -> None:
    with network(machine) as (bus, stage):
        del stage.drives[0].dictionary.check[key(0x1A00)]
        findings = run(bus, 1, power=False)
    assert {"mapping while the PDO is valid", "more than 64 bits"} <= failures(findings)


PDO_AREA = range(0x1400 << 8, 0x1C00 << 8)


def process_data(stage: VirtualStage) -> dict[int, Any]:
    """Parameters of all PDOs of node 1, and what else of its communication can be set."""
    others = {key(0x1005), key(0x1006), key(0x1007), key(0x1016, 1), key(0x1017), key(0x1029, 1)}
    values = stage.drives[0].dictionary.values
    return {k: v for k, v in values.items() if k in PDO_AREA or k in others}


def set_up(bus: Network, stage: VirtualStage) -> dict[int, Any]:
    """As another master left it: not what the drive has after a reset."""
    dictionary = stage.drives[0].dictionary
    for index, sub, fmt, value in (
        (0x1800, 1, "I", 0xC0000181), (0x1A00, 0, "B", 0),
        (0x1A00, 1, "I", 0x606C0020), (0x1A00, 2, "I", 0x60410010), (0x1A00, 3, "I", 0x60610008),
        (0x1A00, 0, "B", 3), (0x1800, 2, "B", 4), (0x1800, 1, "I", 0x40000181),
        (0x1400, 1, "I", 0x80000201), (0x1600, 0, "B", 0), (0x1600, 1, "I", 0x60FF0020),
        (0x1600, 0, "B", 1), (0x1400, 2, "B", 255), (0x1400, 1, "I", 0x00000221),
        (0x1801, 1, "I", 0xC0000281), (0x1801, 2, "B", 254), (0x1801, 1, "I", 0xC0000291),
        (0x1005, 0, "I", 0x80000080), (0x1016, 1, "I", 100 << 16 | 9000), (0x1017, 0, "H", 70),
        (0x1029, 1, "B", 2),
    ):  # fmt: skip
        dictionary.set_data(index, sub, struct.pack("<" + fmt, value))
    bus.pump(0.05)
    return process_data(stage)


def forgets_entries(stage: VirtualStage) -> None:
    """A drive whose mapping entries are gone, and not to be read, once the count is 0."""
    dictionary = stage.drives[0].dictionary
    for mapping in (0x1600, 0x1A00):

        def forget(count: int, mapping: int = mapping) -> None:
            for sub in range(count + 1, 9):
                dictionary.values[key(mapping, sub)] = 0

        def entry(mapping: int, sub: int) -> int:
            if sub > dictionary.integer(key(mapping, 0)):
                raise SdoAbortedError(0x06090011)
            return dictionary.integer(key(mapping, sub))

        for sub in range(1, 9):
            dictionary.live[key(mapping, sub)] = functools.partial(entry, mapping, sub)
        dictionary.on_write[key(mapping, 0)] = forget


def wants_entries_in_order(stage: VirtualStage) -> None:
    """A drive that takes entry n only after entry n - 1, and forgets all with the count."""
    dictionary = stage.drives[0].dictionary
    for mapping in (0x1600, 0x1A00):

        def forget(count: int, mapping: int = mapping) -> None:
            for sub in range(1, 9) if count == 0 else ():
                dictionary.values[key(mapping, sub)] = 0

        def check(value: int, mapping: int, sub: int, then: Callable[[int], None]) -> None:
            then(value)
            if sub > 1 and not dictionary.integer(key(mapping, sub - 1)):
                raise SdoAbortedError(0x06040042)

        dictionary.on_write[key(mapping, 0)] = forget
        for sub in range(1, 9):
            k = key(mapping, sub)
            dictionary.check[k] = functools.partial(
                check, mapping=mapping, sub=sub, then=dictionary.check[k]
            )


def is_as_it_is(stage: VirtualStage) -> None:
    """Our drive itself."""


@pytest.mark.parametrize("kind", [is_as_it_is, forgets_entries, wants_entries_in_order])
def test_process_data_are_restored_as_they_were_found(
    machine: Machine, kind: Callable[[VirtualStage], None]
) -> None:
    with network(machine) as (bus, stage):
        kind(stage)
        before = set_up(bus, stage)
        findings = run(bus, 1)
        assert failures(findings) == set()
        assert process_data(stage) == before


def test_process_data_are_restored_after_an_interruption(machine: Machine) -> None:
    def interrupt(found: Finding) -> None:
        if found.name.startswith("type 3"):
            raise KeyboardInterrupt

    with network(machine) as (bus, stage):
        before = set_up(bus, stage)
        with pytest.raises(KeyboardInterrupt):
            run(bus, 1, power=False, on_finding=interrupt)
        assert process_data(stage) == before


def test_values_that_the_drive_does_not_accept_back_are_reported(machine: Machine) -> None:
    with network(machine) as (bus, stage):
        set_up(bus, stage)
        dictionary = stage.drives[0].dictionary
        theirs = dictionary.check[key(0x1A00, 1)]

        def only_the_statusword(value: int) -> None:
            theirs(value)
            if value >> 16 != 0x6041:
                raise SdoAbortedError(0x06040041)

        dictionary.check[key(0x1A00, 1)] = only_the_statusword
        findings = run(bus, 1, power=False)
    (found,) = [f for f in findings if f.verdict is Verdict.FAIL]
    assert (found.group, found.name) == ("NMT", "changed values are restored")  # by the reset
    assert found.detail.startswith("0x1800 has COB-ID 0x")
    assert "606C0020 60410010 60610008 mapped" in found.detail


def test_missing_heartbeats_and_emergencies_are_found(machine: Machine) -> None:
    with network(machine, lambda i, d: None if i in (0x701, 0x081) else d) as (bus, _):
        findings = run(bus, 1)
    failed = failures(findings)
    assert {"heartbeat shows OPERATIONAL", "boot-up message after reset communication"} <= failed
    assert {"an emergency is sent", "EMCY 0x8130 when a watched heartbeat ends"} <= failed
    assert "the rising edge of bit 7 does (transition 15)" not in failed


def test_a_synchronous_rpdo_that_takes_effect_on_arrival_is_found(machine: Machine) -> None:
    with network(machine) as (bus, stage):
        world = world_of(bus)

        def hasty(found: Finding) -> None:
            if found.name.startswith("type 3"):  # what comes next is the RPDO
                world.subscribe(0x201, lambda _: world.at(world.now_ns, stage.drives[0].pdo.latch))

        findings = run(bus, 1, power=False, on_finding=hasty)
    assert failures(findings) == {"a synchronous RPDO waits for the SYNC"}


def test_a_missing_node_is_one_error(machine: Machine) -> None:
    with network(machine) as (bus, _), pytest.raises(NodeError, match="node 9 does not answer"):
        run(bus, 9)


def test_scan_listens_and_asks(machine: Machine) -> None:
    with network(machine) as (bus, stage):
        for drive in stage.drives:
            drive.dictionary.set_data(0x1017, 0, b"\x64\x00")
        found = scan(bus)
        assert [(f.node, f.heard, f.nmt) for f in found] == [
            (n, ["heartbeat", "SDO"], "pre-operational") for n in (1, 2)
        ]
        stage.drives[0].inject_fault(0x7305)
        assert scan(bus)[0].error_code == 0x7305


def test_scan_asks_twice_who_is_expected_and_does_not_answer(machine: Machine) -> None:
    with network(machine) as (bus, _):
        asked: list[int] = []
        bus.tap = lambda t, can_id, data: asked.append(can_id)
        found = scan(bus, expected=(1, 2, 9))
        assert asked.count(0x609) == 2
        assert asked.count(0x60A) == 1
        assert [f.node for f in found] == [1, 2]


def test_scan_finds_two_devices_with_one_id(machine: Machine) -> None:
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
