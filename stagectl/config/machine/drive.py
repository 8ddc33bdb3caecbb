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
    """Proportional gain."""
    ki: Annotated[NotNegativeIntegralGain, Plausible(0.0, 1e18, "N/(m s)")]
    """Integral gain."""
    kd: Annotated[NotNegativeDamping, Plausible(0.0, 1e12, "N s/m")]
    """Derivative gain."""
    derivative_time: Annotated[NotNegativeTime, Plausible(0.0, 1e3, "s")]
    """Low-pass of the derivative."""


class Cascade(Section):
    """A P position loop over a PI velocity loop, instead of the PID."""

    position_gain: Annotated[PositiveNumber, Plausible(1e-9, 1e9, "1/s")]
    """Demanded velocity per following error [1/s]."""
    velocity_gain: Annotated[PositiveNumber, Plausible(1e-9, 1e12, "N s/m")]
    """Gain of the velocity loop [N s/m]."""
    velocity_integral: Annotated[NotNegativeNumber, Plausible(0.0, 1e15, "N/m")] = 0.0
    """Integral of the velocity loop [N/m]."""
    feedforward: Annotated[NotNegativeNumber, Field(le=1)] = 0.0
    """Share of the demanded velocity that is fed forward."""
    span: Literal[1, 2] = 1
    """Control ticks over which the encoder is differenced."""
    derivative_time: Annotated[NotNegativeTime, Plausible(0.0, 1e3, "s")] = 0.0
    """Low-pass of that velocity; 0: none."""


@dataclass(frozen=True, slots=True, config=STRICT)
class Quirks(hil_sim.quirks.Quirks):
    """What a simulated drive does on the bus that its papers do not say; its time has a unit."""

    position_filter: Annotated[NotNegativeTime, Field(le=1)] = 0.0
    """0x6064 is low-passed with this time constant; 0: not."""


class Drive(Section):
    """Force scaling [N], current loop [Hz], control tick Tc [s] and position loop of a drive."""

    rated_force: Annotated[PositiveForce, Plausible(1e-9, 1e9, "N")]
    """Unit of all CiA 402 force values, which are in 1/1000 of it."""
    peak_force: PositiveForce
    """Limit of the controller's output, ±; 1 to 32.767 times `rated_force`."""
    current_bandwidth: Annotated[PositiveFrequency, Plausible(1e-3, 1e9, "Hz")]
    """Of the first-order current loop."""
    control_period: Annotated[PositiveTime, Plausible(1e-6, 1.0, "s")]
    """The drive's control tick; divides `bus.sync_period`, the same on all axes."""
    position_unit: Annotated[PositiveLength, Plausible(1e-15, 1.0, "m")] = _USUAL_UNIT
    """One unit of the drive's positions on the bus; on an axis that turns, if not given, the next
    power of ten that travel and velocity fit in. Must equal the drive's factor group (0x608F,
    0x6091, 0x6092) times `encoder.increment`, and 0x60A8."""
    velocity_unit: Annotated[PositiveVelocity | None, Plausible(1e-15, 1e3, "m/s")] = None
    """The same for velocities; if not given, one position unit per second. Must equal what the
    drive states in 0x6096 or 0x60A9; a drive that states neither is powered only where this key is
    written."""
    lead: Annotated[PositiveLength | None, Plausible(1e-9, 1e3, "m")] = None
    """Travel per revolution of a rotary drive on a screw or belt, on a linear axis: rpm, turns and
    degrees in 0x60A8 to 0x60AA become lengths by it. The units above are still written; the refusal
    of a wrong one says which value the drive means."""
    rated_force_unit: Annotated[PositiveForce, Plausible(1e-12, 1e6, "N")] = 1e-3
    """One count of 0x6076. For a drive that counts µNm: 1e-6; mA: the motor constant times 1e-3.
    0x6076 may differ from `rated_force` by 0.1 %, with a note."""
    profile: Annotated[str | None, Field(min_length=1, max_length=200)] = None
    """The drive's [profile](../how-to/add-a-drive.md): a family, or a file relative to this one. It
    fills the keys of this section that are left open, and `run` says which. Without it: the profile
    with the identity that the EDS states, if there is one. In a simulation the virtual drive
    differs from the standard as that family does."""
    modes: Annotated[tuple[ModeName, ...] | None, Field(min_length=1)] = None
    """The modes that the drive offers, where its 0x6502 is missing or wrong; without it: what
    0x6502 says."""
    warnings: tuple[Annotated[int, Field(ge=0x100, le=0xFFFF)], ...] = ()
    """EMCY error codes that stop the axes though the error register is 0. All others with error
    register 0 are warnings: shown at the end of the run and recorded."""
    heartbeat: Annotated[PositiveTime, Field(ge=0.01, le=1.0)] = 0.1
    """Period of the drive's heartbeat (0x1017). A drive counts as silent after 3.5 of them; for so
    long an axis may go on unnoticed."""
    options: OptionCodes = OptionCodes()
    """How the drive stops."""
    unwatched_host: Literal["refuse", "accept"] = "refuse"
    """Whether to power a drive that would carry on without its host, because it has no 0x1016 or
    keeps 0 (no action) in 0x6007. If accepted, this is reported before power is applied, in every
    run's notices and in its recording."""
    acceleration_unit: Annotated[PositiveAcceleration | None, Plausible(1e-15, 1e6, "m/s^2")] = None
    """The same for accelerations, with 0x6097 and 0x60AA; if not given, 1e-6 m/s²."""
    boot_timeout: Annotated[PositiveTime, Plausible(1e-3, 600.0, "s")] = 2.0
    """Longest time to the drive's boot-up message."""
    enable_timeout: Annotated[PositiveTime, Plausible(1e-3, 600.0, "s")] = 2.0
    """Longest time to OPERATION ENABLED; raise it for a drive that then finds its commutation angle
    (phase finding)."""
    revision: Annotated[int, Field(ge=0, le=65_535)] | None = None
    """Major revision number (upper half of 0x1018:03) that the drive must have; without it: that of
    the EDS."""
    pid: Pid | None = None
    """Position loop."""
    cascade: Cascade | None = None
    """Instead of `pid`: a position loop (P) over a velocity loop (PI), to simulate other makers'
    stages."""
    quirks: Quirks | None = None
    """Of a simulated drive: what it does on the bus and its papers do not say. The host does not
    look at it."""

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
