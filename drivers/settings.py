"""Settings of bus and axes: frozen, in SI units, validated on construction."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from annotated_types import Interval

from drivers.errors import ConfigurationError, shown
from stagedata.ranges import Count, NotNegative, Positive, Whole, check_ranges

HOST_NODE = 127
"""Node id under which the host sends its heartbeat."""


def _require(axis: str | None, *rules: tuple[bool, str, str]) -> None:
    """Refuse settings by the first rule, with name and reason, that does not hold."""
    for holds, name, reason in rules:
        if not holds:
            raise ConfigurationError(f"{name}: {reason}", axis=axis)


def _check(settings: object, axis: str | None = None, prefix: str = "") -> None:
    """Refuse settings outside the ranges in their annotations.

    Raises:
        ConfigurationError: names axis and setting.
    """
    try:
        check_ranges(settings)
    except ValueError as error:
        raise ConfigurationError(f"{prefix}{error}", axis=axis) from None


@dataclass(frozen=True, slots=True)
class RealTimeSettings:
    """Requests to the operating system, on buses in real time."""

    priority: Annotated[int, Interval(ge=0, le=99)] = 0
    """SCHED_FIFO priority, 1 to 99; 0: not requested."""
    core: Annotated[int, Interval(ge=0, le=1023)] | None = None
    """Processor core to run on; without it: any."""
    lock_memory: bool = False
    """Keep all memory in RAM (mlockall)."""
    freeze_gc: bool = True
    """No garbage collection during motion."""

    def __post_init__(self) -> None:
        _check(self, prefix="realtime ")


SyncSource = Literal["auto", "host", "kernel"]
Milliseconds = Annotated[float, Interval(ge=0, le=65.535)]
"""Times that drives hold as UNSIGNED16 in ms [s]."""


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
    bitrate: Count = 1_000_000
    sync_period: Positive = 1e-3
    sync_counter: int = 0
    sync_source: SyncSource = "auto"
    sync_window: NotNegative = 0.0
    max_missed: Whole = 5
    max_late: Whole = 50
    realtime: RealTimeSettings = RealTimeSettings()

    def __post_init__(self) -> None:
        _require(None, (bool(self.interface), "bus interface", "is empty"))
        _check(self)
        counter, period, window = self.sync_counter, self.sync_period, self.sync_window
        whole = self.period_us >= 1 and abs(period * 1e6 - self.period_us) < 1e-6 * self.period_us
        fits = window == 0 or 10e-6 <= window <= period
        _require(
            None,
            (counter == 0 or 2 <= counter <= 240, "sync_counter",
             f"must be 0 or 2..240, is {shown(counter)}"),
            (whole, "sync_period", f"must be a whole number of microseconds, is {shown(period)} s"),
            (fits, "sync_window", f"must be 0 or 10 us to sync_period, is {shown(window)}"),
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
    """Option codes of CiA 402: how the drive stops."""

    quick_stop: Literal[0, 1, 2, 3, 5, 6, 7, 8] = 2
    """0x605A; 0 to 3 leave QUICK STOP ACTIVE, 5 to 8 stay in it."""
    shutdown: Literal[0, 1] = 1
    """0x605B."""
    disable: Literal[0, 1] = 1
    """0x605C."""
    halt: Literal[1, 2, 3, 4] = 1
    """0x605D."""
    fault_reaction: Literal[0, 1, 2, 3, 4] = 2
    """0x605E."""
    abort_connection: Literal[1, 2, 3] = 3
    """0x6007, the drive's reaction to the loss of its host: 1 fault, 2 voltage off, 3 quick stop.
    0, no action, is not allowed."""

    def __post_init__(self) -> None:
        _check(self, prefix="option code ")


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
        lead: travel per revolution of a rotary drive on a linear axis [m]; 0: there is none.
        travel: (lowest, highest) position [m].
        velocity, acceleration, jerk: limits [m/s, m/s^2, m/s^3].
        following_error: window [m]; the drive faults outside it for following_error_time [s].
        position_window: the target is reached (pp) within it [m] for position_window_time [s].
        options: option codes for stops.
        rated_force_unit: one count of 0x6076 [N].
        modes: that the drive offers, where its 0x6502 is not to be believed; none: by 0x6502.
        csp_mode: value of 0x6060 that selects csp.
        confirms_homing: it has statusword bit 12, homing attained.
        without_offset: why force offsets must not be sent; "": they may.
        note: what else is to be known of the drive, one clause; "": nothing.
        warnings: EMCY error codes that stop the axes also with error register 0.
        heartbeat: period of the drive's heartbeat [s].
        unwatched_host: accept a drive that stays enabled when the host's heartbeat is lost.
        homing_method: CiA 402 homing method, 33..37 for stages without switches.
        homing_velocity: (search, index) [m/s].
        boot_timeout: until the boot-up message after a communication reset [s].
        enable_timeout: until OPERATION ENABLED, phase finding included [s].
        revision: required major revision number (0x1018:03); None: that of the EDS.
        rotary: it turns: rad for m and N m for N in all of these.
    """

    name: str
    node: Annotated[int, Interval(ge=1, le=HOST_NODE - 1)]
    eds: Path
    rated_force: Positive
    peak_force: Positive
    travel: tuple[float, float]
    velocity: Positive
    acceleration: Positive
    jerk: Positive
    following_error: Positive
    increment: Positive = 1e-9
    encoder: NotNegative = 0.0
    velocity_unit: NotNegative = 0.0
    acceleration_unit: NotNegative = 0.0
    lead: NotNegative = 0.0
    rated_force_unit: Positive = 1e-3
    modes: tuple[int, ...] = ()
    csp_mode: Annotated[int, Interval(ge=-128, le=127)] = 8
    confirms_homing: bool = True
    without_offset: str = ""
    note: str = ""
    warnings: tuple[int, ...] = ()
    heartbeat: Annotated[float, Interval(ge=0.01, le=1.0)] = 0.1
    homing_method: int = 34
    homing_velocity: tuple[float, float] = (0.01, 0.002)
    following_error_time: Milliseconds = 0.01
    position_window: NotNegative = 1e-6
    position_window_time: Milliseconds = 0.01
    options: OptionCodes = OptionCodes()
    unwatched_host: bool = False
    boot_timeout: Positive = 2.0
    enable_timeout: Positive = 2.0
    revision: Annotated[int, Interval(ge=0, le=0xFFFF)] | None = None
    rotary: bool = False

    def __post_init__(self) -> None:
        axis = self.name
        _require(None, (bool(axis), "axis", "has no name"))
        _check(self, axis)
        low, high = self.travel
        speeds = self.homing_velocity
        _require(
            axis,
            (-math.inf < low < high < math.inf, "travel", "must be low < high"),
            (max(abs(low), abs(high)) / self.increment < 2**31, "travel",
             f"does not fit INTEGER32 in units of {self.increment:g} m"),
            (self.peak_force / self.rated_force <= 32.767, "peak_force",
             "exceeds 32.767 times rated_force, the range of INTEGER16"),
            (len(speeds) == 2 and all(0 < v < math.inf for v in speeds), "homing_velocity",
             f"must be two speeds > 0, is {shown(speeds)}"),
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
