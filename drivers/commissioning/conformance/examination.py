"""Runs the groups of checks on one node, each from the same initial state."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

from canopen import SdoAbortedError, SdoCommunicationError

from drivers.canopen import Network
from drivers.commissioning.conformance import communication, device, motion
from drivers.commissioning.conformance.probe import Finding, Probe
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
    groups = [*communication.GROUPS, *device.GROUPS]
    if power:
        groups += [*device.POWER_GROUPS, *motion.GROUPS]
    if power and homing:
        groups += motion.HOMING_GROUPS
    probe = Probe(network, node, on_finding)
    try:
        try:
            probe.read(0x1000)
        except SdoCommunicationError as silence:
            raise NodeError(f"node {node} does not answer SDO") from silence
        except SdoAbortedError:
            pass  # the first check reports it
        for name, check in groups:
            probe.group = name
            try:
                check(probe)
            except SdoAbortedError as refused:  # ends the group only
                probe.expect("every access of this group", False, f"SDO abort: {refused}")
            except SdoCommunicationError:
                probe.expect("every access of this group", False, "no SDO answer")
            finally:
                _restore(probe)
    finally:
        probe.close()
    return probe.findings


def _restore(probe: Probe) -> None:
    """Disables the drive and restores its values; what it does not accept is a finding."""
    try:
        probe.nmt(128)
        with suppress(SdoAbortedError):
            probe.off()
        refused = probe.restore()
    except SdoCommunicationError:
        refused = ["no SDO answer"] if probe.changed else []
    for text in refused:
        probe.expect("changed values are restored", False, text)
