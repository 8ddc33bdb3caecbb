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
    StrictBool,
    StrictInt,
    StringConstraints,
)

from stagectl.config.parsing.units import (
    Length,
    NotNegativeDamping,
    NotNegativeIntegralGain,
    NotNegativeLength,
    NotNegativeNumber,
    NotNegativeTime,
    Number,
    PositiveAcceleration,
    PositiveForce,
    PositiveForceRate,
    PositiveFrequency,
    PositiveJerk,
    PositiveLength,
    PositiveMass,
    PositiveNumber,
    PositiveStiffness,
    PositiveTime,
    PositiveVelocity,
)
from stagectl.config.parsing.validation import Section, refusal
from stagectl.config.parsing.yaml_nodes import Document, describe_value
from stagedata import MAX_ELEMENTS, FrictionFigures, LawName

Name = Annotated[str, StringConstraints(min_length=1, max_length=200)]
ObjectName = Annotated[str, StringConstraints(pattern=r"^0x[0-9A-Fa-f]{1,4}:[0-9A-Fa-f]{1,2}$")]
AxisName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z][A-Za-z0-9_]{0,31}$")]


def _label(value: object) -> object:
    """Accept plain integers, which channels, lots and wafers often are."""
    return str(value) if isinstance(value, int) and not isinstance(value, bool) else value


Label = Annotated[Name, BeforeValidator(_label)]


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


def _pair(value: object) -> object:
    if not isinstance(value, list) or len(value) != 2:
        what = f"{len(value)} items" if isinstance(value, list) else describe_value(value)
        raise refusal(f"must be a list of two, is {what}")
    return value


LengthPair = Annotated[tuple[Length, Length], BeforeValidator(_pair)]


class RealTime(Section):
    """What the host requests from the operating system on a bus in real time.

    Attributes:
        priority: of SCHED_FIFO; 0 for none.  core: to run on; None for any.
        lock_memory: keep all memory in RAM.  freeze_gc: no garbage collection during motion.
    """

    priority: Annotated[StrictInt, Field(ge=0, le=99)] = 0
    core: Annotated[StrictInt, Field(ge=0, le=1023)] | None = None
    lock_memory: StrictBool = False
    freeze_gc: StrictBool = True


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
    bitrate: Annotated[StrictInt, Field(ge=10_000, le=1_000_000)]
    sync_period: Annotated[PositiveTime, Field(le=1)]
    max_missed: Annotated[StrictInt, Field(ge=0, le=10_000)] = 5
    max_late: Annotated[StrictInt, Field(ge=0, le=10_000)] = 50
    sync: Literal["auto", "host", "kernel"] = "auto"
    sync_counter: Annotated[StrictInt, Field(ge=0, le=240)] = 0
    sync_window: NotNegativeTime = 0.0
    realtime: RealTime = RealTime()


Milliseconds = Annotated[NotNegativeTime, Field(le=65.535)]
"""Times that drives store as UNSIGNED16 in ms [s]."""


class Limits(Section):
    """Limits of the motion [m/s, m/s^2, m/s^3] and windows of following error and target [m, s]."""

    velocity: PositiveVelocity
    acceleration: PositiveAcceleration
    jerk: PositiveJerk
    following_error: PositiveLength
    following_error_time: Milliseconds = 0.01
    position_window: PositiveLength = 1e-6
    position_window_time: Milliseconds = 0.01


class Encoder(Section):
    """Increment and rms noise of the encoder [m]."""

    increment: PositiveLength
    noise: NotNegativeLength


class Pid(Section):
    """Position loop: kp [N/m], ki [N/(m s)], kd [N s/m], derivative's low-pass [s]."""

    kp: PositiveStiffness
    ki: NotNegativeIntegralGain
    kd: NotNegativeDamping
    derivative_time: NotNegativeTime


class Cascade(Section):
    """A P position loop over a PI velocity loop, instead of the PID.

    Attributes:
        position_gain: [1/s].  velocity_gain: [N s/m].  velocity_integral: [N/m].
        feedforward: share of the setpoint velocity that is added.
        span: control ticks over which the encoder is differenced.
        derivative_time: time constant of the low-pass after that [s].
    """

    position_gain: PositiveNumber
    velocity_gain: PositiveNumber
    velocity_integral: NotNegativeNumber = 0.0
    feedforward: Annotated[NotNegativeNumber, Field(le=1)] = 0.0
    span: Literal[1, 2] = 1
    derivative_time: NotNegativeTime = 0.0


class OptionCodes(Section):
    """How the drive stops: values of 0x605A, 0x605B, 0x605C, 0x605D, 0x605E and 0x6007."""

    quick_stop: Literal[0, 1, 2, 3, 5, 6, 7, 8] = 2
    shutdown: Literal[0, 1] = 1
    disable: Literal[0, 1] = 1
    halt: Literal[1, 2, 3, 4] = 1
    fault_reaction: Literal[0, 1, 2, 3, 4] = 2
    abort_connection: Literal[1, 2, 3] = 3


class Drive(Section):
    """Force scaling [N], current loop [Hz], control tick Tc [s] and position loop of a drive.

    Attributes:
        position_unit, velocity_unit, acceleration_unit: of its integers on the bus [m, m/s,
            m/s^2]; velocity_unit None: one position unit per second.
        unwatched_host: whether to power a drive that keeps moving when its host is gone.
        boot_timeout: for its boot-up message [s].
        enable_timeout: for OPERATION ENABLED, phase finding included [s].
        revision: required major revision number; None: that of the EDS.
        pid: the position loop; None if there is a cascade.
        cascade: the loops instead of a PID.
    """

    rated_force: PositiveForce
    peak_force: PositiveForce
    current_bandwidth: PositiveFrequency
    control_period: PositiveTime
    position_unit: PositiveLength = 1e-9
    velocity_unit: PositiveVelocity | None = None
    options: OptionCodes = OptionCodes()
    unwatched_host: Literal["refuse", "accept"] = "refuse"
    acceleration_unit: PositiveAcceleration = 1e-6
    boot_timeout: PositiveTime = 2.0
    enable_timeout: PositiveTime = 2.0
    revision: Annotated[StrictInt, Field(ge=0, le=65_535)] | None = None
    pid: Pid | None = None
    cascade: Cascade | None = None

    @property
    def force_unit(self) -> float:
        """One count of force on the bus: 1/1000 of the rated force [N]."""
        return self.rated_force / 1000.0


class Repeatability(Section):
    """Random variation of the Coulomb force: relative rms, correlation time [s]."""

    coulomb: NotNegativeNumber = 0.0
    correlation_time: PositiveTime = 0.5


class Friction(Section):
    """Friction figures with their law, in the symbols of docs/reference-stage.md.

    Attributes:
        model: name of the law; which figures it has, `stagectl.config.machine.checks` sees to.
        elements: N.  coulomb: Fc [N].  static_ratio: alpha = (Fs - Fc)/Fc, > -1.
        stribeck_velocity: vs [m/s].  stribeck_shape: delta.  stiffness: sigma0 [N/m].
        attraction: C [N/s].  viscous: sigma_v [N s/m].
    """

    model: LawName
    elements: Annotated[StrictInt, Field(ge=1, le=MAX_ELEMENTS)] | None = None
    coulomb: PositiveForce
    static_ratio: Annotated[Number, Field(gt=-1)]
    stribeck_velocity: PositiveVelocity
    stribeck_shape: PositiveNumber
    stiffness: PositiveStiffness | None = None
    attraction: PositiveForceRate | None = None
    viscous: NotNegativeDamping
    repeatability: Repeatability = Repeatability()

    @property
    def figures(self) -> FrictionFigures:
        """The figures as simulator and estimator take them."""
        return FrictionFigures(
            elements=self.elements or 0,
            coulomb=self.coulomb,
            viscous=self.viscous,
            stiffness=self.stiffness or 0.0,
            relaxation_rate=(self.attraction or 0.0) / self.coulomb,
            static_ratio=self.static_ratio,
            stribeck_velocity=self.stribeck_velocity,
            stribeck_shape=self.stribeck_shape,
            law=self.model,
        )


class Plant(Section):
    """The mechanics; `tolerance` is the uncertainty of the parameters (relative, 1 sigma)."""

    tolerance: Annotated[NotNegativeNumber, Field(lt=1)]
    mass: PositiveMass
    friction: Friction


class Homing(Section):
    """Homing of an axis: CiA 402 method, search velocity and index velocity [m/s]."""

    method: Annotated[StrictInt, Field(ge=-128, le=127)] = 34
    velocity: PositiveVelocity = 0.01
    index_velocity: PositiveVelocity = 0.002


class Axis(Section):
    """One axis of the stage.

    Attributes:
        node: CANopen node id.  travel: lowest and highest position [m].
        eds: the drive's EDS file, relative to the machine file; None: the virtual drive's.
        effects: further physical effects on this axis, in simulations.
        observer: whether the host's settling observer may correct its force offsets.
        rotary: whether it turns: rad for m, N m for N and kg m^2 for kg.
    """

    node: Annotated[StrictInt, Field(ge=1, le=127)]
    travel: LengthPair
    limits: Limits
    encoder: Encoder
    drive: Drive
    plant: Plant
    eds: Name | None = None
    homing: Homing = Homing()
    effects: tuple[Annotated[Effect, BeforeValidator(_effect)], ...] = ()
    observer: Literal["auto", "none"] = "auto"
    rotary: StrictBool = False


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
