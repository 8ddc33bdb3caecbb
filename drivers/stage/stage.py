"""The stage as the application sees it: its axes are booted, homed, enabled and stopped together.

Streams are csp (0x607A and 0x60B2 with every SYNC), on request csv or cst; pp serves jogging.
"""

from __future__ import annotations

from drivers.stage.profiles import StageProfiles
from drivers.stage.streams import StageStreams


class Stage(StageStreams, StageProfiles):
    """All axes on one bus; a context manager that disables the axes and closes the bus at its end.

    A fault of one axis stops all of them.

    Attributes:
        axes: one `Axis` per settings, in the order of all array columns.
        clock: of the bus: virtual on the lock-step bus, else monotonic.
        sink: called with the `Sample` of every SYNC of a csp stream, before it is evaluated.
        interrupt: called at least every 25 ms while a method uses the bus; what it raises ends
            the method, and stops axes that are enabled.
    """
