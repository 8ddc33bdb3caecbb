"""Settings of bus and axes: frozen, in SI units, validated on construction."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from drivers.errors import ConfigurationError, shown

HOST_NODE = 127
"""Node id under which the host sends its heartbeat."""


def _require(condition: bool, axis: str | None, name: str, reason: str) -> None:
    if not condition:
        raise ConfigurationError(f"{name}: {reason}", axis=axis)


def _finite(value: float) -> bool:
    return isinstance(value, int | float) and math.isfinite(value)


@dataclass(frozen=True, slots=True)
class RealTimeSettings:
    """Requests to the operating system, on buses in real time.

    Attributes:
        priority: of SCHED_FIFO, 1..99; 0: normal scheduling.
        core: processor core to run on, None for any.
        lock_memory: keep all memory in RAM (mlockall).
        freeze_gc: no garbage collection during streams.
    """

    priority: int = 0
    core: int | None = None
    lock_memory: bool = False
    freeze_gc: bool = True

    def __post_init__(self) -> None:
        _require(
            0 <= self.priority <= 99, None, "realtime priority",
            f"must be 0..99, is {shown(self.priority)}",
        )  # fmt: skip
        _require(
            self.core is None or self.core >= 0, None, "realtime core",
            f"must be >= 0, is {shown(self.core)}",
        )  # fmt: skip


SYNC_SOURCES = ("auto", "host", "kernel")


@dataclass(frozen=True, slots=True)
class BusSettings:
    """A python-can bus and its SYNC.

    Attributes:
        interface: python-can interface (lockstep, virtual, udp_multicast, socketcan, ...).
        channel: of that interface.
        bitrate: [bit/s]; ignored by interfaces without one.
        sync_period: Ts [s], a whole number of microseconds.
        sync_counter: overflow of the SYNC counter (0x1019), 2..240; 0: no counter.
        sync_source: who sends SYNC: "kernel" (SocketCAN's broadcast manager), "host", or "auto",
            the kernel where possible.
        sync_window: drives and host drop synchronous PDOs that come later than this after SYNC
            (0x1007) [s]; 0: drives accept them at any time, the host for half a period.
        max_missed: consecutive SYNCs an axis may leave unanswered.
        max_late: consecutive SYNCs that may be late.
        realtime: requests to the operating system.
    """

    interface: str
    channel: str
    bitrate: int = 1_000_000
    sync_period: float = 1e-3
    sync_counter: int = 0
    sync_source: str = "auto"
    sync_window: float = 0.0
    max_missed: int = 5
    max_late: int = 50
    realtime: RealTimeSettings = RealTimeSettings()

    def __post_init__(self) -> None:
        _require(bool(self.interface), None, "bus interface", "is empty")
        _require(self.bitrate > 0, None, "bitrate", f"must be > 0, is {shown(self.bitrate)}")
        counter = self.sync_counter
        _require(
            counter == 0 or 2 <= counter <= 240,
            None, "sync_counter", f"must be 0 or 2..240, is {shown(counter)}",
        )  # fmt: skip
        _require(
            self.sync_source in SYNC_SOURCES,
            None, "sync_source", f"must be auto, host or kernel, is {shown(self.sync_source)}",
        )  # fmt: skip
        for name in ("max_missed", "max_late"):
            _require(getattr(self, name) >= 0, None, name, "must be >= 0")
        period = self.sync_period
        _require(
            _finite(period) and period > 0, None, "sync_period", f"must be > 0, is {shown(period)}"
        )
        _require(
            self.period_us >= 1 and abs(period * 1e6 - self.period_us) < 1e-6 * self.period_us,
            None, "sync_period", f"must be a whole number of microseconds, is {shown(period)} s",
        )  # fmt: skip
        window = self.sync_window
        _require(
            _finite(window) and (window == 0 or 10e-6 <= window <= period),
            None, "sync_window", f"must be 0 or 10 us to sync_period, is {shown(window)}",
        )  # fmt: skip

    @property
    def period_us(self) -> int:
        """Ts [us], as 0x1006 holds it."""
        return round(self.sync_period * 1e6)

    @property
    def period_ns(self) -> int:
        """Ts [ns]."""
        return self.period_us * 1000

    @property
    def window_us(self) -> int:
        """SYNC window [us], as 0x1007 holds it; 0: none."""
        return round(self.sync_window * 1e6)

    def __str__(self) -> str:
        return f"{self.interface}:{self.channel}"


@dataclass(frozen=True, slots=True)
class OptionCodes:
    """Option codes of CiA 402: how the drive stops.

    Attributes:
        quick_stop: 0x605A; 0..3 leave QUICK STOP ACTIVE, 5..8 stay in it.  shutdown: 0x605B.
        disable: 0x605C.  halt: 0x605D.  fault_reaction: 0x605E.
        abort_connection: 0x6007, when the host is lost: 1 fault, 2 voltage off, 3 quick stop. 0, no
            action, is not allowed.
    """

    quick_stop: int = 2
    shutdown: int = 1
    disable: int = 1
    halt: int = 1
    fault_reaction: int = 2
    abort_connection: int = 3

    def __post_init__(self) -> None:
        for name, allowed in (
            ("quick_stop", (0, 1, 2, 3, 5, 6, 7, 8)), ("shutdown", (0, 1)), ("disable", (0, 1)),
            ("halt", (1, 2, 3, 4)), ("fault_reaction", (0, 1, 2, 3, 4)),
            ("abort_connection", (1, 2, 3)),
        ):  # fmt: skip
            value = getattr(self, name)
            _require(
                value in allowed, None, f"option code {name}",
                f"must be one of {', '.join(map(str, allowed))}, is {shown(value)}",
            )  # fmt: skip


@dataclass(frozen=True, slots=True)
class AxisSettings:
    """One axis and its drive.

    Attributes:
        name: as in the machine file.  node: CANopen node id, 1..126 (127 is the host's).
        eds: the drive's EDS or DCF file.
        rated_force: base of the CiA 402 force values [N].  peak_force: force limit [N].
        increment: length of one position unit on the bus [m].
        encoder: length of one encoder increment [m]; 0: it is the position unit.
        velocity_unit: of velocities on the bus [m/s]; 0: not known, the drive has to say it.
        acceleration_unit: of accelerations on the bus [m/s^2]; 0: as for velocities.
        travel: (lowest, highest) position [m].
        velocity, acceleration, jerk: limits [m/s, m/s^2, m/s^3].
        following_error: window [m]; the drive faults outside it for following_error_time [s].
        position_window: the target is reached (pp) within it [m] for position_window_time [s].
        options: option codes for stops.
        unwatched_host: accept a drive that stays enabled when the host's heartbeat is lost.
        homing_method: CiA 402 homing method, 33..37 for stages without switches.
        homing_velocity: (search, index) [m/s].
        boot_timeout: until the boot-up message after a communication reset [s].
        enable_timeout: until OPERATION ENABLED, phase finding included [s].
        revision: required major revision number (0x1018:03); None: that of the EDS.
        rotary: it turns: rad for m and N m for N in all of these.
    """

    name: str
    node: int
    eds: Path
    rated_force: float
    peak_force: float
    travel: tuple[float, float]
    velocity: float
    acceleration: float
    jerk: float
    following_error: float
    increment: float = 1e-9
    encoder: float = 0.0
    velocity_unit: float = 0.0
    acceleration_unit: float = 0.0
    homing_method: int = 34
    homing_velocity: tuple[float, float] = (0.01, 0.002)
    following_error_time: float = 0.01
    position_window: float = 1e-6
    position_window_time: float = 0.01
    options: OptionCodes = OptionCodes()
    unwatched_host: bool = False
    boot_timeout: float = 2.0
    enable_timeout: float = 2.0
    revision: int | None = None
    rotary: bool = False

    def __post_init__(self) -> None:
        axis = self.name
        _require(bool(axis), None, "axis", "has no name")
        _require(1 <= self.node < HOST_NODE, axis, "node", f"must be 1..126, is {shown(self.node)}")
        for name in (
            "rated_force", "peak_force", "velocity", "acceleration", "jerk",
            "following_error", "increment", "boot_timeout", "enable_timeout",
        ):  # fmt: skip
            value = getattr(self, name)
            _require(_finite(value) and value > 0, axis, name, f"must be > 0, is {shown(value)}")
        _require(
            self.revision is None or 0 <= self.revision <= 0xFFFF,
            axis, "revision", f"must be 0..65535, is {shown(self.revision)}",
        )  # fmt: skip
        for name in ("following_error_time", "position_window_time"):
            value = getattr(self, name)
            _require(
                _finite(value) and 0 <= value <= 65.535, axis, name,
                f"must be 0 to 65.535 s, is {shown(value)}",
            )  # fmt: skip
        for name in ("encoder", "velocity_unit", "acceleration_unit", "position_window"):
            value = getattr(self, name)
            _require(_finite(value) and value >= 0, axis, name, f"must be >= 0, is {shown(value)}")
        low, high = self.travel
        _require(
            _finite(low) and _finite(high) and low < high, axis, "travel", "must be low < high"
        )
        _require(
            max(abs(low), abs(high)) / self.increment < 2**31,
            axis, "travel", f"does not fit INTEGER32 in units of {self.increment:g} m",
        )  # fmt: skip
        _require(
            self.peak_force / self.rated_force <= 32.767,
            axis, "peak_force", "exceeds 32.767 times rated_force, the range of INTEGER16",
        )  # fmt: skip
        _require(
            len(self.homing_velocity) == 2
            and all(_finite(v) and v > 0 for v in self.homing_velocity),
            axis, "homing_velocity", f"must be two speeds > 0, is {shown(self.homing_velocity)}",
        )  # fmt: skip

    @property
    def encoder_increment(self) -> float:
        """Length of one encoder increment [m]."""
        return self.encoder or self.increment

    @property
    def velocity_unit_si(self) -> float:
        """Unit of velocities on the bus [m/s]; by default one position unit per second."""
        return self.velocity_unit or self.increment

    @property
    def acceleration_unit_si(self) -> float:
        """Unit of accelerations on the bus [m/s^2]; by default 1 um/s^2."""
        return self.acceleration_unit or 1e-6
