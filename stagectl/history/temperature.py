"""The stage's temperature, from an object of a drive or from a plug-in.

A plug-in is a callable without arguments in the entry point group `stagectl.temperature` that
returns a `Thermometer`. It is read before the first move and then at most once a minute, between
moves; a reading that fails counts as none and does not stop the run.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Final, Protocol

from stagectl.errors import ConfigError
from stagectl.plug_ins import load_plug_in

if TYPE_CHECKING:
    from drivers import Stage
    from stagectl.config.machine import Machine

ENTRY_POINTS: Final = "stagectl.temperature"
EVERY: Final = 60.0
"""Least time between two readings, on the stage's clock [s]."""


class Thermometer(Protocol):
    """Reads a temperature."""

    def read(self) -> float:
        """Temperature [deg C]; any exception means that there is none."""


class LatestTemperature:
    """The last reading of a thermometer, renewed at most once a minute.

    Args:
        read: its temperature [deg C], as `Thermometer.read`; None where there is none.
    """

    def __init__(self, read: Callable[[], float] | None) -> None:
        self._read = read
        self._value: float | None = None
        self._asked = -math.inf

    def at(self, time: float) -> float | None:
        """Temperature at `time` on the stage's clock [s], as last read [deg C]."""
        if self._read is not None and time - self._asked >= EVERY:
            self._asked = time
            try:
                value = float(self._read())
            except Exception:  # noqa: BLE001  a plug-in, or a drive without the object
                value = math.nan
            self._value = value if math.isfinite(value) else None
        return self._value


def plugin_thermometer(machine: Machine) -> Thermometer | None:
    """The thermometer of the plug-in that the machine file names; None where it names none.

    Raises:
        ConfigError: it cannot be used; names file and key.
    """
    if machine.temperature is None or machine.temperature.plugin is None:
        return None
    try:
        found: Thermometer = load_plug_in(ENTRY_POINTS, machine.temperature.plugin)
    except ConfigError as error:
        place = ("temperature", "plugin")
        raise ConfigError(machine.document.problem(place, str(error))) from error
    return found


def stage_temperature(
    machine: Machine, stage: Stage, plugin: Thermometer | None
) -> LatestTemperature:
    """The machine file's thermometer: its plug-in, or an object read over the open stage.

    Args:
        machine: that names the source.
        stage: open.
        plugin: of `plugin_thermometer`.
    """
    from drivers.objects import ObjectRef

    source = machine.temperature
    if source is None or source.plugin is not None:
        return LatestTemperature(None if plugin is None else plugin.read)
    index, _, sub = str(source.object).partition(":")
    entry = ObjectRef(int(index, 16), int(sub, 16), "temperature")
    node = next(axis.node for axis in stage.axes if axis.name == source.axis)
    return LatestTemperature(lambda: node.read(entry) * source.scale + source.offset)
