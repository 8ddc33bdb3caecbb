"""The models of an axis' drive in a machine file: its units, loops and reactions."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, StrictInt

from stagectl.config.parsing.units import (
    NotNegativeDamping,
    NotNegativeIntegralGain,
    NotNegativeNumber,
    NotNegativeTime,
    PositiveAcceleration,
    PositiveForce,
    PositiveFrequency,
    PositiveLength,
    PositiveNumber,
    PositiveStiffness,
    PositiveTime,
    PositiveVelocity,
)
from stagectl.config.parsing.validation import Section


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


class Quirks(Section):
    """What a simulated drive does on the bus that its papers do not say (`hil_sim.quirks`).

    Attributes:
        offset_delay: SYNCs by which 0x60B2 acts too late.  offset_sign: -1: the other way.
        offset_step: steps in which it acts, over the rated force.
        position_delay: SYNCs by which 0x6064 is too old.  position_filter: low-pass on it [s].
    """

    offset_delay: Annotated[StrictInt, Field(ge=0, le=100)] = 0
    offset_sign: Literal[1, -1] = 1
    offset_step: Annotated[NotNegativeNumber, Field(le=1)] = 0.0
    position_delay: Annotated[StrictInt, Field(ge=0, le=100)] = 0
    position_filter: Annotated[NotNegativeTime, Field(le=1)] = 0.0


class Drive(Section):
    """Force scaling [N], current loop [Hz], control tick Tc [s] and position loop of a drive.

    Attributes:
        position_unit, velocity_unit, acceleration_unit: of its integers on the bus [m, m/s,
            m/s^2]; velocity_unit and acceleration_unit None: the drive has to say them.
        unwatched_host: whether to power a drive that keeps moving when its host is gone.
        boot_timeout: for its boot-up message [s].
        enable_timeout: for OPERATION ENABLED, phase finding included [s].
        revision: required major revision number; None: that of the EDS.
        pid: the position loop; None if there is a cascade.
        cascade: the loops instead of a PID.
        quirks: of a simulated drive; the host does not look at them.
    """

    rated_force: PositiveForce
    peak_force: PositiveForce
    current_bandwidth: PositiveFrequency
    control_period: PositiveTime
    position_unit: PositiveLength = 1e-9
    velocity_unit: PositiveVelocity | None = None
    options: OptionCodes = OptionCodes()
    unwatched_host: Literal["refuse", "accept"] = "refuse"
    acceleration_unit: PositiveAcceleration | None = None
    boot_timeout: PositiveTime = 2.0
    enable_timeout: PositiveTime = 2.0
    revision: Annotated[StrictInt, Field(ge=0, le=65_535)] | None = None
    pid: Pid | None = None
    cascade: Cascade | None = None
    quirks: Quirks | None = None

    @property
    def force_unit(self) -> float:
        """One count of force on the bus: 1/1000 of the rated force [N]."""
        return self.rated_force / 1000.0

    @property
    def velocity_count(self) -> float:
        """One count of velocity on the bus [m/s]; by default one position unit per second."""
        return self.velocity_unit or self.position_unit

    @property
    def acceleration_count(self) -> float:
        """One count of acceleration on the bus [m/s^2]; by default 1 um/s^2."""
        return self.acceleration_unit or 1e-6
