"""Runs the groups of checks on one node, each from the same initial state."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from canopen import SdoAbortedError, SdoCommunicationError

from drivers.canopen import Network
from drivers.commissioning.conformance import communication, device, motion
from drivers.commissioning.conformance.probe import Finding, Probe
from drivers.errors import NodeError

_GROUPS: list[tuple[str, Callable[[Probe], object]]] = [
    ("identity", communication.identity),
    ("abort codes", communication.abort_codes),
    ("NMT", communication.network_management),
    ("PDO", communication.mapping),
    ("states", device.states),
    ("modes", device.modes),
]
_POWER_GROUPS: list[tuple[str, Callable[[Probe], object]]] = [
    ("states, enabled", device.powered_states),
    ("fault", device.fault),
    ("settings", motion.settings),
    ("profile position", motion.profile_position),
    ("profile velocity", motion.profile_velocity),
    ("csp", partial(motion.follow, mode=motion.CSP)),
    ("csv", partial(motion.follow, mode=motion.CSV)),
    ("homing", motion.homing_bits),
]


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
    groups = _GROUPS + (_POWER_GROUPS if power else [])
    if power and homing:
        groups.append(("homing run", motion.homing_run))
    probe = Probe(network, node, on_finding)
    try:
        try:
            probe.offers(0x1000)
        except SdoCommunicationError as silence:
            raise NodeError(f"node {node} does not answer SDO") from silence
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
        probe.abort_code(probe.off)
        refused = probe.restore()
    except SdoCommunicationError:
        refused = ["no SDO answer"] if probe.changed else []
    for text in refused:
        probe.expect("changed values are restored", False, text)
