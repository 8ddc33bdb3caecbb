"""All groups of checks on one node, in their order."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress

from canopen import SdoAbortedError, SdoCommunicationError

from drivers.bench.conformance import communication, device, motion
from drivers.bench.conformance.probe import Check, Finding, Probe
from drivers.canopen import Network
from drivers.errors import NodeError


def run(
    network: Network,
    node: int,
    power: bool = True,
    homing: bool = False,
    told: Callable[[Finding], object] = lambda _: None,
) -> list[Finding]:
    """Checks a node.

    Args:
        network: whose bus nobody else reads.
        node: 1..126.
        power: also what needs the axis under force.
        homing: also home, at the present position (method 37 or 35): the zero changes.
        told: called with each finding as it is made.

    Raises:
        NodeError: the node does not answer at all.
        BusError: the bus fails.
    """
    groups: list[tuple[str, Check]] = [*communication.GROUPS, *device.GROUPS]
    if power:
        groups += [*device.POWER_GROUPS, *motion.GROUPS]
    if power and homing:
        groups += motion.HOMING_GROUPS
    findings: list[Finding] = []
    probe = Probe(network, node)
    try:
        try:
            probe.read(0x1000)
        except SdoCommunicationError as silence:
            raise NodeError(f"node {node} does not answer SDO") from silence
        except SdoAbortedError:
            pass  # the first check says so
        for name, check in groups:
            probe.group = name
            refused: list[Finding] = []
            try:
                for finding in _guarded(probe, check):
                    findings.append(finding)
                    told(finding)
            finally:  # here, not in the generator: it must be done before the probe is closed
                refused = _restored(probe)
            for finding in refused:
                findings.append(finding)
                told(finding)
    finally:
        probe.close()
    return findings


def _guarded(probe: Probe, check: Check) -> Iterator[Finding]:
    """A group's findings; an access that fails unasked ends the group, not the probe."""
    try:
        yield from check(probe)
    except SdoAbortedError as refused:
        yield probe.expect("every access of this group", False, f"SDO abort: {refused}")
    except SdoCommunicationError:
        yield probe.expect("every access of this group", False, "no SDO answer")


def _restored(probe: Probe) -> list[Finding]:
    """Off, PRE-OPERATIONAL, with the values of before; what the drive did not take back."""
    try:
        probe.nmt(128)
        with suppress(SdoAbortedError):
            probe.off()
        refused = probe.restore()
    except SdoCommunicationError:
        refused = ["no SDO answer"] if probe.changed else []
    return [probe.expect("what was changed is put back", False, text) for text in refused]
