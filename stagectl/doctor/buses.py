"""Which CAN buses this machine has."""

from __future__ import annotations

import errno
import os
import socket
from importlib.util import find_spec
from pathlib import Path

from stagectl.doctor.examination import Finding

NETWORK = Path("/sys/class/net")
_CAN = "280"  # ARPHRD_CAN
_BCM = 2  # CAN_BCM; Python has the name only where its headers had it
_GROUP = "239.74.163.254"  # not the one of the examples, on which drives may be
_ADAPTERS = ("gs_usb", "ixxat", "kvaser", "pcan", "slcan", "systec", "vector")


def examine_socketcan() -> Finding:
    """SocketCAN in the kernel, and its interfaces."""
    refused = _refused(socket.SOCK_RAW, 1)
    if refused:
        return Finding(
            "socketcan", False, f"no CAN in this kernel ({refused})",
            "sudo modprobe can-raw, or a kernel with CONFIG_CAN; without CAN hardware: "
            "tools/with-vcan in the source, docs/how-to/vcan.md",
        )  # fmt: skip
    interfaces = [f"{name} ({state})" for name, state in can_interfaces().items()]
    return Finding(
        "socketcan", any(state != "down" for state in can_interfaces().values()),
        ", ".join(interfaces) or "no interface",
        "" if interfaces else "plug in an adapter; "
        "sudo ip link set can0 up type can bitrate 1000000 txqueuelen 1000",
    )  # fmt: skip


def examine_kernel_sync() -> Finding:
    """SocketCAN's broadcast manager, which sends SYNC on the kernel's own timer."""
    refused = _refused(socket.SOCK_DGRAM, _BCM)
    if refused:
        return Finding(
            "kernel-sync", False, f"no broadcast manager in this kernel ({refused}): the host "
            "sends SYNC", "sudo modprobe can-bcm",
        )  # fmt: skip
    return Finding("kernel-sync", True, "the kernel can send SYNC on SocketCAN (broadcast manager)")


def examine_vcan() -> Finding:
    """A virtual SocketCAN interface."""
    virtual = [name for name in can_interfaces() if (NETWORK / name).resolve().parent.parent.name
               == "virtual"]  # fmt: skip
    if virtual:
        return Finding("vcan", True, ", ".join(virtual))
    return Finding(
        "vcan", False, "no virtual CAN interface",
        "sudo modprobe vcan && sudo ip link add vcan0 type vcan && sudo ip link set vcan0 up; "
        "without root or CAN in the kernel: tools/with-vcan in the source, docs/how-to/vcan.md",
    )  # fmt: skip


def examine_multicast() -> Finding:
    """Whether a frame sent to a multicast group arrives: the bus of two processes."""
    if find_spec("msgpack") is None:
        return Finding("udp-multicast", False, "msgpack is missing", "pip install msgpack")
    import can

    try:
        with (
            can.Bus(interface="udp_multicast", channel=_GROUP) as here,
            can.Bus(interface="udp_multicast", channel=_GROUP) as there,
        ):
            here.send(can.Message(arbitration_id=0x7FF, is_extended_id=False))
            heard = there.recv(timeout=1.0)
    except (OSError, can.CanError) as why:
        return Finding(
            "udp-multicast", False, f"not on this machine: {why}",
            "a network interface with multicast: sudo ip link set lo multicast on && "
            "sudo ip route add 239.0.0.0/8 dev lo",
        )  # fmt: skip
    if heard is None:
        return Finding(
            "udp-multicast", False, "a frame that was sent did not arrive",
            "a firewall between processes of this machine; sudo ip route add 239.0.0.0/8 dev lo",
        )  # fmt: skip
    return Finding("udp-multicast", True, "frames arrive from another socket of this machine")


def examine_adapters() -> Finding:
    """Adapters by other drivers than SocketCAN's, as python-can finds them."""
    import can

    names = [name for name in _ADAPTERS if name in can.interfaces.BACKENDS]
    found = [
        f"{config['interface']}:{config.get('channel', '')}"
        for config in can.detect_available_configs(interfaces=names)
    ]
    return Finding(
        "adapters", bool(found), ", ".join(found) or "none found by python-can",
        "" if found else "only where SocketCAN has no driver for yours: the vendor's library "
        "(python-can's documentation, 'CAN Interface Modules')",
    )  # fmt: skip


def can_interfaces() -> dict[str, str]:
    """SocketCAN interfaces and their state: up, down, or unknown as a virtual one's is."""
    found = {}
    for path in sorted(NETWORK.glob("*")):
        try:
            if (path / "type").read_text().strip() == _CAN:
                found[path.name] = (path / "operstate").read_text().strip()
        except OSError:  # gone meanwhile
            continue
    return found


def _refused(kind: int, protocol: int) -> str:
    """Why the kernel does not open such a CAN socket; empty if it does."""
    family = getattr(socket, "AF_CAN", None)
    if family is None:
        return "not offered by this Python"
    try:
        socket.socket(family, kind, protocol).close()
    except OSError as why:
        return os.strerror(why.errno or errno.EPROTONOSUPPORT)
    return ""
