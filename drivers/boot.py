"""Boot: the bus is listened to, then all nodes are reset, identified, configured and started."""

from __future__ import annotations

from collections.abc import Sequence

from drivers.canopen import LISTENING, MonotonicClock, Network
from drivers.cyclic import Cycle
from drivers.drive import Axis
from drivers.errors import BusError, ConfigurationError, NodeError
from drivers.settings import BusSettings

_ATTEMPTS = 3
"""At configuring the nodes, where two devices seem to share a node id."""


class Boot:
    """Boots the nodes of a stage, once or again.

    Args:
        network: of the bus.
        cycle: of the axes.
        axes: of the stage.
        settings: of the bus.
    """

    def __init__(
        self, network: Network, cycle: Cycle, axes: Sequence[Axis], settings: BusSettings
    ) -> None:
        self._network, self._cycle = network, cycle
        self._axes, self._settings = axes, settings
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
        self._cycle.reset()
        try:
            self._configure_and_start()
        except (NodeError, ConfigurationError):
            self._network.check_alone()  # another host explains it better
            raise
        self._network.check_alone()
        self._cycle.clear_alarms()

    def _configure_and_start(self) -> None:
        for _ in range(_ATTEMPTS):
            self._configure()
            doubles = [error for axis in self._axes if (error := axis.node.find_double())]
            if not doubles:
                break
        else:
            raise doubles[0]
        for axis in self._axes:
            axis.node.start()

    def _configure(self) -> None:
        for axis in self._axes:
            axis.node.boot()
        for axis in self._axes:
            axis.configure(self._settings)
        for channel in self._cycle.channels:
            channel.use_mappings()
        self._network.service(self._network.clock.now_ns())
