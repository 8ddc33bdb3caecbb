"""The models of an axis' drive in a machine file: its units, loops and reactions."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

import hil_sim.quirks
from drivers.settings import OptionCodes
from stagectl.config.machine.plausible import Plausible
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
from stagectl.config.parsing.validation import STRICT, Section

ModeName = Literal["pp", "pv", "hm", "csp", "csv", "cst"]
POSITION_RANGE = 2**31
"""CiA 402 positions and velocities are INTEGER32: fewer units than this."""


NO_BUS = "none"
"""Interface of the bus in the machine file of a log."""
_USUAL_UNIT, _COARSEST_UNIT = 1e-9, 1e-3
"""Position units that are chosen where none is stated [m]."""


def position_unit_for(most: float) -> float:
    """The finest power of ten, from 1 nm on, in which positions up to `most` [m] are INTEGER32."""
    unit = _USUAL_UNIT
    while most >= POSITION_RANGE * unit and unit < _COARSEST_UNIT:
        unit *= 10.0
    return unit


class Pid(Section):
    """Position loop: kp [N/m], ki [N/(m s)], kd [N s/m], derivative's low-pass [s]."""

    kp: Annotated[PositiveStiffness, Plausible(1e-9, 1e15, "N/m")]
    ki: Annotated[NotNegativeIntegralGain, Plausible(0.0, 1e18, "N/(m s)")]
    kd: Annotated[NotNegativeDamping, Plausible(0.0, 1e12, "N s/m")]
    derivative_time: Annotated[NotNegativeTime, Plausible(0.0, 1e3, "s")]


class Cascade(Section):
    """A P position loop over a PI velocity loop, instead of the PID.

    Attributes:
        position_gain: [1/s].  velocity_gain: [N s/m].  velocity_integral: [N/m].
        feedforward: share of the setpoint velocity that is added.
        span: control ticks over which the encoder is differenced.
        derivative_time: time constant of the low-pass after that [s].
    """

    position_gain: Annotated[PositiveNumber, Plausible(1e-9, 1e9, "1/s")]
    velocity_gain: Annotated[PositiveNumber, Plausible(1e-9, 1e12, "N s/m")]
    velocity_integral: Annotated[NotNegativeNumber, Plausible(0.0, 1e15, "N/m")] = 0.0
    feedforward: Annotated[NotNegativeNumber, Field(le=1)] = 0.0
    span: Literal[1, 2] = 1
    derivative_time: Annotated[NotNegativeTime, Plausible(0.0, 1e3, "s")] = 0.0


@dataclass(frozen=True, slots=True, config=STRICT)
class Quirks(hil_sim.quirks.Quirks):
    """What a simulated drive does on the bus that its papers do not say; its time has a unit."""

    position_filter: Annotated[NotNegativeTime, Field(le=1)] = 0.0


class Drive(Section):
    """Force scaling [N], current loop [Hz], control tick Tc [s] and position loop of a drive.

    Attributes:
        position_unit, velocity_unit, acceleration_unit: of its integers on the bus [m, m/s,
            m/s^2]; velocity_unit and acceleration_unit None: the drive has to say them.
        lead: travel per revolution [m] of a drive that counts angles on a linear axis.
        rated_force_unit: one count of its 0x6076 [N].
        profile: of its family, by name, or a file relative to the machine file; None: by the
            identity in its EDS, where a profile has that.
        modes: that it offers, instead of what its 0x6502 says; None: as that says.
        warnings: EMCY error codes that stop the axes though the error register is 0.
        heartbeat: period of its heartbeat [s].
        unwatched_host: whether to power a drive that keeps moving when its host is gone.
        boot_timeout: for its boot-up message [s].
        enable_timeout: for OPERATION ENABLED, phase finding included [s].
        revision: required major revision number; None: that of the EDS.
        pid: the position loop; None if there is a cascade.
        cascade: the loops instead of a PID.
        quirks: of a simulated drive; the host does not look at them.
    """

    rated_force: Annotated[PositiveForce, Plausible(1e-9, 1e9, "N")]
    peak_force: PositiveForce
    current_bandwidth: Annotated[PositiveFrequency, Plausible(1e-3, 1e9, "Hz")]
    control_period: Annotated[PositiveTime, Plausible(1e-6, 1.0, "s")]
    position_unit: Annotated[PositiveLength, Plausible(1e-15, 1.0, "m")] = _USUAL_UNIT
    velocity_unit: Annotated[PositiveVelocity | None, Plausible(1e-15, 1e3, "m/s")] = None
    lead: Annotated[PositiveLength | None, Plausible(1e-9, 1e3, "m")] = None
    rated_force_unit: Annotated[PositiveForce, Plausible(1e-12, 1e6, "N")] = 1e-3
    profile: Annotated[str | None, Field(min_length=1, max_length=200)] = None
    modes: Annotated[tuple[ModeName, ...] | None, Field(min_length=1)] = None
    warnings: tuple[Annotated[int, Field(ge=0x100, le=0xFFFF)], ...] = ()
    heartbeat: Annotated[PositiveTime, Field(ge=0.01, le=1.0)] = 0.1
    options: OptionCodes = OptionCodes()
    unwatched_host: Literal["refuse", "accept"] = "refuse"
    acceleration_unit: Annotated[PositiveAcceleration | None, Plausible(1e-15, 1e6, "m/s^2")] = None
    boot_timeout: Annotated[PositiveTime, Plausible(1e-3, 600.0, "s")] = 2.0
    enable_timeout: Annotated[PositiveTime, Plausible(1e-3, 600.0, "s")] = 2.0
    revision: Annotated[int, Field(ge=0, le=65_535)] | None = None
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
