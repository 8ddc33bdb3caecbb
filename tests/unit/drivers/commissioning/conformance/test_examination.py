"""All groups on one node: the virtual drive passes, is left as found, and is not moved."""

import struct

import pytest

from drivers.commissioning.conformance import Verdict, run
from drivers.errors import NodeError
from hil_sim.cia301 import key
from tests.unit.drivers.commissioning.conftest import network


def test_the_virtual_drive_passes_all_checks(machine):
    reported = []
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


def test_the_axis_is_not_moved(machine):
    with network(machine) as (bus, stage):
        before = stage.plant.encoder(0)
        seen = []
        run(bus, 1, on_finding=lambda _: seen.append(stage.plant.encoder(0)))
    assert max(abs(x - before) for x in seen) < 2_000  # nm: it rings on its friction when enabled


def test_without_power_the_axis_is_not_enabled(machine):
    seen = set()

    def alter(can_id, data):
        if can_id == 0x581 and data[1:4] == b"\x41\x60\x00":
            seen.add(struct.unpack_from("<H", data, 4)[0] & 0x6F)
        return data

    with network(machine, alter) as (bus, _):
        run(bus, 1, power=False)
    assert 0x27 not in seen
    assert 0x23 in seen


def test_a_missing_node_is_one_error(machine):
    with network(machine) as (bus, _), pytest.raises(NodeError, match="node 9 does not answer"):
        run(bus, 9)
