"""Effects in no list: what real stages have besides the library, for checks of the diagnosis.

Some have no name that a diagnosis could give: the right answer is that something is left
unexplained. Others are variants of the library's effects in another shape (cogging with harmonics,
a worn spot that is not a bell): the right answer is the family's name, and that something is left.
None can be given in machine files; all go into `AxisSettings.effects` like the library's own.

Each has one size parameter and takes its shape from the others, so that checks can draw them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from hil_sim.effects import Effect, Parameter
from hil_sim.effects.effect import Group
from hil_sim.effects.ports import EffectPorts

F64 = NDArray[np.float64]

_CENTER = Parameter("center", "m", "where", None, role="place")
_PHASE = Parameter("phase", "rad", "at position 0", None, role="phase")
_SEED = Parameter("seed", "", "which course", (0.0, 1e6), role="shape", least=0.0)


class UnlistedEffect(Effect):
    """An effect that no diagnosis searches for.

    Attributes:
        family: name of the library's effect whose family it belongs to; "" for none.
    """

    group: ClassVar[Group] = "force"
    equation = ""
    enters = "Checks only."
    remedy = "None: it is not to be found."
    searched = False
    family: ClassVar[str] = ""


class QuadraticDrag(UnlistedEffect):
    """Air that a cover or a wide table pushes aside."""

    name = "quadratic_drag"
    parameters = (Parameter("drag", "N s^2/m^2", "F_d += drag v |v|", (20.0, 100.0), neutral=0.0),)

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        speed = ports.velocities
        ports.add_velocity_force(parameters["drag"] * speed * np.abs(speed))


class RootDrag(UnlistedEffect):
    """A lubricant that thins under shear: resistance with the root of speed."""

    name = "root_drag"
    parameters = (
        Parameter("drag", "N (s/m)^0.5", "F_d += drag sgn(v) |v|^0.5", (2.0, 6.0), neutral=0.0),
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        speed = ports.velocities
        ports.add_velocity_force(parameters["drag"] * np.sign(speed) * np.sqrt(np.abs(speed)))


class CubicCable(UnlistedEffect):
    """A hose that stiffens towards the ends of the travel."""

    name = "cubic_cable"
    parameters = (
        Parameter("force", "N", "60 mm off the center", (0.8, 3.0), neutral=0.0),
        _CENTER,
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        away = (ports.positions - parameters["center"]) / 0.06
        ports.add_position_force(parameters["force"] * away**3)


class ForceBump(UnlistedEffect):
    """A magnet or a steel part beside the way: a pull towards one place."""

    name = "force_bump"
    parameters = (
        Parameter("force", "N", "largest", (0.8, 2.5), signed=True, neutral=0.0),
        _CENTER,
        Parameter("width", "m", "of the bump", (4e-3, 15e-3), role="shape", above=0.0, log=True),
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        away = (ports.positions - parameters["center"]) / parameters["width"]
        ports.add_position_force(parameters["force"] * np.exp(-0.5 * away**2))


class ForceStep(UnlistedEffect):
    """A cable that snags and stays snagged."""

    name = "force_step"
    parameters = (
        Parameter("force", "N", "from then on", (0.6, 2.0), signed=True, neutral=0.0),
        Parameter("time", "s", "when", (2.0, 8.0), role="shape", least=0.0),
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        ports.add_time_force(np.where(ports.times < parameters["time"], 0.0, parameters["force"]))


class RandomWalk(UnlistedEffect):
    """A force that wanders: a draught, a drifting current sensor, a hose that creeps."""

    name = "random_walk"
    parameters = (
        Parameter("rate", "N/s^0.5", "rms after a second", (0.2, 0.8), neutral=0.0),
        _SEED,
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        times = ports.times
        generator = np.random.default_rng([0x57414C, int(parameters["seed"])])
        steps = generator.standard_normal(len(times)) * np.sqrt(np.gradient(times))
        ports.add_time_force(parameters["rate"] * (np.cumsum(steps) - steps[0]))


class FrictionStep(UnlistedEffect):
    """Dirt or a drop of lubricant: another friction level from then on."""

    name = "friction_step"
    group = "friction"
    parameters = (
        Parameter("ratio", "", "change of Fc", (0.1, 0.35), signed=True, neutral=0.0, above=-1.0),
        Parameter("time", "s", "when", (2.0, 8.0), role="shape", least=0.0),
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        later = 1.0 + parameters["ratio"]
        ports.scale_time_coulomb(np.where(ports.times < parameters["time"], 1.0, later))


class FrictionPulsing(UnlistedEffect):
    """Friction that rises and falls with time: lubricant metered out, a wiper that breathes."""

    name = "friction_pulsing"
    group = "friction"
    parameters = (
        Parameter("amplitude", "", "of the factor on Fc", (0.1, 0.3), neutral=0.0, below=1.0),
        Parameter("frequency", "Hz", "", (0.3, 3.0), role="shape", above=0.0, log=True),
        _PHASE,
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        angle = 2.0 * np.pi * parameters["frequency"] * ports.times + parameters["phase"]
        ports.scale_time_coulomb(1.0 + parameters["amplitude"] * np.sin(angle))


class Sweep(UnlistedEffect):
    """A machine nearby that runs up: vibration of rising frequency."""

    name = "sweep"
    parameters = (
        Parameter("amplitude", "N", "of the force", (0.4, 1.0), neutral=0.0),
        Parameter("frequency", "Hz", "at first", (10.0, 40.0), role="shape", above=0.0, log=True),
        Parameter("rate", "Hz/s", "of its rise", (2.0, 6.0), role="shape"),
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        t = ports.times
        cycles = parameters["frequency"] * t + 0.5 * parameters["rate"] * t**2
        ports.add_time_force(parameters["amplitude"] * np.sin(2.0 * np.pi * cycles))


class ScaleError(UnlistedEffect):
    """A nonlinear encoder scale: it reads too much here, too little there."""

    name = "scale_error"
    parameters = (
        Parameter("error", "m", "amplitude", (1e-6, 4e-6), neutral=0.0),
        Parameter("pitch", "m", "period", (5e-3, 20e-3), role="shape", least=2e-3, log=True),
        _PHASE,
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        ports.add_misreading(parameters["error"] * np.sin(_angle(ports, parameters)))


class CoggingHarmonics(UnlistedEffect):
    """Cogging with second and third harmonic."""

    name = "cogging_harmonics"
    family = "cogging"
    parameters = (
        Parameter("amplitude", "N", "of the fundamental", (0.6, 2.0), neutral=0.0),
        Parameter("pitch", "m", "period", (24e-3, 40e-3), role="shape", least=3e-3, log=True),
        _PHASE,
        Parameter("second", "", "harmonic over the fundamental", (0.2, 0.5), role="shape"),
        Parameter("third", "", "harmonic over the fundamental", (0.0, 0.3), role="shape"),
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        angle = _angle(ports, parameters)
        wave = np.sin(angle)
        wave += parameters["second"] * np.sin(2.0 * angle + 1.0)
        wave += parameters["third"] * np.sin(3.0 * angle + 2.0)
        ports.add_position_force(parameters["amplitude"] * wave)


class RippleHarmonics(UnlistedEffect):
    """Force ripple with its second harmonic."""

    name = "ripple_harmonics"
    group = "motor"
    family = "force_ripple"
    parameters = (
        Parameter("ratio", "", "of the fundamental", (0.03, 0.08), neutral=0.0, below=0.5),
        Parameter("pitch", "m", "period", (8e-3, 14e-3), role="shape", least=2e-3, log=True),
        _PHASE,
        Parameter("second", "", "harmonic over the fundamental", (0.2, 0.5), role="shape"),
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        angle = _angle(ports, parameters)
        wave = np.sin(angle) + parameters["second"] * np.sin(2.0 * angle + 1.0)
        ports.scale_position_gain(1.0 + parameters["ratio"] * wave)


class RoughStretch(UnlistedEffect):
    """A stretch of the rail with more friction, from here to there."""

    name = "rough_stretch"
    group = "friction"
    family = "friction_position"
    parameters = (
        Parameter("amplitude", "", "surplus on the stretch", (0.2, 0.6), neutral=0.0, above=-1.0),
        _CENTER,
        Parameter("width", "m", "half its length", (8e-3, 25e-3), role="shape", least=3e-3),
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        away = np.abs(ports.positions - parameters["center"]) - parameters["width"]
        ports.scale_position_coulomb(
            1.0 + parameters["amplitude"] * 0.5 * (1.0 - np.tanh(away / 1e-3))
        )


class SlowWarmUp(UnlistedEffect):
    """A warm-up that is fast at first and never quite ends."""

    name = "slow_warm_up"
    group = "friction"
    family = "thermal_drift"
    parameters = (
        Parameter("amplitude", "", "surplus at the start", (0.15, 0.4), neutral=0.0, above=-1.0),
        Parameter("time", "s", "until half of it is gone", (1.0, 20.0), role="shape", above=0.0),
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        fading = 1.0 / (1.0 + ports.times / parameters["time"])
        ports.scale_time_coulomb(1.0 + parameters["amplitude"] * fading)


class TwoStrandCable(UnlistedEffect):
    """A cable with one strand that slides early and another that slides late."""

    name = "two_strand_cable"
    family = "cable_hysteresis"
    parameters = (
        Parameter("force", "N", "of both", (0.6, 1.6), neutral=0.0, least=0.0),
        Parameter("stiffness", "N/m", "of the stiff one", (2e3, 6e3), role="shape", above=0.0),
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        ports.add_hysteresis(0.5 * parameters["force"], parameters["stiffness"])
        ports.add_hysteresis(0.5 * parameters["force"], 0.2 * parameters["stiffness"])


class HummingFloor(UnlistedEffect):
    """Vibration with its second harmonic."""

    name = "humming_floor"
    family = "floor_vibration"
    parameters = (
        Parameter("amplitude", "N", "of the fundamental", (0.3, 0.7), neutral=0.0),
        Parameter("frequency", "Hz", "", (12.0, 60.0), role="shape", above=0.0, log=True),
        Parameter("phase", "rad", "at t = 0", None, role="phase"),
        Parameter("second", "", "harmonic over the fundamental", (0.2, 0.6), role="shape"),
    )

    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """See `Effect.apply`."""
        amplitude, frequency = parameters["amplitude"], parameters["frequency"]
        ports.add_harmonic(amplitude, frequency, parameters["phase"])
        second = parameters["second"] * amplitude
        ports.add_harmonic(second, 2.0 * frequency, 2.0 * parameters["phase"] + 1.0)


def _angle(ports: EffectPorts, parameters: Mapping[str, float]) -> F64:
    """Angle of a wave over position at the nodes [rad]."""
    return np.asarray(2.0 * np.pi * ports.positions / parameters["pitch"] + parameters["phase"])


UNLISTED: tuple[UnlistedEffect, ...] = (
    QuadraticDrag(), RootDrag(), CubicCable(), ForceBump(), ForceStep(), RandomWalk(),
    FrictionStep(), FrictionPulsing(), Sweep(), ScaleError(),
)  # fmt: skip
"""Of no family in the library."""
UNLISTED_VARIANTS: tuple[UnlistedEffect, ...] = (
    CoggingHarmonics(), RippleHarmonics(), RoughStretch(), SlowWarmUp(), TwoStrandCable(),
    HummingFloor(),
)  # fmt: skip
"""Of a family in the library, in another shape."""
