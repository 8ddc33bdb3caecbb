"""One axis: the configuration of its drive, and the scaling between SI and integers.

All of it is SDO access before and between motions; process data are `drivers.cyclic`'s. What is
written is read back. Controller gains and other tuning of the drive are left alone.
"""

from __future__ import annotations

import math
from collections.abc import Collection

from drivers import objects as od
from drivers.canopen import RPDO, TPDO, Network, Node, PdoMapping, configure_pdo, disable_pdo
from drivers.canopen.pdo import MappedObject, pdo_label
from drivers.drive import dcf, parameters
from drivers.drive.cia402 import MODE_NAMES, Mode, State, decode
from drivers.drive.host_loss import watch_host
from drivers.drive.scaling import counts, unit
from drivers.drive.units import check_units
from drivers.errors import AxisFault, ConfigurationError, RefusedError
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
_FORCE_TPDO = TPDO + 1
_MOST_BITS = 64

_WITHOUT = {
    od.FORCE_OFFSET: "nothing is compensated",
    od.FORCE_ACTUAL: "force reads 0, friction cannot be learned",
}
"""Objects that are mapped where offered, and the consequence where they are not."""
_OPTIONAL = {RPDO: od.FORCE_OFFSET, TPDO: od.FORCE_ACTUAL}
"""Those by the PDO that carries them, as its last entry."""

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
        increment: one unit of positions on the bus [m].  force_unit: of forces [N].
        homed: whether position 0 is the stage's zero; False after a reboot of the drive.
        rpdo, tpdo: the cyclic mappings, with data types from the EDS; without force offset or
            force where the drive lacks them.
        force_tpdo: mapping of a TPDO for the force alone, where `tpdo` has no room for it; or None.
        rpdo_id, tpdo_id, force_id: CAN-IDs of these PDOs.
        accepts_force_offset: whether the drive has 0x60B2, which friction compensation needs.
        reports_force: whether it has 0x6077.
        mode: mode of operation set last, None before the first.
        target: object of the cyclic target: position, velocity or force.
        limitations: what the drive lacks or holds other than requested, and the consequence, one
            clause each.
    """

    def __init__(self, network: Network, settings: AxisSettings) -> None:
        self.settings = self._requested = settings
        self.name = settings.name
        self.node = Node(network, settings)
        self.increment = unit(settings, od.POSITION_ACTUAL)
        self.force_unit = unit(settings, od.FORCE_ACTUAL)
        self.mode: Mode | None = None
        self.limitations: list[str] = []
        self.target = od.TARGET_POSITION
        self.force_tpdo: PdoMapping | None = None
        self._map_objects(
            {r for r in _WITHOUT if self._is_wide_offset(r) or not self.node.offers(r)}
        )
        self.rpdo_id = 0x200 + settings.node
        self.tpdo_id = 0x180 + settings.node
        self.force_id = 0x280 + settings.node
        self._network = network
        self._homed_at_boot: int | None = None
        self._without_csp: ConfigurationError | None = None

    def _bits(self, ref: ObjectRef) -> int:
        return MappedObject(ref, self.node.data_type(ref)).bits

    def _is_wide_offset(self, ref: ObjectRef) -> bool:
        """Whether it is a force offset that does not fit beside controlword and position."""
        return ref == od.FORCE_OFFSET and self.node.offers(ref) and self._bits(ref) > 16

    def _why_unmapped(self, ref: ObjectRef) -> str:
        """Why an optional object is not mapped; "" where it is."""
        if ref == od.FORCE_OFFSET and self.settings.without_offset:
            return self.settings.without_offset
        if self._is_wide_offset(ref):
            return "has more than 16 bits, which do not fit"
        return "" if self.node.has(ref) else "is not offered"

    def _map_objects(self, absent: Collection[ObjectRef]) -> None:
        """Makes the cyclic mappings without objects that are absent."""
        self.accepts_force_offset = od.FORCE_OFFSET not in absent
        self.reports_force = od.FORCE_ACTUAL not in absent
        rpdo = (od.CONTROLWORD, self.target, od.FORCE_OFFSET)
        tpdo = [ref for ref in TPDO_OBJECTS if ref not in absent]
        try:
            self.rpdo = PdoMapping.of(self.node, [ref for ref in rpdo if ref not in absent])
            self.force_tpdo = None
            if self.reports_force and sum(map(self._bits, tpdo)) > _MOST_BITS:
                tpdo.remove(od.FORCE_ACTUAL)
                self.force_tpdo = PdoMapping.of(self.node, [od.FORCE_ACTUAL])
            self.tpdo = PdoMapping.of(self.node, tpdo)
        except ConfigurationError as refused:
            if refused.axis is not None:  # names itself already
                raise
            raise ConfigurationError(
                f"EDS file {self.settings.eds}: {refused}", axis=self.name
            ) from refused

    def add_limitation(self, *clauses: str) -> None:
        """Adds clauses to `limitations`, each once."""
        self.limitations += [c for c in dict.fromkeys(clauses) if c not in self.limitations]

    def _find_limitations(self) -> None:
        """Finds which cyclic objects the node has, whatever its EDS says."""
        self.limitations.clear()
        if self.settings.note:
            self.add_limitation(self.settings.note)
        absent = {ref: why for ref in _WITHOUT if (why := self._why_unmapped(ref))}
        for ref, why in absent.items():
            self.add_limitation(f"{ref} {why}: {_WITHOUT[ref]}")
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
        self.add_limitation(*dcf.apply(node, dcf.parameter_values(node.dictionary)))
        self.add_limitation(*check_units(node, axis))
        self._find_csp()
        self._set_up_sync(bus.sync_counter)
        self._set_cycle_period(counts(axis, od.CYCLE_PERIOD, bus.sync_period))
        window = counts(axis, od.SYNC_WINDOW, bus.sync_window)
        if not node.write_optional(od.SYNC_WINDOW, window) and window:
            self.add_limitation(
                f"{od.SYNC_WINDOW} is not offered: the drive accepts late setpoints"
            )
        self._set_interpolation(bus.period_us)
        self.settings, clauses = parameters.write_settings(node, axis)
        self.add_limitation(*clauses)
        for number in range(1, PDO_COUNT):
            disable_pdo(node, RPDO + number)
            disable_pdo(node, TPDO + number)
        self._configure_pdos(RPDO, TPDO)
        self._configure_force_tpdo()
        node.set_heartbeat()
        self._watch_host()

    def _configure_pdos(self, *indices: int) -> None:
        """Configures these PDOs; without their optional object where the drive refuses that."""
        for index in indices:
            try:
                self._configure_pdo(index)
            except RefusedError as refused:
                optional = _OPTIONAL[index]
                if optional in self._unmapped():
                    raise
                self.add_limitation(
                    f"{optional} is not mapped ({refused.cause}): {_WITHOUT[optional]}"
                )
                self._map_objects({*self._unmapped(), optional})
                self._configure_pdo(index)

    def _configure_force_tpdo(self) -> None:
        """Configures the TPDO of the force alone; does without the force where that is refused."""
        if self.force_tpdo is None:
            return
        try:
            self.force_id = configure_pdo(self.node, _FORCE_TPDO, self.force_id, self.force_tpdo)
        except (RefusedError, ConfigurationError) as refused:
            disable_pdo(self.node, _FORCE_TPDO)
            self.add_limitation(
                f"{od.FORCE_ACTUAL} is not mapped ({refused.cause}): {_WITHOUT[od.FORCE_ACTUAL]}"
            )
            self._map_objects({*self._unmapped(), od.FORCE_ACTUAL})

    def _configure_pdo(self, index: int) -> None:
        """Configures a PDO; follows its CAN-ID where the drive has that fixed."""
        if index == RPDO:
            asked = self.rpdo_id
            self.rpdo_id = found = configure_pdo(self.node, index, asked, self.rpdo)
        else:
            asked = self.tpdo_id
            self.tpdo_id = found = configure_pdo(self.node, index, asked, self.tpdo)
        if found != asked:
            self.add_limitation(
                f"{pdo_label(index)} keeps its CAN-ID 0x{found:03X}, not 0x{asked:03X}"
            )

    def _unmapped(self) -> set[ObjectRef]:
        """Optional objects that the present mappings lack."""
        pdos = (self.rpdo, self.tpdo, *([self.force_tpdo] if self.force_tpdo else []))
        mapped = {entry.object for pdo in pdos for entry in pdo.entries}
        return set(_WITHOUT) - mapped

    def _set_cycle_period(self, wanted: int) -> None:
        """Writes 0x1006 [us]; a drive that keeps 0 does not use it, and one may round it by 1 %."""
        result = self.node.write_if_accepted(od.CYCLE_PERIOD, wanted)
        held, refusal = result or (wanted, None)
        if held and abs(held - wanted) > parameters.ROUNDING * wanted:
            raise self.node.mismatch(od.CYCLE_PERIOD, wanted, held, refusal)
        if held != wanted:
            why = "the drive rounds it" if held else "the drive does not watch SYNC by it"
            self.add_limitation(f"{od.CYCLE_PERIOD} is {held} us, not {wanted} us: {why}")

    def _set_interpolation(self, period_us: int) -> None:
        """Writes 0x60C2, in the notation that the drive takes: 10 ms are 1 * 10^-2 or 10 * 10^-3.

        Raises:
            ConfigurationError: the drive takes none; it would interpolate over another time.
        """
        value, index = interpolation_period(period_us)
        held = 0, -3
        while value <= 255:
            first = self.node.write_if_accepted(od.INTERPOLATION_VALUE, value)
            if first is None:
                self.add_limitation(
                    f"{od.INTERPOLATION_VALUE} is not offered: over which time the drive "
                    "interpolates setpoints is not known"
                )
                return
            second = self.node.write_if_accepted(od.INTERPOLATION_INDEX, index)
            held = first[0], -3 if second is None else second[0]
            if math.isclose(held[0] * 10.0 ** held[1], period_us * 1e-6):
                return
            value, index = 10 * value, index - 1
        raise ConfigurationError(
            f"the drive interpolates over {held[0]} * 10^{held[1]} s, SYNC comes every "
            f"{period_us} us: choose a bus.sync_period that it takes",
            axis=self.name, obj=od.INTERPOLATION_VALUE,
        )  # fmt: skip

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

    def _set_up_sync(self, overflow: int) -> None:
        """Sets 0x1005 and 0x1019, while 0x1006 is 0: the drive consumes our SYNC, produces none."""
        node = self.node
        if node.offers(od.SYNC_COB_ID) and node.read(od.SYNC_COB_ID) & 0x4000_07FF != od.SYNC_ID:
            node.write_optional(od.CYCLE_PERIOD, 0)
            node.write_checked(od.SYNC_COB_ID, od.SYNC_ID)
        if node.has(od.SYNC_OVERFLOW):
            if node.read(od.SYNC_OVERFLOW) != overflow:
                node.write_optional(od.CYCLE_PERIOD, 0)
                node.write_checked(od.SYNC_OVERFLOW, overflow)
        elif overflow:
            raise ConfigurationError(
                "is not offered: the drive would refuse a SYNC with a counter",
                axis=self.name, obj=od.SYNC_OVERFLOW,
            )  # fmt: skip

    def _find_csp(self) -> None:
        """Finds whether the drive offers csp; one that does not needs pp."""
        try:
            self.check_mode(Mode.CYCLIC_SYNC_POSITION)
            self._try_csp()
            self._without_csp = None
        except ConfigurationError as why:
            try:
                self.check_mode(Mode.PROFILE_POSITION)
            except ConfigurationError:
                raise why from None
            self._without_csp = why
            self.add_limitation(
                "no csp: only moves by the drive's own profile (pp), nothing can be streamed"
            )

    def _try_csp(self) -> None:
        """Selects csp on a drive without power; nothing moves by it.

        Raises:
            ConfigurationError: the drive refuses it, whatever it claims.
        """
        if decode(self.node.read(od.STATUSWORD)) is State.OPERATION_ENABLED:
            return
        try:
            self.node.write(od.MODE, self.settings.csp_mode)
        except RefusedError as refused:
            raise ConfigurationError(refused.cause, axis=self.name, obj=od.MODE) from refused

    def require_csp(self) -> None:
        """Refuses a drive that does not offer csp; known once it is configured.

        Raises:
            ConfigurationError: why it does not.
        """
        if self._without_csp is not None:
            raise self._without_csp

    @property
    def streams(self) -> bool:
        """Whether the drive offers csp."""
        return self._without_csp is None

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
        self._map_objects(self._unmapped())
        self._configure_pdos(RPDO)
        return True

    def check_mode(self, mode: Mode) -> None:
        """Checks that the drive offers a mode of operation.

        Raises:
            ConfigurationError: it does not, by 0x6502 or the EDS.
        """
        target = TARGETS.get(mode, od.TARGET_POSITION)
        if mode is not Mode.CYCLIC_SYNC_POSITION and mode == self.settings.csp_mode:
            raise ConfigurationError(
                f"mode {int(mode)} is csp on this drive: no {MODE_NAMES[mode]}", axis=self.name
            )
        if not self.node.offers(target):
            raise ConfigurationError(
                f"is not in the EDS: no {MODE_NAMES[mode]}", axis=self.name, obj=target
            )
        self.check_objects(mode)
        if stated := self.settings.modes:
            if mode not in stated:
                raise ConfigurationError(
                    f"the machine file's modes leave out {MODE_NAMES[mode]}", axis=self.name
                )
            return
        modes = self.node.read_if_offered(od.SUPPORTED_MODES)
        if modes is None:
            return
        if not 1 <= (code := self._code(mode)) <= 32 or not modes >> (code - 1) & 1:
            raise ConfigurationError(
                f"0x{modes:08X}: the drive does not offer {MODE_NAMES[mode]} mode (if it does, "
                "state its modes in its drive section)",
                axis=self.name, obj=od.SUPPORTED_MODES,
            )  # fmt: skip

    def check_objects(self, mode: Mode) -> None:
        """Checks that the drive has the objects that the host writes for a mode.

        Raises:
            ConfigurationError: one is missing.
            NodeError: no answer.
        """
        if mode is Mode.HOMING and not self.settings.confirms_homing:
            raise ConfigurationError(
                "has no bit 12 (homing attained) by its profile: an interrupted homing could not "
                "be told from a complete one",
                axis=self.name, obj=od.STATUSWORD,
            )  # fmt: skip
        for ref in _NEEDED.get(mode, ()):
            if not self.node.has(ref):
                raise ConfigurationError(
                    f"is not offered: {MODE_NAMES[mode]} mode needs it", axis=self.name, obj=ref
                )

    def set_mode(self, mode: Mode) -> bool:
        """Writes the mode of operation and waits until the drive displays it (0x6061).

        Returns:
            False where a drive without power keeps the mode in 0x6060 but displays none: it may
            display modes when enabled only, to be confirmed by `confirm_mode`.

        Raises:
            AxisFault: another mode is displayed after `MODE_TIMEOUT`.
        """
        self.node.write(od.MODE, self._code(mode))
        self.mode = mode
        try:
            self.confirm_mode(mode)
        except AxisFault:
            enabled = decode(self.node.read(od.STATUSWORD)) is State.OPERATION_ENABLED
            if (
                enabled
                or self.node.read(od.MODE_DISPLAY)
                or self.node.read(od.MODE) != self._code(mode)
            ):
                raise
            return False
        return True

    def _code(self, mode: Mode) -> int:
        """The value of 0x6060 that selects a mode."""
        return self.settings.csp_mode if mode is Mode.CYCLIC_SYNC_POSITION else int(mode)

    def confirm_mode(self, mode: Mode) -> None:
        """Waits until the drive displays the mode.

        Raises:
            AxisFault: another mode is displayed after `MODE_TIMEOUT`.
        """
        deadline = self._network.clock.now_ns() + round(MODE_TIMEOUT * 1e9)
        code = self._code(mode)
        while (shown := self.node.read(od.MODE_DISPLAY)) != code:
            if self._network.clock.now_ns() >= deadline:
                raise AxisFault(
                    f"shows mode {shown} {MODE_TIMEOUT:g} s after mode {code} was requested",
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
