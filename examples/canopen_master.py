"""A master that is not ours moves axis x of the virtual stage: canopen's own CiA 402 profile.

    $ stagectl sim --bus udp_multicast:239.74.163.2            # in another terminal
    $ python examples/canopen_master.py udp_multicast 239.74.163.2

Nothing is mapped: at power-on the drives have the default mappings of CiA 402, which act on
reception. RPDO 1 is the controlword, RPDO 2 controlword and mode, RPDO 3 controlword and target.
"""

import argparse
import sys
import time

import canopen
from canopen.profiles.p402 import BaseNode402

from hil_sim import EDS_PATH

MM = 1_000_000
"""In the drive's unit of position, 1 nm; of velocity, 1 nm/s."""
M_S2 = 1_000_000
"""In the drive's unit of acceleration, 1 um/s^2."""
NEW_SETPOINT, RELATIVE = 1 << 4, 1 << 6
ENABLE_OPERATION = 0x0F
TARGET_REACHED, ACKNOWLEDGED = 1 << 10, 1 << 12


def set_point(drive: BaseNode402, controlword: int, target: int) -> None:
    """Send RPDO 3; it acts on reception."""
    rpdo = drive.rpdo[3]
    rpdo[0x6040].raw, rpdo[0x607A].raw = controlword, target
    rpdo.transmit()


def wait_for(drive: BaseNode402, bit: int, value: bool, timeout: float) -> None:
    """Wait until a bit of the statusword, which the drive sends when it changes, has a value."""
    deadline = time.monotonic() + timeout
    while bool(drive.statusword & bit) is not value:
        if time.monotonic() > deadline:
            raise TimeoutError(f"statusword 0x{drive.statusword:04X}, bit 0x{bit:04X} stays")
        time.sleep(0.002)


def move(interface: str, channel: str, distance: int, timeout: float = 30.0) -> int:
    """Enable node 1 and move it in profile position.

    Args:
        interface: of python-can.
        channel: the bus of that interface that the drives are on.
        distance: [nm].
        timeout: longest wait for each answer [s].

    Returns:
        How far the axis has moved by its own position sensor [nm].
    """
    network = canopen.Network()
    network.connect(interface=interface, channel=channel)
    try:
        drive = BaseNode402(1, str(EDS_PATH))
        network.add_node(drive)
        drive.nmt.state = "PRE-OPERATIONAL"
        drive.setup_402_state_machine()  # reads the mappings from the drive
        for rpdo in drive.rpdo.values():  # own frames that a bus returns are no TPDOs
            network.unsubscribe(rpdo.cob_id)
        drive.nmt.state = "OPERATIONAL"
        drive.tpdo[1].wait_for_reception(timeout)  # every 100 ms, and when it changes

        # Before enabling: RPDO 2 holds a controlword too, which canopen leaves at 0.
        drive.op_mode = "PROFILED POSITION"
        drive.sdo[0x6081].raw = 20 * MM
        drive.sdo[0x6083].raw = drive.sdo[0x6084].raw = M_S2
        drive.state = "OPERATION ENABLED"
        start = drive.sdo[0x6064].raw
        set_point(drive, ENABLE_OPERATION | NEW_SETPOINT | RELATIVE, distance)
        wait_for(drive, ACKNOWLEDGED, True, timeout)
        set_point(drive, ENABLE_OPERATION, distance)
        wait_for(drive, ACKNOWLEDGED, False, timeout)
        wait_for(drive, TARGET_REACHED, True, timeout)
        moved: int = drive.sdo[0x6064].raw - start
        drive.state = "SWITCH ON DISABLED"
        return moved
    finally:
        network.disconnect()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Move axis x by 2 mm, with canopen's BaseNode402.")
    parser.add_argument("interface", help="of python-can, such as udp_multicast")
    parser.add_argument("channel")
    options = parser.parse_args()
    way = move(options.interface, options.channel, 2 * MM)
    sys.stdout.write(f"moved by {way / MM:.3f} mm\n")
