"""One axis: what its drive is set up with, and the scaling between SI and its integers.

Everything here is SDO work before and between motions; cyclic data are `cycle.py`'s. What is
written is read back. Gains and the drive's own tuning are not touched.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from drivers import objects as od
from drivers.canopen import MappedObject, Network, Node, PdoMapping, PdoRecord
from drivers.drive import dcf, parameters
from drivers.drive.cia402 import Mode
from drivers.drive.host_watch import unwatched
from drivers.drive.units import Scale, check_units
from drivers.errors import AxisFault, ConfigurationError, NodeError
from drivers.objects import ObjectRef
from drivers.settings import AxisSettings, BusSettings

TARGETS = {
    Mode.CYCLIC_SYNC_VELOCITY: od.TARGET_VELOCITY,
    Mode.CYCLIC_SYNC_TORQUE: od.TARGET_FORCE,
}
"""What the cyclic target is in these modes; in all others the target position."""
TPDO_OBJECTS = (od.STATUSWORD, od.POSITION_ACTUAL, od.FORCE_ACTUAL)

MODE_TIMEOUT = 5.0
"""Some drives show the mode before for seconds [s]."""
PDO_COUNT = 4

_WITHOUT = {
    od.FORCE_OFFSET: "force offsets are not sent",
    od.FORCE_ACTUAL: "force reads 0, friction cannot be learned",
}
"""Objects that are mapped where offered, and what is missing without them."""

_NAMES = {
    mode: mode.name.lower().replace("_sync_", " synchronous ").replace("_", " ") for mode in Mode
}


class Axis:
    """An axis and its node.

    Attributes:
        name: as in the settings.  node: its CANopen node.
        settings: its settings; once configured, within what the drive has.
        scale: length and force of one unit on the bus.
        homed: whether position 0 is the stage's zero; the drive's reboot makes it False.
        rpdo, tpdo: the cyclic mappings, made from the EDS's data types; without force offset or
            force where the drive has none.
        mode: of operation set last, None before the first.
        target: what the cyclic target is: position, velocity or force.
        limitations: what the drive does not offer or has otherwise than asked for, and what
            follows from that, one clause each.
    """

    def __init__(self, network: Network, settings: AxisSettings) -> None:
        self.settings = self._asked = settings
        self.name = settings.name
        self.node = Node(network, settings)
        self.scale = Scale(settings.increment, settings.rated_force / 1000)
        self.mode: Mode | None = None
        self.limitations: list[str] = []
        self.target = od.TARGET_POSITION
        self.rpdo = self._mapping([r for r in self._outward if self._usable(r, self.node.offers)])
        self.tpdo = self._mapping([r for r in TPDO_OBJECTS if self._usable(r, self.node.offers)])
        self.rpdo_id = 0x200 + settings.node
        self.tpdo_id = 0x180 + settings.node
        self._network = network
        self._homed_at_boot: int | None = None

    @property
    def _outward(self) -> tuple[ObjectRef, ...]:
        """Objects of the RPDO: controlword, target, force offset."""
        return od.CONTROLWORD, self.target, od.FORCE_OFFSET

    def _mapping(self, refs: Sequence[ObjectRef]) -> PdoMapping:
        try:
            return PdoMapping(tuple(MappedObject(r, self.node.data_type(r)) for r in refs))
        except ConfigurationError as refused:
            if refused.axis is not None:  # names itself already
                raise
            raise ConfigurationError(
                f"EDS file {self.settings.eds}: {refused}", axis=self.name
            ) from refused

    @staticmethod
    def _usable(ref: ObjectRef, has: Callable[[ObjectRef], bool]) -> bool:
        """Whether to map an object: what is optional only where it is there."""
        return ref not in _WITHOUT or has(ref)

    @property
    def accepts_force_offset(self) -> bool:
        """Whether the drive has 0x60B2, and so compensation."""
        return any(e.object == od.FORCE_OFFSET for e in self.rpdo.entries)

    @property
    def reports_force(self) -> bool:
        """Whether the drive has 0x6077."""
        return any(e.object == od.FORCE_ACTUAL for e in self.tpdo.entries)

    def add_limitation(self, clause: str) -> None:
        """Notes something that this drive does without."""
        if clause not in self.limitations:
            self.limitations.append(clause)

    def _find_limitations(self) -> None:
        """What of the cyclic objects the node has, whatever its EDS says."""
        self.limitations.clear()
        has = {ref: self.node.has(ref) for ref in _WITHOUT}
        for ref, consequence in _WITHOUT.items():
            if not has[ref]:
                self.add_limitation(f"{ref} is not offered: {consequence}")
        self.target = od.TARGET_POSITION
        self.rpdo = self._mapping([r for r in self._outward if has.get(r, True)])
        self.tpdo = self._mapping([r for r in TPDO_OBJECTS if has.get(r, True)])

    @property
    def homed(self) -> bool:
        """Whether homing was done since the drive's last boot-up."""
        return self._homed_at_boot == self.node.booted

    @homed.setter
    def homed(self, value: bool) -> None:
        self._homed_at_boot = self.node.booted if value else None

    def counts(self, position: float) -> int:
        """Position [m] in units of the bus."""
        return round(position / self.scale.increment)

    def speed_counts(self, velocity: float) -> int:
        """Velocity [m/s] in units of the bus."""
        return round(velocity / self.settings.velocity_unit_si)

    def configure(self, bus: BusSettings) -> None:
        """Writes the DCF, checks the units, writes limits, windows, options, PDOs and heartbeats.

        Raises:
            ConfigurationError: other units than ours, a value that is none to go by, or a
                drive that goes on without its host where the settings do not accept that.
            NodeError: the drive refuses or does not answer.
        """
        node = self.node
        self._find_limitations()
        for clause in dcf.apply(node, dcf.configured(node.dictionary)):
            self.add_limitation(clause)
        for clause in check_units(node, self._asked):
            self.add_limitation(clause)
        self.check_mode(Mode.CYCLIC_SYNC_POSITION)
        self._listen_to_sync()
        self._set_sync_counter(bus.sync_counter)
        node.write_optional(od.CYCLE_PERIOD, bus.period_us)
        if not node.write_optional(od.SYNC_WINDOW, bus.window_us) and bus.window_us:
            self.add_limitation(
                f"{od.SYNC_WINDOW} is not offered: the drive takes late set-points, too"
            )
        value, index = interpolation_period(bus.period_us)
        node.write_optional(od.INTERPOLATION_VALUE, value)
        node.write_optional(od.INTERPOLATION_INDEX, index)
        self.settings, clauses = parameters.give(node, self._asked)
        for clause in clauses:
            self.add_limitation(clause)
        PdoRecord.receive(1).configure(node, self.rpdo_id, self.rpdo)
        PdoRecord.transmit(1).configure(node, self.tpdo_id, self.tpdo)
        for number in range(2, PDO_COUNT + 1):
            PdoRecord.receive(number).disable(node)
            PdoRecord.transmit(number).disable(node)
        node.set_heartbeat()
        self._have_host_watched()

    def _have_host_watched(self) -> None:
        gap = unwatched(self.node, self.settings.options.abort_connection, self.add_limitation)
        if gap is None:
            return
        obj, why = gap
        if not self.settings.unwatched_host:
            raise ConfigurationError(
                f"{why}; powered only with unwatched_host: accept in its drive section",
                axis=self.name, obj=obj,
            )  # fmt: skip
        self.add_limitation(f"{obj} {why}")

    def _listen_to_sync(self) -> None:
        """0x1005: our SYNC, and none of the drive's own."""
        node = self.node
        if node.offers(od.SYNC_COB_ID) and node.read(od.SYNC_COB_ID) & 0x4000_07FF != od.SYNC_ID:
            node.write_optional(od.CYCLE_PERIOD, 0)
            node.write_checked(od.SYNC_COB_ID, od.SYNC_ID)

    def _set_sync_counter(self, overflow: int) -> None:
        """0x1019, which may change only while 0x1006 is 0."""
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
        """Maps the cyclic target that the mode takes, 0 to begin with where it is no position.

        Returns:
            Whether the mapping has changed.

        Raises:
            NodeError, ConfigurationError: the drive does not take it.
        """
        target = TARGETS.get(mode, od.TARGET_POSITION)
        if target == self.target:
            return False
        if target != od.TARGET_POSITION:
            self.node.write(target, 0)
        with_offset = self.accepts_force_offset
        self.target = target
        self.rpdo = self._mapping([r for r in self._outward if r != od.FORCE_OFFSET or with_offset])
        PdoRecord.receive(1).configure(self.node, self.rpdo_id, self.rpdo)
        return True

    def check_mode(self, mode: Mode) -> None:
        """Whether the drive has the mode at all.

        Raises:
            ConfigurationError: 0x6502 or the EDS say that it has not.
        """
        target = TARGETS.get(mode, od.TARGET_POSITION)
        if not self.node.offers(target):
            raise ConfigurationError(
                f"is not in the EDS: no {_NAMES[mode]}", axis=self.name, obj=target
            )
        if not self.node.offers(od.SUPPORTED_MODES):
            return
        modes = self.node.read(od.SUPPORTED_MODES)
        if not modes >> (mode - 1) & 1:
            raise ConfigurationError(
                f"0x{modes:08X}: the drive does not offer {_NAMES[mode]} mode",
                axis=self.name, obj=od.SUPPORTED_MODES,
            )  # fmt: skip

    def set_mode(self, mode: Mode) -> None:
        """Writes the mode of operation and waits until the drive shows it.

        Raises:
            AxisFault: it shows another one after `MODE_TIMEOUT`.
        """
        self.node.write(od.MODE, mode)
        self.mode = mode
        deadline = self._network.clock.now_ns() + round(MODE_TIMEOUT * 1e9)
        while (shown := self.node.read(od.MODE_DISPLAY)) != mode:
            if self._network.clock.now_ns() >= deadline:
                raise AxisFault(
                    f"asked for mode {int(mode)}, the drive still shows {shown} after "
                    f"{MODE_TIMEOUT:g} s",
                    axis=self.name, obj=od.MODE_DISPLAY,
                )  # fmt: skip
            self._network.pump(0.005)

    def set_profile(self, velocity: float, acceleration: float) -> float:
        """Velocity [m/s] and acceleration [m/s^2] of the drive's own profiles (pp).

        Returns:
            How many times longer than asked for a move takes at most; 1 where the drive has them.

        Raises:
            ConfigurationError, NodeError: the drive has neither these nor slower ones.
        """
        slower, held = parameters.give_profile(self.node, self.settings, velocity, acceleration)
        for ref, clause in held.items():  # of this move, not of the one before
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
    """0x60C2:01 and :02 of a period: value * 10^index seconds.

    Raises:
        ConfigurationError: no UNSIGNED8 times a power of ten is this period.
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
