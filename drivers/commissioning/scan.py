"""Finds the nodes on a bus: listens, then reads the device type from every node id at once.

Needs no EDS and no machine file. Sends only SDO reads, so no drive moves or changes state; another
host that uses SDO at the same time may receive answers to our requests.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass, field

from canopen import SdoAbortedError, SdoCommunicationError

from drivers.canopen import NMT_STATES, Network, SdoChannel
from drivers.drive import decode

LISTEN = 0.25
"""Time to listen for heartbeats, before and after the requests [s]."""
_PACE = 0.0005
_READ_TIMEOUT = 0.2


@dataclass(slots=True)
class Found:
    """A node; None for what it does not report.

    Attributes:
        node: 1..127.
        heard: how it was found: "boot-up", "heartbeat", "SDO".
        nmt: NMT state from its heartbeat.
        device_type: 0x1000.  vendor, product, revision, serial: 0x1018.  name: 0x1008.
        statusword: 0x6041 of a CiA 402 drive.  error_register: 0x1001.
        error_code: 0x603F of a CiA 402 drive.
        doubled: two devices answer on this node id.
    """

    node: int
    heard: list[str] = field(default_factory=list)
    nmt: str | None = None
    device_type: int | None = None
    vendor: int | None = None
    product: int | None = None
    revision: int | None = None
    serial: int | None = None
    name: str | None = None
    statusword: int | None = None
    error_register: int | None = None
    error_code: int | None = None
    doubled: bool = False

    @property
    def profile(self) -> int | None:
        """Device profile number, low half of 0x1000."""
        return None if self.device_type is None else self.device_type & 0xFFFF

    @property
    def state(self) -> str | None:
        """CiA 402 power state, None for other devices."""
        return None if self.statusword is None else str(decode(self.statusword))

    def hear(self, how: str) -> None:
        """Notes a way in which the node was found."""
        if how not in self.heard:
            self.heard.append(how)


def scan(
    network: Network, ask: bool = True, listen: float = LISTEN, expected: Iterable[int] = ()
) -> list[Found]:
    """All nodes that are heard within `listen` [s] or answer an SDO, ordered by node id.

    Args:
        network: of the bus, which nothing else reads.
        ask: whether to send SDO requests; False only listens.
        listen: time to listen [s]; twice with requests, three times if an expected node is missing.
        expected: node ids that are asked once more if they do not answer.

    Raises:
        BusError: the bus fails.
    """
    nodes: dict[int, Found] = {}
    answers: dict[int, int] = {}
    again: list[int] = []

    def on_heartbeat(can_id: int, data: bytearray, timestamp: float) -> None:
        if len(data) == 1:
            state, node = data[0] & 0x7F, can_id & 0x7F
            found = nodes.setdefault(node, Found(node))
            found.hear("heartbeat" if state else "boot-up")
            found.nmt = NMT_STATES.get(state or 127, f"unknown ({state})")

    def on_answer(can_id: int, data: bytearray, timestamp: float) -> None:
        if len(data) == 8 and struct.unpack_from("<HB", data, 1) == (0x1000, 0):
            node = can_id & 0x7F
            nodes.setdefault(node, Found(node)).hear("SDO")
            answers[node] = answers.get(node, 0) + 1

    callbacks = [(0x700 + n, on_heartbeat) for n in range(1, 128)]
    if ask:
        callbacks += [(0x580 + n, on_answer) for n in range(1, 128)]
    for can_id, callback in callbacks:
        network.subscribe(can_id, callback)
    try:
        network.pump(listen)
        if ask:
            _ask(network, range(1, 128), listen)
            again = [node for node in expected if node not in answers]
            if again:
                _ask(network, again, listen)
    finally:
        for can_id, callback in callbacks:
            network.unsubscribe(can_id, callback)
    found = [nodes[n] for n in sorted(nodes)]
    for one in found:
        one.doubled = answers.get(one.node, 0) > (2 if one.node in again else 1)
        if one.node in answers:
            _identify(network, one)
    return found


def _ask(network: Network, nodes: Iterable[int], listen: float) -> None:
    """Requests the device type of nodes, and listens for the answers [s]."""
    for node in nodes:
        network.send_message(0x600 + node, struct.pack("<BHB4x", 0x40, 0x1000, 0))
        network.pump(_PACE)  # a CAN controller's queue holds few frames
    network.pump(listen)


def _identify(network: Network, found: Found) -> None:
    """Reads the identity and state of a node; what it lacks stays None."""
    channel = SdoChannel(network, found.node, _READ_TIMEOUT)

    def data(index: int, sub: int = 0) -> bytes | None:
        try:
            return channel.upload(index, sub)
        except (SdoAbortedError, SdoCommunicationError):
            return None

    def number(index: int, sub: int = 0) -> int | None:
        held = data(index, sub)
        return None if held is None else int.from_bytes(held, "little")

    try:
        found.device_type = number(0x1000)
        found.error_register = number(0x1001)
        found.vendor, found.product, found.revision, found.serial = (
            number(0x1018, sub) for sub in (1, 2, 3, 4)
        )
        name = data(0x1008)
        if name is not None:
            text = name.rstrip(b"\0").decode("latin-1")
            found.name = "".join(c if c.isprintable() else "?" for c in text)
        if found.profile == 402:
            found.statusword = number(0x6041)
            found.error_code = number(0x603F)
    finally:
        channel.detach()
