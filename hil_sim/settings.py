"""Settings of the simulator: frozen, in SI units, checked when made.

Values and meaning: docs/reference/reference-stage.md.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Literal, Protocol

from annotated_types import Interval

from hil_sim.habits import Habits
from hil_sim.quirks import Quirks
from stagedata import F64, FrictionFigures, angular_unit
from stagedata.ranges import NotNegative, Positive, check_ranges

SUBSTEPS = 5
"""Plant steps per control tick of the reference (docs/reference/reference-stage.md)."""
MOST_SUBSTEPS = 1000
"""Most plant steps per control tick that a stiff plant on a slow tick may take."""
_LONGEST_COARSE_STEP = 2e-4
"""Longest plant step that follows oscillation and stick-slip [s]."""

_FARTHEST = 100.0
"""Most that a travel is widened by on each side [m]: the memory that tables over it take."""


def _require(condition: bool, name: str, reason: str) -> None:
    if not condition:
        raise ValueError(f"{name}: {reason}")


class PortWriter(Protocol):
    """A physical effect with its values: `hil_sim.effects.AppliedEffect`."""

    def apply(self, ports: Any) -> None:
        """Write the effect into the ports of its axis (`hil_sim.effects.ports.EffectPorts`)."""


@dataclass(frozen=True, slots=True)
class CascadeSettings:
    """A position loop (P) whose output is the setpoint of a velocity loop (PI).

    Attributes:
        position_gain: [1/s].
        velocity_gain: [N s/m].
        velocity_integral: [N/m].
        feedforward: share of the demand's velocity added to the setpoint, 0..1.
        span: ticks over which the encoder is differenced, 1 or 2.
    """

    position_gain: Positive
    velocity_gain: Positive
    velocity_integral: NotNegative = 0.0
    feedforward: NotNegative = 0.0
    span: Literal[1, 2] = 1

    def __post_init__(self) -> None:
        check_ranges(self)


@dataclass(frozen=True, slots=True)
class ControlSettings:
    """The drive's position loop, current loop and force scaling.

    Attributes:
        kp: [N/m].
        ki: [N/(m s)].
        kd: [N s/m]; of a cascade, kp, ki and kd are its equivalents.
        derivative_time: low-pass time constant of the derivative [s].
        current_bandwidth: of the first-order current loop [Hz].
        rated_force: unit of the CiA 402 force values [N].
        peak_force: limit of the controller's output [N].
        period: control tick Tc [s].
        cascade: replaces the PID; None: PID.
    """

    kp: Positive
    ki: NotNegative
    kd: NotNegative
    derivative_time: NotNegative
    current_bandwidth: Positive
    rated_force: Positive
    peak_force: Positive
    period: Positive
    cascade: CascadeSettings | None = None

    def __post_init__(self) -> None:
        check_ranges(self)


@dataclass(frozen=True, slots=True)
class AxisSettings:
    """One axis: plant, drive, encoder and the limits that the drive enforces.

    Attributes:
        name: as in the machine file.
        node: CANopen node id, 1..127.
        mass: moved mass [kg].
        friction: figures and law of its friction.
        control: of the drive.
        increment: encoder increment [m].
        noise: encoder noise, rms [m].
        travel: (lowest, highest) position [m].
        velocity, acceleration, jerk: limits [m/s, m/s^2, m/s^3].
        following_error: following error window [m].
        wander: rms of the Gauss-Markov factor on Fc, relative.
        correlation_time: of that factor [s].
        effects: physical effects beyond the plain model.
        unit, velocity_unit, acceleration_unit: one unit of the drive's integers on the bus [m, m/s,
            m/s^2]; jerk is in acceleration units per second.
        quirks: of the drive, on the bus; None: none.
        habits: in which the drive differs from CiA 301 and 402.
        encoder_on_load: it is on the part that the first effect `resonance` hangs on.
        rotary: it turns: rad for m, N m for N and kg m^2 for kg.
    """

    name: str
    node: Annotated[int, Interval(ge=1, le=127)]
    mass: Positive
    friction: FrictionFigures
    control: ControlSettings
    increment: Positive
    noise: NotNegative
    travel: tuple[float, float]
    velocity: Positive
    acceleration: Positive
    jerk: Positive
    following_error: Positive
    wander: NotNegative = 0.0
    correlation_time: Positive = 0.5
    effects: tuple[PortWriter, ...] = ()
    unit: Positive = 1e-9
    velocity_unit: Positive = 1e-9
    acceleration_unit: Positive = 1e-6
    quirks: Quirks | None = None
    habits: Habits = field(default_factory=Habits)
    encoder_on_load: bool = False
    rotary: bool = False

    def __post_init__(self) -> None:
        check_ranges(self)
        _require(self.travel[0] < self.travel[1], "travel", "must be [lowest, highest]")

    def reaching(self, positions: F64) -> AxisSettings:
        """The same with a travel that covers these positions, float64[K] [m].

        What goes with position goes on beyond the travel of a log that the limits came from.
        """
        low, high = float(positions.min()), float(positions.max())
        if self.travel[0] <= low and high <= self.travel[1]:
            return self
        most, least = self.travel[1] + _FARTHEST, self.travel[0] - _FARTHEST
        travel = max(min(self.travel[0], low), least), min(max(self.travel[1], high), most)
        return replace(self, travel=travel)

    def unit_of(self, unit: str) -> str:
        """The unit on this axis of what has `unit` on an axis that slides."""
        return angular_unit(unit) if self.rotary else unit


@dataclass(frozen=True, slots=True)
class StageSettings:
    """The whole stage.

    Attributes:
        sync_period: Ts [s], a whole number of control periods.
        axes: all with the same control period.
        start: when a simulation starts, on the clock of effects that fade with time [s].
    """

    sync_period: Positive
    axes: tuple[AxisSettings, ...]
    start: NotNegative = 0.0

    def __post_init__(self) -> None:
        check_ranges(self)
        _require(len(self.axes) > 0, "axes", "at least one")
        periods = {a.control.period for a in self.axes}
        _require(len(periods) == 1, "control_period", "must be the same on all axes")
        ratio = self.sync_period / self.control_period
        _require(
            abs(ratio - round(ratio)) < 1e-6 and round(ratio) >= 1,
            "control_period", "must divide sync_period",
        )  # fmt: skip

    def reaching(self, positions: F64) -> StageSettings:
        """The same with axes whose travels cover these positions, float64[K, axes] [m]."""
        axes = tuple(a.reaching(own) for a, own in zip(self.axes, positions.T, strict=True))
        return self if axes == self.axes else replace(self, axes=axes)

    @property
    def control_period(self) -> float:
        """Tc [s], the same on all axes."""
        return self.axes[0].control.period

    @property
    def ticks(self) -> int:
        """Control ticks per SYNC period, n = Ts/Tc."""
        return round(self.sync_period / self.control_period)

    @property
    def quick_substeps(self) -> int:
        """Fewest plant steps per control tick that are accurate: 1, or those of the reference."""
        return 1 if self.control_period <= _LONGEST_COARSE_STEP else SUBSTEPS
