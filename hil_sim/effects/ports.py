"""The ports of one axis: where effects enter the plant, filled in plain numpy.

The plant is one compiled kernel that knows ports, not effects (docs/decisions). Before a simulation
each effect writes into the ports of its axis; in a port written by several, factors multiply and
forces add. From the controller's output to the force on the carriage the order is dead time,
current loop (whose output is measured), loss, force constant, saturation, gain over position; then

    m dv/dt = F_motor - F_f - F_d,   F_d the sum of all disturbance forces.

Tables over position are interpolated by cubics, others linearly; all are held at their ends. Tables
over position and everything over time are evaluated in the middle of each control tick and
linearised within it, which is accurate below 1 m/s for structure of a millimetre and longer.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from hil_sim.settings import MOST_SUBSTEPS, AxisSettings
from stagedata import F64

POSITION_STEP = 1e-4
"""Node distance of tables over position [m]."""
POSITION_MARGIN = 0.01
"""Margin of tables over position beyond the travel [m]."""
VELOCITY_NODES = 1500
"""Nodes of tables over velocity or motor force on each side of zero, densest near zero."""
MOST_DELAY = 0.05
"""Longest dead time [s]."""
LIVE_DURATION = 600.0
"""Duration of tables over time if the stage runs without end [s]."""
_STABLE = 0.5
"""Limit of damping x step / mass and of stiffness x step^2 / mass."""


class Oscillator(NamedTuple):
    """A mass on a spring and damper: mass ratio, frequency [Hz], damping ratio."""

    mass_ratio: float
    frequency: float
    damping: float


class Field(NamedTuple):
    """A factor over the positions of this axis and another one.

    Attributes:
        own: positions of this axis at the nodes, evenly spaced, float64[n] [m].
        other: positions of the other axis, float64[m] [m].
        values: at the nodes, float64[n, m].
    """

    own: F64
    other: F64
    values: F64


class EffectPorts:
    """The ports of one axis.

    Args:
        axis: nominal settings.
        sync_period: Ts [s], node distance of tables over time.
        duration: of the simulation [s]; None: without end.
        start: of the simulation, on the clock of effects that fade with time [s].

    Attributes:
        axis: as above.
        mass: moved mass m [kg].
        viscous: sigma_v [N s/m].
        stiffness: sigma0, presliding [N/m].
        static_ratio: alpha.
        coulomb: factor on Fc; the relaxation rate C/Fc stays.
        coulomb_forward, coulomb_backward: factors on Fc at v > 0 and v < 0.
        current_bandwidth: of the current loop [Hz].
        delay: dead time between the controller's output and the current loop [s].
        force_constant: factor from measured force to motor force.
        saturation: motor force is this times tanh(F / this) [N]; inf: none.
        force: constant disturbance [N].
        spring: disturbance per position [N/m].
        load_friction: Coulomb force per force transmitted to the load.
        motor_share: part of the mass that is on the near side of the transmission.
    """

    def __init__(
        self,
        axis: AxisSettings,
        sync_period: float,
        duration: float | None,
        start: float = 0.0,
    ) -> None:
        self.axis = axis
        self._start = start
        self.mass = axis.mass
        self.viscous = axis.friction.viscous
        self.stiffness = axis.friction.stiffness
        self.static_ratio = axis.friction.static_ratio
        self.coulomb = 1.0
        self.coulomb_forward = 1.0
        self.coulomb_backward = 1.0
        self.current_bandwidth = axis.control.current_bandwidth
        self.delay = 0.0
        self.force_constant = 1.0
        self.saturation = float("inf")
        self.force = 0.0
        self.spring = 0.0
        self.load_friction = 0.0
        self.motor_share = 0.0
        self.position_force: F64 | None = None
        self.position_coulomb: F64 | None = None
        self.position_gain: F64 | None = None
        self.misreading: F64 | None = None
        self.velocity_force: F64 | None = None
        self.motor_loss: F64 | None = None
        self.time_force: F64 | None = None
        self.time_coulomb: F64 | None = None
        self.harmonics: list[tuple[float, float, float]] = []
        self.decays: list[tuple[float, float]] = []
        self.hysteresis: list[tuple[float, float]] = []
        self.lags: list[tuple[float, float]] = []
        self.hanging: list[Oscillator] = []
        self.bases: list[Oscillator] = []
        self.fields: list[Field] = []
        self.coupled_mass = 0.0
        self._sync_period = sync_period
        self._duration = duration

    @classmethod
    def filled(
        cls, axis: AxisSettings, sync_period: float, duration: float | None, start: float = 0.0
    ) -> EffectPorts:
        """The ports of an axis as all its effects fill them; arguments as above.

        Raises:
            ValueError: naming effect and key.
        """
        ports = cls(axis, sync_period, duration, start)
        for effect in axis.effects:
            effect.apply(ports)
        return ports

    @property
    def involves_another(self) -> bool:
        """Whether the other axis takes part: this one cannot be simulated alone."""
        return bool(self.coupled_mass or self.fields)

    # Nodes of tables -------------------------------------------------------------------------

    @property
    def positions(self) -> F64:
        """Nodes of tables over position: the travel and a margin, float64[n] [m]."""
        low, high = self.axis.travel
        count = int(np.ceil((high - low + 2.0 * POSITION_MARGIN) / POSITION_STEP)) + 1
        return np.asarray(low - POSITION_MARGIN + POSITION_STEP * np.arange(count))

    @property
    def velocities(self) -> F64:
        """Nodes of tables over velocity, up to 1.5 times the limit, float64[n] [m/s]."""
        root = np.arange(-VELOCITY_NODES, VELOCITY_NODES + 1) / VELOCITY_NODES
        return np.asarray(1.5 * self.axis.velocity * root * np.abs(root))

    @property
    def motor_forces(self) -> F64:
        """Nodes of tables over the measured force, up to 1.5 times its peak, float64[n] [N]."""
        root = np.arange(-VELOCITY_NODES, VELOCITY_NODES + 1) / VELOCITY_NODES
        return np.asarray(1.5 * self.axis.control.peak_force * root * np.abs(root))

    @property
    def times(self) -> F64:
        """Nodes of tables over time: the SYNCs of the simulation, float64[n] [s]."""
        duration = LIVE_DURATION if self._duration is None else self._duration
        count = max(int(np.ceil(duration / self._sync_period)), 1) + 1
        return np.asarray(self._sync_period * np.arange(count))

    # Forces against the motion of the carriage ------------------------------------------------

    def add_position_force(self, force: F64) -> None:
        """Disturbance force at each of `positions` [N]."""
        self.position_force = _sum(self.position_force, force, self.positions)

    def add_velocity_force(self, force: F64) -> None:
        """Disturbance force at each of `velocities` [N], positive against motion at v > 0."""
        self.velocity_force = _sum(self.velocity_force, force, self.velocities)

    def lose_motor_force(self, loss: F64) -> None:
        """What of each of `motor_forces` does not reach the carriage [N]."""
        self.motor_loss = _sum(self.motor_loss, loss, self.motor_forces)

    def lag_motor_force(self, width: float, loss: float) -> None:
        """Motor force loss * s is lost [N], ds = dF / width [N] held within ± 1; initially 0."""
        self.lags.append((width, loss))

    def add_time_force(self, force: F64) -> None:
        """Disturbance force at each of `times` [N]."""
        self.time_force = _sum(self.time_force, force, self.times)

    def add_harmonic(self, amplitude: float, frequency: float, phase: float) -> None:
        """Disturbance force amplitude sin(2 pi frequency t + phase) [N, Hz, rad]."""
        self.harmonics.append((amplitude, frequency, phase))

    def add_hysteresis(self, force: float, stiffness: float) -> None:
        """Disturbance force H, dH = stiffness dx, held within ± force [N, N/m]; initially 0."""
        self.hysteresis.append((force, stiffness))

    def couple(self, mass: float) -> None:
        """Disturbance force: mass [kg] times the acceleration of the other axis."""
        self.coupled_mass += mass

    def add_misreading(self, error: F64) -> None:
        """Error of the encoder reading at each of `positions` [m]."""
        self.misreading = _sum(self.misreading, error, self.positions)

    # Factors ---------------------------------------------------------------------------------

    def scale_position_coulomb(self, factor: F64) -> None:
        """Factor on Fc at each of `positions`."""
        self.position_coulomb = _product(self.position_coulomb, factor, self.positions)

    def scale_position_gain(self, factor: F64) -> None:
        """Factor on the motor force at each of `positions`, after saturation."""
        self.position_gain = _product(self.position_gain, factor, self.positions)

    def scale_time_coulomb(self, factor: F64) -> None:
        """Factor on Fc at each of `times`."""
        self.time_coulomb = _product(self.time_coulomb, factor, self.times)

    def decay_coulomb(self, amplitude: float, time_constant: float) -> None:
        """Factor on Fc 1 + amplitude exp(-t/time_constant) [s]; t is 0 on the stage's clock."""
        left = math.exp(-self._start / time_constant)
        self.decays.append((amplitude * left, time_constant))

    def press(self, ratio: float, motor_share: float) -> None:
        """Coulomb force `ratio` times that transmitted to the load, whatever its sign.

        Args:
            ratio: those of several effects add up.
            motor_share: part of the mass on the near side of the transmission, 0..1; that of the
                last effect counts.
        """
        self.load_friction += ratio
        self.motor_share = motor_share

    def scale_field_coulomb(self, own: F64, other: F64, factor: F64) -> None:
        """Factor on Fc over the positions of this axis and the other one.

        Args:
            own: positions of this axis at the nodes, evenly spaced, float64[n] [m].
            other: positions of the other axis, float64[m] [m].
            factor: at the nodes, float64[n, m]; interpolated linearly in both.

        Raises:
            ValueError: the shapes do not match.
        """
        if factor.shape != (len(own), len(other)) or min(factor.shape) < 2:
            raise ValueError(f"field has shape {factor.shape}, nodes are {len(own)} x {len(other)}")
        self.fields.append(Field(own, other, factor))

    # Linear dynamics -------------------------------------------------------------------------

    def hang(self, mass_ratio: float, frequency: float, damping: float) -> None:
        """Attach a mass to the rest of the carriage by a spring and damper.

        Args:
            mass_ratio: attached mass over moved mass m, 0..1.
            frequency: of the free-free mode [Hz].
            damping: damping ratio of that mode.
        """
        self.hanging.append(Oscillator(mass_ratio, frequency, damping))

    def mount(self, mass_ratio: float, frequency: float, damping: float) -> None:
        """Put the axis on a base that takes the reaction of its force.

        Args:
            mass_ratio: moved mass m over mass of the base.
            frequency: of the base on its isolators [Hz].
            damping: damping ratio of that mode.
        """
        self.bases.append(Oscillator(mass_ratio, frequency, damping))

    def standing_force(self, position: float) -> float:
        """The disturbance force [N] at rest at this position [m], without what depends on time."""
        force = self.force + self.spring * position
        if self.position_force is not None:
            force += float(np.interp(position, self.positions, self.position_force))
        return force

    def standing_level(self, position: float, other: float) -> float:
        """The factor on Fc at t = 0 and at rest, without that of the direction.

        Args:
            position: of this axis [m].
            other: of the other axis [m].
        """
        level = self.coulomb
        if self.position_coulomb is not None:
            level *= float(np.interp(position, self.positions, self.position_coulomb))
        if self.time_coulomb is not None:
            level *= float(self.time_coulomb[0])
        for amplitude, _ in self.decays:
            level *= 1.0 + amplitude
        for field in self.fields:
            across = [np.interp(other, field.other, row) for row in field.values]
            level *= float(np.interp(position, field.own, across))
        return level

    def misread(self, position: float) -> float:
        """Error of the encoder reading at this position [m]."""
        if self.misreading is None:
            return 0.0
        return float(np.interp(position, self.positions, self.misreading))

    def fewest_substeps(self) -> int:
        """Fewest plant steps per control tick with which the integration is stable."""
        return max(count for count, _ in self._needed_substeps())

    def _needed_substeps(self) -> tuple[tuple[int, str], ...]:
        """Plant steps per control tick that damping and springs need, each with its figure."""
        period, own = self.axis.control.period, self.axis.unit_of
        carriage = self.mass * (1.0 - sum(h.mass_ratio for h in self.hanging))
        stiffness = self.stiffness + abs(self.spring) + sum(k for _, k in self.hysteresis)
        damping = self.viscous * period / carriage / _STABLE
        bending = period * math.sqrt(stiffness / carriage / _STABLE)
        on = f"on {carriage:g} {own('kg')}"
        return (
            (math.ceil(damping), f"friction of {self.viscous:g} {own('N s/m')} {on}"),
            (math.ceil(bending), f"springs of {stiffness:g} {own('N/m')} {on}"),
        )

    def check(self, axes: int) -> None:
        """Check that the plant can be simulated with its effects.

        Args:
            axes: number of those of the stage.

        Raises:
            ValueError: naming the cause.
        """
        hanging = sum(h.mass_ratio for h in self.hanging)
        if self.mass <= 0.0:
            raise ValueError(f"effects leave a mass of {self.mass:g} {self.axis.unit_of('kg')}")
        if hanging >= 1.0:
            raise ValueError(f"effects hang {hanging:g} of the mass from the carriage")
        for count, figure in self._needed_substeps():
            if count > MOST_SUBSTEPS:
                raise ValueError(
                    f"{figure} cannot be simulated in {MOST_SUBSTEPS} steps per control_period"
                )
        if self.static_ratio <= -1.0:
            raise ValueError(f"effects leave a static_ratio of {self.static_ratio:g}")
        if not 0.0 <= self.delay <= MOST_DELAY:
            raise ValueError(f"effects leave a dead time of {self.delay:g} s")
        if self.involves_another and axes != 2:
            raise ValueError("an effect that involves the other axis needs a stage of two")


def _fits(values: F64, nodes: F64) -> F64:
    values = np.asarray(values, dtype=np.float64)
    if values.shape != nodes.shape:
        raise ValueError(f"table has shape {values.shape}, its nodes {nodes.shape}")
    if not np.isfinite(values).all():
        raise ValueError("table has values that are not finite")
    return values


def _sum(table: F64 | None, values: F64, nodes: F64) -> F64:
    return (0.0 if table is None else table) + _fits(values, nodes)


def _product(table: F64 | None, values: F64, nodes: F64) -> F64:
    return (1.0 if table is None else table) * _fits(values, nodes)
