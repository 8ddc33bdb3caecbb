"""Runs the groups of checks on one node, each from the same initial state."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress

from canopen import SdoAbortedError, SdoCommunicationError

from drivers.canopen import Network
from drivers.commissioning.conformance import communication, device, motion
from drivers.commissioning.conformance.probe import Check, Finding, Probe
from drivers.errors import NodeError


def run(
    network: Network,
    node: int,
    power: bool = True,
    homing: bool = False,
    on_finding: Callable[[Finding], object] = lambda _: None,
) -> list[Finding]:
    """Checks a node.

    Args:
        network: of the bus, which nothing else reads.
        node: 1..126.
        power: include checks that enable the axis.
        homing: include homing at the present position (method 37 or 35), which changes the zero.
        on_finding: called with each finding as it is made.

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
            pass  # the first check reports it
        for name, check in groups:
            probe.group = name
            refused: list[Finding] = []
            try:
                for finding in _guarded(probe, check):
                    findings.append(finding)
                    on_finding(finding)
            finally:  # here, not in the generator: it must be done before the probe is closed
                refused = _restore(probe)
            for finding in refused:
                findings.append(finding)
                on_finding(finding)
    finally:
        probe.close()
    return findings


def _guarded(probe: Probe, check: Check) -> Iterator[Finding]:
    """The findings of a group; an unexpected failure of an access ends the group only."""
    try:
        yield from check(probe)
    except SdoAbortedError as refused:
        yield probe.expect("every access of this group", False, f"SDO abort: {refused}")
    except SdoCommunicationError:
        yield probe.expect("every access of this group", False, "no SDO answer")


def _restore(probe: Probe) -> list[Finding]:
    """Disables the drive and restores its values; returns what the drive did not accept."""
    try:
        probe.nmt(128)
        with suppress(SdoAbortedError):
            probe.off()
        refused = probe.restore()
    except SdoCommunicationError:
        refused = ["no SDO answer"] if probe.changed else []
    return [probe.expect("changed values are restored", False, text) for text in refused]
