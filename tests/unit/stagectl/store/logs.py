"""Bus logs as runs write them."""

from datetime import UTC, datetime

from stagectl.store import BusLog

STARTED = datetime(2026, 11, 2, 8, 5, 6, 7000, tzinfo=UTC)
ONE = (0, 0x201, b"\x01")


def logged(folder, *frames):
    """The closed log `bus.asc` of these frames: time [ns], id, data."""
    with BusLog(folder / "bus.asc", STARTED) as log:
        for frame in frames:
            log.tap(*frame)
    return log
