"""The virtual drives as a process of their own on a python-can bus, for the HIL suite.

    python serve.py INTERFACE CHANNEL SYNC_PERIOD START_X START_Y PRIORITY [FAMILY]

Prints "ready" when the drives are about to be switched on; ends with its stdin.
"""

import dataclasses
import sys
import threading

import can

from drivers.cyclic import RealTime
from drivers.settings import RealTimeSettings
from hil_sim.bus import serve
from hil_sim.stage import VirtualStage
from stagectl.config.machine.file import load_machine
from stagectl.config.profiles import with_profile
from stagectl.config.settings.package_settings import stage_settings


def _wait_for_end(stop):
    sys.stdin.read()
    stop.set()


def main():
    """Serve until stdin is closed."""
    interface, channel, period, x, y, priority, *family = sys.argv[1:]
    RealTime(RealTimeSettings(priority=int(priority))).begin()
    machine = load_machine()
    for name in family:
        machine = with_profile(machine, name)
    settings = dataclasses.replace(stage_settings(machine), sync_period=float(period))
    stage = VirtualStage(settings, seed=1, start=(float(x), float(y)))
    stage.plant.advance_to(1_000_000)  # compiles now, not at the first SYNC
    stop = threading.Event()
    threading.Thread(target=_wait_for_end, args=(stop,), daemon=True).start()
    with can.Bus(interface=interface, channel=channel) as bus:
        sys.stdout.write("ready\n")
        sys.stdout.flush()
        serve(stage, bus, stop)


if __name__ == "__main__":
    main()
