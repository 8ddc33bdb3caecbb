"""The models of a machine file: the host's model of a stage or, after `--simulate`, the plant.

They have exactly the keys of docs/how-to/machine-file.md, in SI units. The meaning of the
parameters is in docs/reference/reference-stage.md; conditions between them are in
`stagectl.config.machine.checks`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import (
    BeforeValidator,
    Field,
    PrivateAttr,
    StringConstraints,
    ValidationInfo,
    field_validator,
)

from drivers.settings import RealTimeSettings, SyncSource
from stagectl.config.machine.drive import Drive, position_unit_for
from stagectl.config.machine.plant import Plant
from stagectl.config.machine.plausible import Plausible
from stagectl.config.parsing.units import (
    Length,
    NotNegativeLength,
    NotNegativeTime,
    Number,
    PositiveAcceleration,
    PositiveJerk,
    PositiveLength,
    PositiveTime,
    PositiveVelocity,
)
from stagectl.config.parsing.validation import Section, refusal
from stagectl.config.parsing.yaml_nodes import Document, describe_value
from stagedata import angular_unit

Name = Annotated[str, StringConstraints(min_length=1, max_length=200)]
ObjectName = Annotated[str, StringConstraints(pattern=r"^0x[0-9A-Fa-f]{1,4}:[0-9A-Fa-f]{1,2}$")]
AxisName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z][A-Za-z0-9_]{0,31}$")]


def _label(value: object) -> object:
    """Accept plain integers, which channels, lots and wafers often are."""
    return str(value) if isinstance(value, int) and not isinstance(value, bool) else value


Label = Annotated[Name, BeforeValidator(_label)]


def _pair(value: object) -> object:
    if not isinstance(value, list) or len(value) != 2:
        what = f"{len(value)} items" if isinstance(value, list) else describe_value(value)
        raise refusal(f"must be a list of two, is {what}")
    return tuple(value)


LengthPair = Annotated[tuple[Length, Length], BeforeValidator(_pair)]


class Bus(Section):
    """The CAN bus of the drives."""

    interface: Name
    """Any python-can interface: `virtual`, `socketcan`, `udp_multicast`, `lockstep`, ..."""
    channel: Label
    """As that interface names it: `can0`, `239.74.163.2`, ..."""
    bitrate: Annotated[int, Field(ge=10_000, le=1_000_000)]
    """Bits per second."""
    sync_period: Annotated[PositiveTime, Field(le=1)]
    """Time between two SYNC messages: the cycle of setpoints and samples. A whole number of µs."""
    max_missed: Annotated[int, Field(ge=0, le=10_000)] = 5
    """Consecutive cycles that a drive may be silent before all axes are stopped. Raise it only on a
    computer without real-time behaviour, and where nothing heavy moves."""
    max_late: Annotated[int, Field(ge=0, le=10_000)] = 50
    """Consecutive SYNCs that may be late before all axes are stopped. Late: more than half a period
    after its due time or, where the kernel sends it, without new setpoints."""
    sync: SyncSource = "auto"
    """Who sends SYNC: `kernel` (SocketCAN's broadcast manager), `host`, or `auto`: the kernel where
    possible."""
    sync_counter: Annotated[int, Field(ge=0, le=240)] = 0
    """SYNC carries a counter from 1 to this value (0x1019), 2 to 240; 0: none."""
    sync_window: NotNegativeTime = 0.0
    """Synchronous PDOs later than this after SYNC are dropped by the drives (0x1007) and by the
    host; up to `sync_period`, 0: none."""
    realtime: RealTimeSettings = RealTimeSettings()
    """What is requested from the operating system."""


Milliseconds = Annotated[NotNegativeTime, Field(le=65.535)]
"""Times that drives store as UNSIGNED16 in ms [s]."""


class Limits(Section):
    """Limits of the motion [m/s, m/s^2, m/s^3] and windows of following error and target [m, s]."""

    velocity: PositiveVelocity
    """Upper limit for recipes."""
    acceleration: PositiveAcceleration
    """Upper limit for recipes."""
    jerk: Annotated[PositiveJerk, Plausible(1e-9, 1e15, "m/s^3")]
    """Upper limit for recipes."""
    following_error: PositiveLength
    """The drive stops with a fault when the following error exceeds this (0x6065)."""
    following_error_time: Milliseconds = 0.01
    """For this long (0x6066)."""
    position_window: PositiveLength = 1e-6
    """"Target reached" in the drive's own moves (0x6067)."""
    position_window_time: Milliseconds = 0.01
    """For this long (0x6068)."""


class Encoder(Section):
    """Increment and rms noise of the encoder [m]."""

    increment: Annotated[PositiveLength, Plausible(1e-15, 1.0, "m")]
    """One count."""
    noise: Annotated[NotNegativeLength, Plausible(0.0, 1.0, "m")]
    """Rms value; 0 for none."""
    on_load: bool = False
    """True, with the effect `resonance`, in a simulation: the encoder is on the part that swings,
    the motor on the carriage."""


class Homing(Section):
    """Homing of an axis: CiA 402 method, search velocity and index velocity [m/s]."""

    method: Annotated[int, Field(ge=-128, le=127)] = 34
    """CiA 402 homing method (0x6098). 34: index pulse in positive direction."""
    velocity: Annotated[PositiveVelocity, Plausible(1e-15, 1e6, "m/s")] = 0.01
    """Speed of the search; fast enough for the travel and back within 30 days."""
    index_velocity: Annotated[PositiveVelocity, Plausible(1e-15, 1e6, "m/s")] = 0.002
    """Speed at the index."""


class Effect(NamedTuple):
    """A physical effect by name, with its parameters (SI): numbers, or tuples of them."""

    name: str
    parameters: Mapping[str, Any]


def _effect(value: object) -> Effect:
    """`{effect: NAME, KEY: NUMBER or LIST, ...}`; the simulator checks the keys of each effect."""
    if not isinstance(value, dict):
        raise refusal(
            f"must be a mapping {{effect: name, key: number}}, is {describe_value(value)}"
        )
    name = value.get("effect")
    if not isinstance(name, str) or not name:
        raise refusal("needs the key effect with the effect's name")
    figures: dict[str, Any] = {}
    for key, figure in value.items():
        if key == "effect":
            continue
        if isinstance(figure, list):
            figures[key] = tuple(_number(name, f"{key}[{i}]", one) for i, one in enumerate(figure))
        else:
            figures[key] = _number(name, key, figure)
    return Effect(name, figures)


def _number(effect: str, key: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise refusal(f"{effect}: {key} must be a number (SI), is {describe_value(value)}")
    return float(value)


GivenEffect = Annotated[Effect, BeforeValidator(_effect)]
"""An effect as it stands in a machine file."""


class Axis(Section):
    """One axis of the stage."""

    node: Annotated[int, Field(ge=1, le=127)]
    """CANopen node id, unique; 127 is the host."""
    travel: LengthPair
    """[lowest, highest] position: the range of recipes, and the drive's software limits. Positions
    are 32-bit integers on the bus: within ±2.147 m if their unit is 1 nm; an axis that turns has a
    coarser unit by itself."""
    limits: Limits
    """What recipes may ask for, and what the drive watches."""
    rotary: bool = False  # before the drive, whose units depend on it
    """True: the axis turns, with rad for m, N m for N and kg m² for kg in all its keys, and the
    effect `unbalance`."""
    encoder: Encoder
    """What the axis is measured with."""
    drive: Drive
    """What moves it."""
    plant: Plant
    """What is moved."""
    eds: Name | None = None
    """The drive's EDS file, relative to the machine file; without it that of the virtual drive. The
    values of a DCF (`ParameterValue` of any data type) are written at boot, before units are
    checked, and read back (speeds and accelerations may be rounded); objects that the driver sets
    itself are left out."""
    homing: Homing = Homing()
    """How the axis finds its zero."""
    effects: tuple[GivenEffect, ...] = ()
    """List of `{effect: name, key: number, ...}`: what else acts on this axis, simulated, and
    compensated by the host of a run. The keys of each effect:
    [effects](../formats/effects.md#keys). Time begins with the first SYNC at which the host
    streams setpoints."""
    observer: Literal["auto", "trust", "none"] = "auto"
    """`auto`: force offsets are corrected by the [observer](../explanation/observer.md) once the
    axis has been measured; `trust`: unmeasured, by this file alone; `none`: never."""

    @field_validator("drive")
    @classmethod
    def _count_turns(cls, drive: Drive, info: ValidationInfo) -> Drive:
        """Where an axis turns and no unit is stated, positions count in one that travel fits in."""
        given = info.data
        if not given.get("rotary") or "position_unit" in drive.model_fields_set:
            return drive
        reach = max(map(abs, given.get("travel", ())), default=0.0)
        speed = given["limits"].velocity if "limits" in given else 0.0
        most = max(reach, 0.0 if drive.velocity_unit is not None else speed)
        return drive.model_copy(update={"position_unit": position_unit_for(most)})

    def unit_of(self, unit: str) -> str:
        """The unit on this axis of what has `unit` on an axis that slides."""
        return angular_unit(unit) if self.rotary else unit


class Temperature(Section):
    """Source of the stage's temperature: an integer object of a drive, or a plug-in."""

    axis: str | None = None
    """Drive whose object holds the stage's temperature; read before the first move, then between
    moves at most once a minute. A reading that fails is skipped; it stops nothing."""
    object: ObjectName | None = None
    """Integer object of that drive, hexadecimal: `"0x2100:01"`."""
    scale: Number = 1.0
    """°C per count."""
    offset: Number = 0.0
    """°C at 0 counts."""
    plugin: Name | None = None
    """Instead of axis and object, a plug-in: a callable without arguments in the entry point group
    `stagectl.temperature` that returns an object with `read() -> float` in °C."""


class Machine(Section):
    """A validated machine file. Coordinates of sites and moves are in the order of `axes`."""

    name: Annotated[Name, Field(alias="machine")]
    """Name of the stage."""
    bus: Bus
    """The CAN bus of the drives."""
    axes: Annotated[Mapping[AxisName, Axis], Field(min_length=1, max_length=8)]
    """Axes by name; a name begins with a letter and consists of letters, digits and `_`. A recipe
    needs exactly two, and its coordinates follow their order here."""
    history: Name | None = None
    """Where real runs on this machine write their friction history: a file relative to the machine
    file, `postgresql://user@host/database`, or `none`; a password in it, or in a comment, stays out
    of recordings and twins. Without it: `stage.db` next to the run's folder, or inside it with
    `--out`. Simulated runs write to it only on `--history`."""
    temperature: Temperature | None = None
    """Where the stage's temperature comes from."""

    _document: Document = PrivateAttr()
    _unknown: Mapping[str, tuple[str, ...]] = PrivateAttr(default_factory=dict)

    def attach(self, document: Document, unknown: Mapping[str, tuple[str, ...]]) -> None:
        """Remember the file that this was read from, and what it leaves unknown."""
        self._document, self._unknown = document, unknown

    @property
    def unknown(self) -> Mapping[str, tuple[str, ...]]:
        """Axis -> figures that the file leaves unknown (`stagectl.config.machine.unknown`)."""
        return self._unknown

    @property
    def text(self) -> str:
        """The file's text, which goes into recordings: as read, but without a password."""
        return self._document.text

    @property
    def source(self) -> str:
        """The name of the file."""
        return self._document.name

    @property
    def document(self) -> Document:
        """The parsed file, for messages that point into it."""
        return self._document
