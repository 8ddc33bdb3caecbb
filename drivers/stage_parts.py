"""What a stage is made of, shared by what asks it, moves it and stops it."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.axis import Axis
from drivers.bus import Network
from drivers.cycle import Cycle
from drivers.power import Power
from drivers.realtime import RealTime
from drivers.settings import AxisSettings, BusSettings


@dataclass(frozen=True, slots=True)
class StageParts:
    """One of each.

    Attributes:
        network: the bus.  axes: in the order of their settings.
        cycle: their process data.  power: their power states.
        real_time: what the operating system is asked for.  period: Ts [s].
    """

    network: Network
    axes: tuple[Axis, ...]
    cycle: Cycle
    power: Power
    real_time: RealTime
    period: float

    @classmethod
    def on(cls, network: Network, bus: BusSettings, axes: tuple[AxisSettings, ...]) -> StageParts:
        """Made for these settings; nothing is sent.

        Raises:
            ConfigurationError: no usable EDS.
        """
        made = tuple(Axis(network, axis) for axis in axes)
        cycle = Cycle(network, made, bus)
        power = Power(cycle, bus.sync_period)
        return cls(network, made, cycle, power, RealTime(bus.realtime), bus.sync_period)
