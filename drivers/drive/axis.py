"""One axis: the configuration of its drive, and the scaling between SI and integers.

All of it is SDO access before and between motions; process data are `drivers.cyclic`'s. What is
written is read back. Controller gains and other tuning of the drive are left alone.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from drivers import objects as od
from drivers.canopen import MappedObject, Network, Node, PdoMapping, PdoRecord
from drivers.drive import dcf, parameters
from drivers.drive.cia402 import Mode
from drivers.drive.host_loss import watch_host
from drivers.drive.scaling import counts, scale
from drivers.drive.units import check_units
from drivers.errors import AxisFault, ConfigurationError, NodeError
from drivers.objects import ObjectRef
from drivers.settings import AxisSettings, BusSettings

TARGETS = {
    Mode.CYCLIC_SYNC_VELOCITY: od.TARGET_VELOCITY,
    Mode.CYCLIC_SYNC_TORQUE: od.TARGET_FORCE,
}
"""Cyclic target of these modes; of all others it is the target position."""
TPDO_OBJECTS = (od.STATUSWORD, od.POSITION_ACTUAL, od.FORCE_ACTUAL)

MODE_TIMEOUT = 5.0
"""Some drives display the previous mode for seconds [s]."""
PDO_COUNT = 4

_WITHOUT = {
    od.FORCE_OFFSET: "force offsets are not sent",
    od.FORCE_ACTUAL: "force reads 0, friction cannot be learned",
}
"""Objects that are mapped where offered, and the consequence where they are not."""

_NAMES = {
    mode: mode.name.lower().replace("_sync_", " synchronous ").replace("_", " ") for mode in Mode
}

_NEEDED = {
    Mode.HOMING: (od.HOMING_METHOD,),
    Mode.PROFILE_POSITION: (
        od.PROFILE_VELOCITY, od.PROFILE_ACCELERATION, od.PROFILE_DECELERATION
    ),
}  # fmt: skip
"""Objects without which the host cannot say what a mode is to do."""


class Axis:
    """An axis and its node.

    Attributes:
        name: as in the settings.  node: its CANopen node.
        settings: its settings; once configured, limited to what the drive holds.
        scale: length and force of one unit on the bus.
        homed: whether position 0 is the stage's zero; False after a reboot of the drive.
        rpdo, tpdo: the cyclic mappings, with data types from the EDS; without force offset or
            force where the drive lacks them.
        mode: mode of operation set last, None before the first.
        target: object of the cyclic target: position, velocity or force.
        limitations: what the drive lacks or holds other than requested, and the consequence, one
            clause each.
    """

    def __init__(self, network: Network, settings: AxisSettings) -> None:
        self.settings = self._requested = settings
        self.name = settings.name
        self.node = Node(network, settings)
        self.scale = scale(settings)
        self.mode: Mode | None = None
        self.limitations: list[str] = []
        self.target = od.TARGET_POSITION
        self._map_objects({ref for ref in _WITHOUT if not self.node.offers(ref)})
        self.rpdo_id = 0x200 + settings.node
        self.tpdo_id = 0x180 + settings.node
        self._network = network
        self._homed_at_boot: int | None = None

    def _map_objects(self, absent: Collection[ObjectRef]) -> None:
        """Makes the cyclic mappings without objects that are absent."""
        rpdo = (od.CONTROLWORD, self.target, od.FORCE_OFFSET)
        self.rpdo = self._mapping([ref for ref in rpdo if ref not in absent])
        self.tpdo = self._mapping([ref for ref in TPDO_OBJECTS if ref not in absent])

    def _mapping(self, refs: Sequence[ObjectRef]) -> PdoMapping:
        try:
            return PdoMapping(tuple(MappedObject(r, self.node.data_type(r)) for r in refs))
        except ConfigurationError as refused:
            if refused.axis is not None:  # names itself already
                raise
            raise ConfigurationError(
                f"EDS file {self.settings.eds}: {refused}", axis=self.name
            ) from refused

    @property
    def accepts_force_offset(self) -> bool:
        """Whether the drive has 0x60B2, which friction compensation needs."""
        return any(e.object == od.FORCE_OFFSET for e in self.rpdo.entries)

    @property
    def reports_force(self) -> bool:
        """Whether the drive has 0x6077."""
        return any(e.object == od.FORCE_ACTUAL for e in self.tpdo.entries)

    def add_limitation(self, clause: str) -> None:
        """Adds a clause to `limitations`, once."""
        if clause not in self.limitations:
            self.limitations.append(clause)

    def _find_limitations(self) -> None:
        """Finds which cyclic objects the node has, whatever its EDS says."""
        self.limitations.clear()
        absent = [ref for ref in _WITHOUT if not self.node.has(ref)]
        for ref in absent:
            self.add_limitation(f"{ref} is not offered: {_WITHOUT[ref]}")
        self.target = od.TARGET_POSITION
        self._map_objects(absent)

    @property
    def homed(self) -> bool:
        """Whether the axis was homed since its drive's last boot-up."""
        return self._homed_at_boot == self.node.booted

    @homed.setter
    def homed(self, value: bool) -> None:
        self._homed_at_boot = self.node.booted if value else None

    def configure(self, bus: BusSettings) -> None:
        """Writes DCF values, checks units, writes limits, windows, options, PDOs and heartbeats.

        Raises:
            ConfigurationError: units differ from the settings, the drive holds an unacceptable
                value, or it keeps running without its host and the settings do not accept that.
            NodeError: the drive refuses or does not answer.
        """
        node, axis = self.node, self._requested
        self._find_limitations()
        for clause in dcf.apply(node, dcf.parameter_values(node.dictionary)):
            self.add_limitation(clause)
        for clause in check_units(node, axis):
            self.add_limitation(clause)
        self.check_mode(Mode.CYCLIC_SYNC_POSITION)
        self._set_sync_id()
        self._set_sync_counter(bus.sync_counter)
        node.write_optional(od.CYCLE_PERIOD, counts(axis, od.CYCLE_PERIOD, bus.sync_period))
        window = counts(axis, od.SYNC_WINDOW, bus.sync_window)
        if not node.write_optional(od.SYNC_WINDOW, window) and window:
            self.add_limitation(
                f"{od.SYNC_WINDOW} is not offered: the drive accepts late setpoints"
            )
        value, index = interpolation_period(bus.period_us)
        node.write_optional(od.INTERPOLATION_VALUE, value)
        node.write_optional(od.INTERPOLATION_INDEX, index)
        self.settings, clauses = parameters.write_settings(node, axis)
        for clause in clauses:
            self.add_limitation(clause)
        PdoRecord.receive(1).configure(node, self.rpdo_id, self.rpdo)
        PdoRecord.transmit(1).configure(node, self.tpdo_id, self.tpdo)
        for number in range(2, PDO_COUNT + 1):
            PdoRecord.receive(number).disable(node)
            PdoRecord.transmit(number).disable(node)
        node.set_heartbeat()
        self._watch_host()

    def _watch_host(self) -> None:
        problem = watch_host(self.node, self.settings.options.abort_connection, self.add_limitation)
        if problem is None:
            return
        obj, why = problem
        if not self.settings.unwatched_host:
            raise ConfigurationError(
                f"{why}; powered only with unwatched_host: accept in its drive section",
                axis=self.name, obj=obj,
            )  # fmt: skip
        self.add_limitation(f"{obj} {why}")

    def _set_sync_id(self) -> None:
        """Sets 0x1005: the drive consumes our SYNC and produces none."""
        node = self.node
        if node.offers(od.SYNC_COB_ID) and node.read(od.SYNC_COB_ID) & 0x4000_07FF != od.SYNC_ID:
            node.write_optional(od.CYCLE_PERIOD, 0)
            node.write_checked(od.SYNC_COB_ID, od.SYNC_ID)

    def _set_sync_counter(self, overflow: int) -> None:
        """Sets 0x1019, which may change only while 0x1006 is 0."""
        node = self.node
        if node.has(od.SYNC_OVERFLOW):
            if node.read(od.SYNC_OVERFLOW) != overflow:
                node.write_optional(od.CYCLE_PERIOD, 0)
                node.write_checked(od.SYNC_OVERFLOW, overflow)
        elif overflow:
            raise ConfigurationError(
                "is not offered: the drive would refuse a SYNC with a counter",
                axis=self.name, obj=od.SYNC_OVERFLOW,
            )  # fmt: skip

    def map_target(self, mode: Mode) -> bool:
        """Maps the cyclic target of a mode; velocities and forces start at 0.

        Returns:
            Whether the mapping has changed.

        Raises:
            NodeError, ConfigurationError: the drive does not accept it.
        """
        target = TARGETS.get(mode, od.TARGET_POSITION)
        if target == self.target:
            return False
        if target != od.TARGET_POSITION:
            self.node.write(target, 0)
        self.target = target
        mapped = {entry.object for entry in (*self.rpdo.entries, *self.tpdo.entries)}
        self._map_objects(set(_WITHOUT) - mapped)
        PdoRecord.receive(1).configure(self.node, self.rpdo_id, self.rpdo)
        return True

    def check_mode(self, mode: Mode) -> None:
        """Checks that the drive offers a mode of operation.

        Raises:
            ConfigurationError: it does not, by 0x6502 or the EDS.
        """
        target = TARGETS.get(mode, od.TARGET_POSITION)
        if not self.node.offers(target):
            raise ConfigurationError(
                f"is not in the EDS: no {_NAMES[mode]}", axis=self.name, obj=target
            )
        self.check_objects(mode)
        if not self.node.offers(od.SUPPORTED_MODES):
            return
        modes = self.node.read(od.SUPPORTED_MODES)
        if not modes >> (mode - 1) & 1:
            raise ConfigurationError(
                f"0x{modes:08X}: the drive does not offer {_NAMES[mode]} mode",
                axis=self.name, obj=od.SUPPORTED_MODES,
            )  # fmt: skip

    def check_objects(self, mode: Mode) -> None:
        """Checks that the drive has the objects that the host writes for a mode.

        Raises:
            ConfigurationError: one is missing.
            NodeError: no answer.
        """
        for ref in _NEEDED.get(mode, ()):
            if not self.node.has(ref):
                raise ConfigurationError(
                    f"is not offered: {_NAMES[mode]} mode needs it", axis=self.name, obj=ref
                )

    def set_mode(self, mode: Mode) -> None:
        """Writes the mode of operation and waits until the drive displays it (0x6061).

        Raises:
            AxisFault: another mode is displayed after `MODE_TIMEOUT`.
        """
        self.node.write(od.MODE, mode)
        self.mode = mode
        deadline = self._network.clock.now_ns() + round(MODE_TIMEOUT * 1e9)
        while (shown := self.node.read(od.MODE_DISPLAY)) != mode:
            if self._network.clock.now_ns() >= deadline:
                raise AxisFault(
                    f"shows mode {shown} {MODE_TIMEOUT:g} s after mode {int(mode)} was requested",
                    axis=self.name, obj=od.MODE_DISPLAY,
                )  # fmt: skip
            self._network.pump(0.005)

    def set_profile(self, velocity: float, acceleration: float) -> float:
        """Sets velocity [m/s] and acceleration [m/s^2] of the drive's own profiles (pp).

        Returns:
            Largest factor by which moves take longer where the drive holds lower values; else 1.

        Raises:
            ConfigurationError, NodeError: the drive holds neither these nor lower values.
        """
        slower, held = parameters.write_profile(self.node, self.settings, velocity, acceleration)
        for ref, clause in held.items():  # of this move, not of the previous one
            self.limitations = [c for c in self.limitations if not c.startswith(f"{ref} ")]
            if clause is not None:
                self.add_limitation(clause)
        return slower

    def error_code(self) -> int | None:
        """0x603F, None where it cannot be read."""
        try:
            return self.node.read(od.ERROR_CODE)
        except (NodeError, ConfigurationError):
            return None


def interpolation_period(period_us: int) -> tuple[int, int]:
    """Value and index of a period for 0x60C2:01 and :02: value * 10^index seconds.

    Raises:
        ConfigurationError: the period is no UNSIGNED8 times a power of ten.
    """
    value, index = period_us, -6
    while value % 10 == 0:
        value, index = value // 10, index + 1
    if value > 255:
        raise ConfigurationError(
            f"{period_us} us is no UNSIGNED8 times a power of ten", obj=od.INTERPOLATION_VALUE
        )
    # 1 ms as 1 * 10^-3, 2.5 ms as 25 * 10^-4
    return value, index
