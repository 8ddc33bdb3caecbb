"""Effects in no list: what real stages have besides the library, for checks of the diagnosis.

Some have no name that a diagnosis could give: the right answer is that something is left
unexplained. Others are variants of the library's effects in another shape (cogging with harmonics,
a worn spot that is not a bell): the right answer is the family's name, and that something is left.
None can be given in machine files; all go into `AxisSettings.effects` like the library's own.

Each has one size parameter and takes its shape from the others, so that checks can draw them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import ClassVar

import numpy as np

from hil_sim.effects import Effect, Parameter
from hil_sim.effects.effect import Group
from hil_sim.effects.ports import EffectPorts
from stagedata import F64

Values = Mapping[str, float]

CENTER = Parameter("center", "m", "where", None, role="place")
PHASE = Parameter("phase", "rad", "at position 0", None, role="phase")
_SEED = Parameter("seed", "", "which course", (0.0, 1e6), role="shape", least=0.0)


class UnlistedEffect(Effect):
    """An effect that no diagnosis searches for.

    Attributes:
        family: name of the library's effect whose family it belongs to; "" for none.
        over: coordinate that it is a force over (`sim2real.findings.OVER`).
    """

    equation = ""
    enters = "Checks only."
    remedy = "None: it is not to be found."
    searched = False
    family: ClassVar[str]
    over: ClassVar[str]


def unlisted(
    *parameters: Parameter, over: str, group: Group = "force", family: str = ""
) -> Callable[[Callable[[EffectPorts, Values], None]], UnlistedEffect]:
    """Make an effect of a function: of its name, its docstring, and what it does to the ports."""

    def make(apply: Callable[[EffectPorts, Values], None]) -> UnlistedEffect:
        of_class = {
            "__doc__": apply.__doc__,
            "name": apply.__name__,
            "group": group,
            "family": family,
            "over": over,
            "parameters": parameters,
            "apply": lambda _, ports, values: apply(ports, values),
        }
        made: UnlistedEffect = type(apply.__name__, (UnlistedEffect,), of_class)()
        return made

    return make


@unlisted(
    Parameter("drag", "N s^2/m^2", "F_d += drag v |v|", (20.0, 100.0), neutral=0.0), over="velocity"
)
def quadratic_drag(ports: EffectPorts, p: Values) -> None:
    """Air that a cover or a wide table pushes aside."""
    speed = ports.velocities
    ports.add_velocity_force(p["drag"] * speed * np.abs(speed))


@unlisted(
    Parameter("drag", "N (s/m)^0.5", "F_d += drag sgn(v) |v|^0.5", (2.0, 6.0), neutral=0.0),
    over="velocity",
)
def root_drag(ports: EffectPorts, p: Values) -> None:
    """A lubricant that thins under shear: resistance with the root of speed."""
    speed = ports.velocities
    ports.add_velocity_force(p["drag"] * np.sign(speed) * np.sqrt(np.abs(speed)))


@unlisted(
    Parameter("force", "N", "60 mm off the center", (0.8, 3.0), neutral=0.0),
    CENTER,
    over="position",
)
def cubic_cable(ports: EffectPorts, p: Values) -> None:
    """A hose that stiffens towards the ends of the travel."""
    away = (ports.positions - p["center"]) / 0.06
    ports.add_position_force(p["force"] * away**3)


@unlisted(
    Parameter("force", "N", "largest", (0.8, 2.5), signed=True, neutral=0.0),
    CENTER,
    Parameter("width", "m", "of the bump", (4e-3, 15e-3), role="shape", above=0.0, log=True),
    over="position",
)
def force_bump(ports: EffectPorts, p: Values) -> None:
    """A magnet or a steel part beside the way: a pull towards one place."""
    away = (ports.positions - p["center"]) / p["width"]
    ports.add_position_force(p["force"] * np.exp(-0.5 * away**2))


@unlisted(
    Parameter("force", "N", "from then on", (0.6, 2.0), signed=True, neutral=0.0),
    Parameter("time", "s", "when", (2.0, 8.0), role="shape", least=0.0),
    over="time",
)
def force_step(ports: EffectPorts, p: Values) -> None:
    """A cable that snags and stays snagged."""
    ports.add_time_force(np.where(ports.times < p["time"], 0.0, p["force"]))


@unlisted(
    Parameter("rate", "N/s^0.5", "rms after a second", (0.2, 0.8), neutral=0.0), _SEED, over="time"
)
def random_walk(ports: EffectPorts, p: Values) -> None:
    """A force that wanders: a draught, a drifting current sensor, a hose that creeps."""
    times = ports.times
    generator = np.random.default_rng([0x57414C, int(p["seed"])])
    steps = generator.standard_normal(len(times)) * np.sqrt(np.gradient(times))
    ports.add_time_force(p["rate"] * (np.cumsum(steps) - steps[0]))


@unlisted(
    Parameter("ratio", "", "change of Fc", (0.1, 0.35), signed=True, neutral=0.0, above=-1.0),
    Parameter("time", "s", "when", (2.0, 8.0), role="shape", least=0.0),
    group="friction",
    over="time",
)
def friction_step(ports: EffectPorts, p: Values) -> None:
    """Dirt or a drop of lubricant: another friction level from then on."""
    later = 1.0 + p["ratio"]
    ports.scale_time_coulomb(np.where(ports.times < p["time"], 1.0, later))


@unlisted(
    Parameter("amplitude", "", "of the factor on Fc", (0.1, 0.3), neutral=0.0, below=1.0),
    Parameter("frequency", "Hz", "", (0.3, 3.0), role="shape", above=0.0, log=True),
    PHASE,
    group="friction",
    over="time",
)
def friction_pulsing(ports: EffectPorts, p: Values) -> None:
    """Friction that rises and falls with time: lubricant metered out, a wiper that breathes."""
    angle = 2.0 * np.pi * p["frequency"] * ports.times + p["phase"]
    ports.scale_time_coulomb(1.0 + p["amplitude"] * np.sin(angle))


@unlisted(
    Parameter("amplitude", "N", "of the force", (0.4, 1.0), neutral=0.0),
    Parameter("frequency", "Hz", "at first", (10.0, 40.0), role="shape", above=0.0, log=True),
    Parameter("rate", "Hz/s", "of its rise", (2.0, 6.0), role="shape"),
    over="time",
)
def sweep(ports: EffectPorts, p: Values) -> None:
    """A machine nearby that runs up: vibration of rising frequency."""
    t = ports.times
    cycles = p["frequency"] * t + 0.5 * p["rate"] * t**2
    ports.add_time_force(p["amplitude"] * np.sin(2.0 * np.pi * cycles))


@unlisted(
    Parameter("error", "m", "amplitude", (1e-6, 4e-6), neutral=0.0),
    Parameter("pitch", "m", "period", (5e-3, 20e-3), role="shape", least=2e-3, log=True),
    PHASE,
    over="position",
)
def scale_error(ports: EffectPorts, p: Values) -> None:
    """A nonlinear encoder scale: it reads too much here, too little there."""
    ports.add_misreading(p["error"] * np.sin(wave_angle(ports, p)))


@unlisted(
    Parameter("amplitude", "N", "of the fundamental", (0.6, 2.0), neutral=0.0),
    Parameter("pitch", "m", "period", (24e-3, 40e-3), role="shape", least=3e-3, log=True),
    PHASE,
    Parameter("second", "", "harmonic over the fundamental", (0.2, 0.5), role="shape"),
    Parameter("third", "", "harmonic over the fundamental", (0.0, 0.3), role="shape"),
    family="cogging",
    over="position",
)
def cogging_harmonics(ports: EffectPorts, p: Values) -> None:
    """Cogging with second and third harmonic."""
    angle = wave_angle(ports, p)
    wave = np.sin(angle)
    wave += p["second"] * np.sin(2.0 * angle + 1.0)
    wave += p["third"] * np.sin(3.0 * angle + 2.0)
    ports.add_position_force(p["amplitude"] * wave)


@unlisted(
    Parameter("ratio", "", "of the fundamental", (0.03, 0.08), neutral=0.0, below=0.5),
    Parameter("pitch", "m", "period", (8e-3, 14e-3), role="shape", least=2e-3, log=True),
    PHASE,
    Parameter("second", "", "harmonic over the fundamental", (0.2, 0.5), role="shape"),
    group="motor",
    family="force_ripple",
    over="position",
)
def ripple_harmonics(ports: EffectPorts, p: Values) -> None:
    """Force ripple with its second harmonic."""
    angle = wave_angle(ports, p)
    wave = np.sin(angle) + p["second"] * np.sin(2.0 * angle + 1.0)
    ports.scale_position_gain(1.0 + p["ratio"] * wave)


@unlisted(
    Parameter("amplitude", "", "surplus on the stretch", (0.2, 0.6), neutral=0.0, above=-1.0),
    CENTER,
    Parameter("width", "m", "half its length", (8e-3, 25e-3), role="shape", least=3e-3),
    group="friction",
    family="friction_position",
    over="position_direction",
)
def rough_stretch(ports: EffectPorts, p: Values) -> None:
    """A stretch of the rail with more friction, from here to there."""
    away = np.abs(ports.positions - p["center"]) - p["width"]
    ports.scale_position_coulomb(1.0 + p["amplitude"] * 0.5 * (1.0 - np.tanh(away / 1e-3)))


@unlisted(
    Parameter("amplitude", "", "surplus at the start", (0.15, 0.4), neutral=0.0, above=-1.0),
    Parameter("time", "s", "until half of it is gone", (1.0, 20.0), role="shape", above=0.0),
    group="friction",
    family="thermal_drift",
    over="time",
)
def slow_warm_up(ports: EffectPorts, p: Values) -> None:
    """A warm-up that is fast at first and never quite ends."""
    fading = 1.0 / (1.0 + ports.times / p["time"])
    ports.scale_time_coulomb(1.0 + p["amplitude"] * fading)


@unlisted(
    Parameter("force", "N", "of both", (0.6, 1.6), neutral=0.0, least=0.0),
    Parameter("stiffness", "N/m", "of the stiff one", (2e3, 6e3), role="shape", above=0.0),
    family="cable_hysteresis",
    over="reversal_path",
)
def two_strand_cable(ports: EffectPorts, p: Values) -> None:
    """A cable with one strand that slides early and another that slides late."""
    ports.add_hysteresis(0.5 * p["force"], p["stiffness"])
    ports.add_hysteresis(0.5 * p["force"], 0.2 * p["stiffness"])


@unlisted(
    Parameter("amplitude", "N", "of the fundamental", (0.3, 0.7), neutral=0.0),
    Parameter("frequency", "Hz", "", (12.0, 60.0), role="shape", above=0.0, log=True),
    Parameter("phase", "rad", "at t = 0", None, role="phase"),
    Parameter("second", "", "harmonic over the fundamental", (0.2, 0.6), role="shape"),
    family="floor_vibration",
    over="time",
)
def humming_floor(ports: EffectPorts, p: Values) -> None:
    """Vibration with its second harmonic."""
    amplitude, frequency = p["amplitude"], p["frequency"]
    ports.add_harmonic(amplitude, frequency, p["phase"])
    second = p["second"] * amplitude
    ports.add_harmonic(second, 2.0 * frequency, 2.0 * p["phase"] + 1.0)


def wave_angle(ports: EffectPorts, p: Values) -> F64:
    """Angle of a wave over position at the nodes [rad]."""
    return np.asarray(2.0 * np.pi * ports.positions / p["pitch"] + p["phase"])


UNLISTED: tuple[UnlistedEffect, ...] = (
    quadratic_drag, root_drag, cubic_cable, force_bump, force_step, random_walk,
    friction_step, friction_pulsing, sweep, scale_error,
)  # fmt: skip
"""Of no family in the library."""
UNLISTED_VARIANTS: tuple[UnlistedEffect, ...] = (
    cogging_harmonics, ripple_harmonics, rough_stretch, slow_warm_up, two_strand_cable,
    humming_floor,
)  # fmt: skip
"""Of a family in the library, in another shape."""
