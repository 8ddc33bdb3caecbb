"""The models of a machine file: the host's model of a stage or, after `--simulate`, the plant.

They have exactly the keys of docs/machine.md, in SI units. The meaning of the parameters is in
docs/reference-stage.md; conditions between them are in `stagectl.config.machine.checks`.
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
    """The CAN bus of the drives.

    Attributes:
        bitrate: [bit/s].  sync_period: the cycle Ts [s].
        max_missed: consecutive cycles a drive may be silent before all axes are stopped.
        max_late: consecutive cycles SYNC may be late before all axes are stopped.
        sync: who sends SYNC.  sync_counter: its overflow value (0x1019); 0 for no counter.
        sync_window: synchronous window length (0x1007) [s]; 0 for none.
        realtime: what the host requests from the operating system.
    """

    interface: Name
    channel: Label
    bitrate: Annotated[int, Field(ge=10_000, le=1_000_000)]
    sync_period: Annotated[PositiveTime, Field(le=1)]
    max_missed: Annotated[int, Field(ge=0, le=10_000)] = 5
    max_late: Annotated[int, Field(ge=0, le=10_000)] = 50
    sync: SyncSource = "auto"
    sync_counter: Annotated[int, Field(ge=0, le=240)] = 0
    sync_window: NotNegativeTime = 0.0
    realtime: RealTimeSettings = RealTimeSettings()


Milliseconds = Annotated[NotNegativeTime, Field(le=65.535)]
"""Times that drives store as UNSIGNED16 in ms [s]."""


class Limits(Section):
    """Limits of the motion [m/s, m/s^2, m/s^3] and windows of following error and target [m, s]."""

    velocity: PositiveVelocity
    acceleration: PositiveAcceleration
    jerk: Annotated[PositiveJerk, Plausible(1e-9, 1e15, "m/s^3")]
    following_error: PositiveLength
    following_error_time: Milliseconds = 0.01
    position_window: PositiveLength = 1e-6
    position_window_time: Milliseconds = 0.01


class Encoder(Section):
    """Increment and rms noise of the encoder [m].

    Attributes:
        on_load: simulated on the part that the effect `resonance` hangs from the carriage.
    """

    increment: Annotated[PositiveLength, Plausible(1e-15, 1.0, "m")]
    noise: Annotated[NotNegativeLength, Plausible(0.0, 1.0, "m")]
    on_load: bool = False


class Homing(Section):
    """Homing of an axis: CiA 402 method, search velocity and index velocity [m/s]."""

    method: Annotated[int, Field(ge=-128, le=127)] = 34
    velocity: Annotated[PositiveVelocity, Plausible(1e-15, 1e6, "m/s")] = 0.01
    index_velocity: Annotated[PositiveVelocity, Plausible(1e-15, 1e6, "m/s")] = 0.002


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
    """One axis of the stage.

    Attributes:
        node: CANopen node id.  travel: lowest and highest position [m].
        eds: the drive's EDS file, relative to the machine file; None: the virtual drive's.
        effects: further physical effects on this axis, in simulations.
        observer: of the host, which corrects its force offsets: auto, once the axis has been
            measured; trust, by this file unmeasured; none.
        rotary: whether it turns: rad for m, N m for N and kg m^2 for kg.
    """

    node: Annotated[int, Field(ge=1, le=127)]
    travel: LengthPair
    limits: Limits
    rotary: bool = False  # before the drive, whose units depend on it
    encoder: Encoder
    drive: Drive
    plant: Plant
    eds: Name | None = None
    homing: Homing = Homing()
    effects: tuple[GivenEffect, ...] = ()
    observer: Literal["auto", "trust", "none"] = "auto"

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
    """Source of the stage's temperature: an integer object of a drive, or a plug-in.

    Attributes:
        axis: of the drive.  object: "0xINDEX:SUB", hexadecimal.
        scale, offset: [deg C] per count, and at 0 counts.
        plugin: name in the entry point group `stagectl.temperature`, instead of the others.
    """

    axis: str | None = None
    object: ObjectName | None = None
    scale: Number = 1.0
    offset: Number = 0.0
    plugin: Name | None = None


class Machine(Section):
    """A validated machine file. Coordinates of sites and moves are in the order of `axes`.

    Attributes:
        history: friction history of real runs: a file relative to the machine file,
            postgresql://..., or "none"; None: `stage.db` near the run's files.
        temperature: its source, if any.
    """

    name: Annotated[Name, Field(alias="machine")]
    bus: Bus
    axes: Annotated[Mapping[AxisName, Axis], Field(min_length=1, max_length=8)]
    history: Name | None = None
    temperature: Temperature | None = None

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
