"""Deviations in the device control of CiA 402 are found and named."""

import struct

from drivers.commissioning.conformance import Verdict, run
from hil_sim.cia301 import key
from tests.unit.drivers.commissioning.conftest import failures, network

STATUSWORD = b"\x41\x60\x00"


def test_a_drive_that_never_shows_quick_stop_active(machine):
    """Transition 11 fails, and what begins in that state is not reached."""

    def alter(can_id, data):
        if can_id == 0x581 and data[1:4] == STATUSWORD and data[4] & 0x6F == 0x07:
            return data[:4] + struct.pack("<H", 0x0237) + data[6:]
        return data

    with network(machine, alter) as (bus, stage):
        stage.drives[0].dictionary.set_data(0x605A, 0, struct.pack("<h", 6))  # it stays there
        findings = run(bus, 1)
    failed = {f.check: f.detail for f in findings if f.verdict is Verdict.FAIL}
    assert any(n.startswith("transition 11:") for n in failed)
    assert all("0x0237 (OPERATION ENABLED)" in d for n, d in failed.items() if "11:" in n)


def test_a_mode_that_the_drive_does_not_list_must_not_be_entered(machine):
    with network(machine) as (bus, stage):
        offered = stage.drives[0].dictionary.integer(key(0x6502))
        without_pp = struct.pack("<I", offered & ~1)
        stage.drives[0].dictionary.values[key(0x6502)] = struct.unpack("<I", without_pp)[0]
        findings = run(bus, 1, power=False)
    (found,) = [f for f in findings if f.verdict is Verdict.FAIL]
    assert found.check == "pp (1), not in 0x6502, is not entered"
    assert found.detail.endswith("accepted")


def test_a_drive_without_a_reaction_to_host_loss_cannot_be_brought_to_fault(machine):
    def alter(can_id, data):
        if can_id == 0x581 and data[1:4] == b"\x07\x60\x00":
            return struct.pack("<BHBI", 0x80, 0x6007, 0, 0x06020000)
        return data

    with network(machine, alter) as (bus, _):
        findings = run(bus, 1)
    by_name = {f.check: f for f in findings}
    found = by_name["fault and its reset"]
    assert (found.group, found.verdict, found.detail) == (
        "fault", Verdict.ABSENT, "0x6007 or 0x1016",
    )  # fmt: skip
    assert not [f for f in findings if f.group == "fault" and f is not found]


def test_a_fault_that_another_command_resets_is_found(machine):
    """A drive that takes the level of bit 7 for a reset, not its rising edge."""
    with network(machine) as (bus, stage):
        drive = stage.drives[0]

        def reset(found):
            if found.check.startswith("0x1003:01"):
                drive.dictionary.set_data(0x6040, 0, b"\x00\x00")
                drive.dictionary.set_data(0x6040, 0, b"\x80\x00")
                bus.pump(0.05)

        findings = run(bus, 1, on_finding=reset)
    assert {"the level of bit 7 resets nothing", "nor do other commands"} <= failures(findings)
