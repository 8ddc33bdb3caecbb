"""Effects that are not in the library: for the blind check only.

Kin belong to a family of the library but depart from its equation: the right answer is the
family's name, and that something is left. Outsiders belong to none: the right answer is that no
cause is known. Neither is offered to machine files or to a diagnosis.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from hil_sim.effects.effect import Effect, Parameter
from hil_sim.effects.ports import EffectPorts

F64 = NDArray[np.float64]
Values = Mapping[str, float]

_TURN = 2.0 * np.pi
_PHASE = Parameter("phase", "rad", "at 0", role="phase")
_CENTER = Parameter("center", "m", "where", role="place")


class Departing(Effect):
    """An effect of the blind check.

    Attributes:
        kin: the effect of the library whose family it belongs to; "" for none.
    """

    group = "force"
    equation = "for checks"
    enters = "Checks only."
    remedy = "None."
    searched = False
    kin = ""


class CoggingHarmonics(Departing):
    """Cogging of a real magnet track: second and third harmonic beside the first."""

    name = "cogging_harmonics"
    kin = "cogging"
    parameters = (
        Parameter("amplitude", "N", "of the first harmonic", (0.5, 2.0)),
        Parameter("pitch", "m", "period", (24e-3, 40e-3), role="shape", log=True),
        _PHASE,
        Parameter("second", "", "over the first", (0.15, 0.5), role="shape"),
        Parameter("second_phase", "rad", "of the second", role="phase"),
        Parameter("third", "", "over the first", (0.0, 0.3), role="shape"),
    )

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        turn = _TURN * ports.positions / parameters["pitch"]
        wave = np.sin(turn + parameters["phase"])
        wave += parameters["second"] * np.sin(2.0 * turn + parameters["second_phase"])
        wave += parameters["third"] * np.sin(3.0 * turn)
        ports.add_position_force(parameters["amplitude"] * wave)


class EdgedPatch(Departing):
    """A stretch with more friction and edges to it: a smear, a wiper's mark."""

    name = "edged_patch"
    group = "friction"
    kin = "friction_position"
    parameters = (
        Parameter("amplitude", "", "surplus of Fc", (0.2, 0.6)),
        _CENTER,
        Parameter("half_width", "m", "of the stretch", (6e-3, 30e-3), role="shape", log=True),
        Parameter("edge", "m", "width of its edges", (0.3e-3, 3e-3), role="shape", log=True),
    )

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        beyond = np.abs(ports.positions - parameters["center"]) - parameters["half_width"]
        inside = 0.5 * (1.0 - np.tanh(beyond / parameters["edge"]))
        ports.scale_position_coulomb(1.0 + parameters["amplitude"] * inside)


class TentProfile(Departing):
    """Friction that rises to one place in straight lines: a rail that is bent there."""

    name = "tent_profile"
    group = "friction"
    kin = "friction_position"
    parameters = (
        Parameter("amplitude", "", "surplus of Fc", (0.25, 0.6)),
        _CENTER,
        Parameter("half_width", "m", "of its base", (10e-3, 50e-3), role="shape", log=True),
    )

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        away = np.abs(ports.positions - parameters["center"]) / parameters["half_width"]
        ports.scale_position_coulomb(1.0 + parameters["amplitude"] * np.maximum(1.0 - away, 0.0))


class TwoStageWarmUp(Departing):
    """Warm-up with two time constants: the film within seconds, the grease within minutes."""

    name = "two_stage_warm_up"
    group = "friction"
    kin = "thermal_drift"
    parameters = (
        Parameter("amplitude", "", "surplus of Fc at the start", (0.15, 0.4)),
        Parameter("fast", "s", "first time constant", (1.0, 4.0), role="shape", log=True),
        Parameter("slow", "s", "second time constant", (10.0, 100.0), role="shape", log=True),
        Parameter("share", "", "of the first", (0.3, 0.7), role="shape"),
    )

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        share = parameters["share"]
        ports.decay_coulomb(parameters["amplitude"] * share, parameters["fast"])
        ports.decay_coulomb(parameters["amplitude"] * (1.0 - share), parameters["slow"])


class HyperbolicWarmUp(Departing):
    """Friction that falls as 1/(1 + t/time): fast at first, and never quite done."""

    name = "hyperbolic_warm_up"
    group = "friction"
    kin = "thermal_drift"
    parameters = (
        Parameter("amplitude", "", "surplus of Fc at the start", (0.15, 0.4)),
        Parameter("time", "s", "until half is gone", (1.0, 20.0), role="shape", log=True),
    )

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        falling = 1.0 / (1.0 + ports.times / parameters["time"])
        ports.scale_time_coulomb(1.0 + parameters["amplitude"] * falling)


class RippleHarmonics(Departing):
    """Force ripple with a second harmonic."""

    name = "ripple_harmonics"
    group = "motor"
    kin = "force_ripple"
    parameters = (
        Parameter("ratio", "", "of the first harmonic", (0.03, 0.08)),
        Parameter("pitch", "m", "period", (8e-3, 14e-3), role="shape", log=True),
        _PHASE,
        Parameter("second", "", "over the first", (0.15, 0.5), role="shape"),
        Parameter("second_phase", "rad", "of the second", role="phase"),
    )

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        turn = _TURN * ports.positions / parameters["pitch"]
        wave = np.sin(turn + parameters["phase"])
        wave += parameters["second"] * np.sin(2.0 * turn + parameters["second_phase"])
        ports.scale_position_gain(1.0 + parameters["ratio"] * wave)


class RoundedCable(Departing):
    """A cable whose parts begin to slide one after another: hysteresis with rounded corners."""

    name = "rounded_cable"
    kin = "cable_hysteresis"
    parameters = (
        Parameter("force", "N", "at which all of it slides", (0.6, 1.6), least=0.0),
        Parameter("stiffness", "N/m", "before any slides", (1e3, 5e3), role="shape", log=True),
    )

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        stiffness = parameters["stiffness"] / 3.0
        for share in (1.0, 2.0, 3.0):
            ports.add_hysteresis(parameters["force"] * share / 6.0, stiffness)


class FloorHarmonics(Departing):
    """Floor vibration with its second harmonic: an unbalance that also knocks."""

    name = "floor_harmonics"
    kin = "floor_vibration"
    parameters = (
        Parameter("amplitude", "N", "of the first harmonic", (0.3, 0.7)),
        Parameter("frequency", "Hz", "of the first", (12.0, 60.0), role="shape", log=True),
        _PHASE,
        Parameter("second", "", "over the first", (0.2, 0.6), role="shape"),
        Parameter("second_phase", "rad", "of the second", role="phase"),
    )

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        amplitude, frequency = parameters["amplitude"], parameters["frequency"]
        ports.add_harmonic(amplitude, frequency, parameters["phase"])
        ports.add_harmonic(
            amplitude * parameters["second"], 2.0 * frequency, parameters["second_phase"]
        )


class QuadraticDrag(Departing):
    """Air that a wide table or a bellows pushes aside."""

    name = "quadratic_drag"
    parameters = (Parameter("drag", "N s^2/m^2", "F_d += drag v |v|", (20.0, 120.0), log=True),)

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        v = ports.velocities
        ports.add_velocity_force(parameters["drag"] * v * np.abs(v))


class CubicCable(Departing):
    """A hose that stiffens as it is bent: F_d += force (x/50 mm)^3."""

    name = "cubic_cable"
    parameters = (Parameter("force", "N", "50 mm off the middle", (0.8, 4.0), log=True),)

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        ports.add_position_force(parameters["force"] * (ports.positions / 0.05) ** 3)


class WanderingForce(Departing):
    """A force that walks at random: a draught, a hose that creeps, a drifting sensor."""

    name = "wandering_force"
    parameters = (
        Parameter("rate", "N/s^0.5", "rms after a second", (0.2, 1.0), log=True),
        Parameter("seed", "", "which walk", (0.0, 1e6), role="shape"),
    )

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        times = ports.times
        steps = np.random.default_rng(int(parameters["seed"])).standard_normal(len(times))
        walk = np.cumsum(steps) * np.sqrt(times[1] - times[0])
        ports.add_time_force(parameters["rate"] * (walk - walk[0]))


class ForceBump(Departing):
    """A push at one place, whatever the direction: a magnet beside the way."""

    name = "force_bump"
    parameters = (
        Parameter("force", "N", "at the place", (0.8, 3.0), signed=True),
        _CENTER,
        Parameter("width", "m", "standard deviation", (3e-3, 12e-3), role="shape", log=True),
    )

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        away = (ports.positions - parameters["center"]) / parameters["width"]
        ports.add_position_force(parameters["force"] * np.exp(-0.5 * away**2))


class FrictionStep(Departing):
    """The Coulomb level jumps at one moment: dirt drawn in, a wiper that snaps over."""

    name = "friction_step"
    group = "friction"
    parameters = (
        Parameter("ratio", "", "change of Fc", (0.1, 0.4), signed=True),
        Parameter("time", "s", "of the jump", (2.5, 7.5), role="shape"),
    )

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        ports.scale_time_coulomb(1.0 + parameters["ratio"] * (ports.times >= parameters["time"]))


class PeriodicFriction(Departing):
    """Friction in waves over position: balls of the guide, joints of the rail."""

    name = "periodic_friction"
    group = "friction"
    parameters = (
        Parameter("amplitude", "", "of the factor on Fc", (0.1, 0.4)),
        Parameter("pitch", "m", "period", (6e-3, 25e-3), role="shape", log=True),
        _PHASE,
    )

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        turn = _TURN * ports.positions / parameters["pitch"] + parameters["phase"]
        ports.scale_position_coulomb(1.0 + parameters["amplitude"] * np.sin(turn))


class ForceStep(Departing):
    """A constant pull that sets in at one moment: a cable that catches and stays caught."""

    name = "force_step"
    parameters = (
        Parameter("force", "N", "from then on", (0.6, 2.0), signed=True),
        Parameter("time", "s", "of the jump", (2.5, 7.5), role="shape"),
    )

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        ports.add_time_force(parameters["force"] * (ports.times >= parameters["time"]))


class LooseFit(Departing):
    """Play with a pull: a force that turns over across a wide stretch after each reversal.

    As a backlash between carriage and a spring-loaded cover: an elasto-plastic element so soft
    that it takes millimetres of travel to slide.
    """

    name = "loose_fit"
    parameters = (
        Parameter("force", "N", "on either side", (0.8, 2.0)),
        Parameter("play", "m", "from one side to the other", (4e-3, 20e-3), role="shape", log=True),
    )

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        force = parameters["force"]
        ports.add_hysteresis(force, 2.0 * force / parameters["play"])


class RootDrag(Departing):
    """A lubricant that thins under shear: resistance with the root of the speed."""

    name = "root_drag"
    parameters = (Parameter("drag", "N (s/m)^0.5", "F_d", (1.5, 6.0), log=True),)

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        v = ports.velocities
        ports.add_velocity_force(parameters["drag"] * np.sign(v) * np.sqrt(np.abs(v)))


class Chirp(Departing):
    """A machine nearby that runs up: vibration whose frequency rises."""

    name = "chirp"
    parameters = (
        Parameter("amplitude", "N", "of the force", (0.4, 1.0)),
        Parameter("frequency", "Hz", "at first", (10.0, 40.0), role="shape", log=True),
        Parameter("rate", "Hz/s", "of its rise", (1.0, 5.0), role="shape", log=True),
    )

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        t = ports.times
        turns = (parameters["frequency"] + 0.5 * parameters["rate"] * t) * t
        ports.add_time_force(parameters["amplitude"] * np.sin(_TURN * turns))


KIN: tuple[Departing, ...] = (
    CoggingHarmonics(), EdgedPatch(), TentProfile(), TwoStageWarmUp(), HyperbolicWarmUp(),
    RippleHarmonics(), RoundedCable(), FloorHarmonics(),
)  # fmt: skip
"""Of a family in the library."""

OUTSIDE: tuple[Departing, ...] = (
    QuadraticDrag(), CubicCable(), WanderingForce(), ForceBump(), FrictionStep(),
    PeriodicFriction(), ForceStep(), LooseFit(), RootDrag(), Chirp(),
)  # fmt: skip
"""Of no family in the library."""
