"""Deviations from CiA 301 are found and named."""

import functools
import struct

import pytest
from canopen import SdoAbortedError

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
    (found,) = [f for f in findings if f.check == "mapping while the PDO is valid"]
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
            if found.check.startswith("type 3"):  # what comes next is the RPDO
                world.subscribe(0x201, lambda _: world.at(world.now_ns, stage.drives[0].pdo.latch))

        findings = run(bus, 1, power=False, on_finding=hasty)
    assert failures(findings) == {"a synchronous RPDO waits for the SYNC"}


# -- parameters of PDOs are restored as they were found -----------------------------------------

PDO_AREA = range(0x1400 << 8, 0x1C00 << 8)


def process_data(stage):
    """Parameters of all PDOs of node 1, and what else of its communication can be set."""
    others = {key(0x1005), key(0x1006), key(0x1007), key(0x1016, 1), key(0x1017), key(0x1029, 1)}
    values = stage.drives[0].dictionary.values
    return {k: v for k, v in values.items() if k in PDO_AREA or k in others}


def set_up(bus, stage):
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


def forgets_entries(stage):
    """A drive whose mapping entries are gone, and not to be read, once the count is 0."""
    dictionary = stage.drives[0].dictionary
    for mapping in (0x1600, 0x1A00):

        def forget(count, mapping=mapping):
            for sub in range(count + 1, 9):
                dictionary.values[key(mapping, sub)] = 0

        def entry(mapping, sub):
            if sub > dictionary.integer(key(mapping, 0)):
                raise SdoAbortedError(0x06090011)
            return dictionary.integer(key(mapping, sub))

        for sub in range(1, 9):
            dictionary.live[key(mapping, sub)] = functools.partial(entry, mapping, sub)
        dictionary.on_write[key(mapping, 0)] = forget


def wants_entries_in_order(stage):
    """A drive that takes entry n only after entry n - 1, and forgets all with the count."""
    dictionary = stage.drives[0].dictionary
    for mapping in (0x1600, 0x1A00):

        def forget(count, mapping=mapping):
            for sub in range(1, 9) if count == 0 else ():
                dictionary.values[key(mapping, sub)] = 0

        def check(value, mapping, sub, then):
            then(value)
            if sub > 1 and not dictionary.integer(key(mapping, sub - 1)):
                raise SdoAbortedError(0x06040042)

        dictionary.on_write[key(mapping, 0)] = forget
        for sub in range(1, 9):
            k = key(mapping, sub)
            dictionary.check[k] = functools.partial(
                check, mapping=mapping, sub=sub, then=dictionary.check[k]
            )


def is_as_it_is(stage):
    """Our drive itself."""


@pytest.mark.parametrize("kind", [is_as_it_is, forgets_entries, wants_entries_in_order])
def test_process_data_are_restored_as_they_were_found(machine, kind):
    with network(machine) as (bus, stage):
        kind(stage)
        before = set_up(bus, stage)
        findings = run(bus, 1)
        assert failures(findings) == set()
        assert process_data(stage) == before


def test_process_data_are_restored_after_an_interruption(machine):
    def interrupt(found):
        if found.check.startswith("type 3"):
            raise KeyboardInterrupt

    with network(machine) as (bus, stage):
        before = set_up(bus, stage)
        with pytest.raises(KeyboardInterrupt):
            run(bus, 1, power=False, on_finding=interrupt)
        assert process_data(stage) == before


def test_values_that_the_drive_does_not_accept_back_are_reported(machine):
    with network(machine) as (bus, stage):
        set_up(bus, stage)
        dictionary = stage.drives[0].dictionary
        theirs = dictionary.check[key(0x1A00, 1)]

        def only_the_statusword(value):
            theirs(value)
            if value >> 16 != 0x6041:
                raise SdoAbortedError(0x06040041)

        dictionary.check[key(0x1A00, 1)] = only_the_statusword
        findings = run(bus, 1, power=False)
    (found,) = [f for f in findings if f.verdict is Verdict.FAIL]
    assert (found.group, found.check) == ("NMT", "changed values are restored")  # by the reset
    assert found.detail.startswith("0x1800 has COB-ID 0x")
    assert "606C0020 60410010 60610008 mapped" in found.detail
