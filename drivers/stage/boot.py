"""Boot: the bus is listened to, then all nodes are reset, identified, configured and started."""

from __future__ import annotations

from contextlib import suppress

from drivers.canopen import LISTENING, MonotonicClock
from drivers.cyclic import Cycle
from drivers.errors import BusError, ConfigurationError, NodeError
from drivers.settings import BusSettings

_ATTEMPTS = 3
"""At booting the nodes, where two devices seem to share a node id."""


class Boot:
    """Boots the nodes of a stage, once or again.

    Args:
        cycle: of the axes.
        settings: of the bus.
    """

    def __init__(self, cycle: Cycle, settings: BusSettings) -> None:
        self._network, self._cycle, self._settings = cycle.network, cycle, settings
        self._axes = cycle.axes
        self._listened = False

    def listen(self) -> None:
        """Listens for another host before our first frame, once, on buses in real time.

        Raises:
            BusError: there is one, or the bus fails.
        """
        if self._listened or not isinstance(self._network.clock, MonotonicClock):
            return
        self._listened = True
        try:
            self._network.listen(LISTENING)
        except BusError:
            for axis in self._axes:
                axis.node.booted = 0  # not on our request: nothing to release at the end
            raise

    def run(self) -> None:
        """Makes all nodes OPERATIONAL; errors as `Stage.boot`."""
        self._cycle.sync.stop()
        for channel in self._cycle.channels:
            channel.reset()
        try:
            self._configure_and_start()
        except (NodeError, ConfigurationError) as error:
            self._network.check_alone()  # another host, or a second device, explains it better
            doubled = self._doubled_node(error.axis)
            if doubled is not None:
                raise doubled from error
            raise
        self._network.check_alone()
        self._cycle.clear_alarms()

    def _configure_and_start(self) -> None:
        """Nothing is written to a node id that two devices seem to have."""
        for _ in range(_ATTEMPTS):
            for axis in self._axes:
                axis.node.boot()
            doubles = [error for axis in self._axes if (error := axis.node.seen_double())]
            if not doubles:
                self._configure()
                doubles = [error for axis in self._axes if (error := axis.node.find_double())]
            if not doubles:
                break
        else:
            raise doubles[0]
        for axis in self._axes:
            axis.node.start()

    def _doubled_node(self, name: str | None) -> NodeError | None:
        """Evidence that two devices have the node id of this axis, None without."""
        with suppress(NodeError):
            for axis in self._axes:
                if axis.name == name:
                    return axis.node.find_double()
        return None

    def _configure(self) -> None:
        for axis in self._axes:
            axis.configure(self._settings)
        for channel in self._cycle.channels:
            channel.use_mappings()
        self._cycle.sync.use_ids()
        self._network.service(self._network.clock.now_ns())
