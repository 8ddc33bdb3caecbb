"""All effects that the check draws besides the library, some of them reserved for it.

The reserved ones are kept out of sight of anything a diagnosis may be tuned on. Variants belong
to a family of the library but depart from its equation: the right answer is the family's name,
and that something is left. Outside effects belong to none: the right answer is that no cause is
known.
"""

from __future__ import annotations

import numpy as np

from hil_sim.effects import Parameter
from hil_sim.effects.ports import EffectPorts
from sim2real.blind.unlisted_effects import (
    CENTER,
    PHASE,
    UNLISTED,
    UNLISTED_VARIANTS,
    UnlistedEffect,
    Values,
    unlisted,
    wave_angle,
)


@unlisted(
    Parameter("amplitude", "", "surplus of Fc", (0.25, 0.6)),
    CENTER,
    Parameter("half_width", "m", "of its base", (10e-3, 50e-3), role="shape", log=True),
    group="friction",
    family="friction_position",
    over="position_direction",
)
def tent_profile(ports: EffectPorts, p: Values) -> None:
    """Friction that rises linearly to one place: a rail that is bent there."""
    away = np.abs(ports.positions - p["center"]) / p["half_width"]
    ports.scale_position_coulomb(1.0 + p["amplitude"] * np.maximum(1.0 - away, 0.0))


@unlisted(
    Parameter("amplitude", "", "surplus of Fc at the start", (0.15, 0.4)),
    Parameter("fast", "s", "first time constant", (1.0, 4.0), role="shape", log=True),
    Parameter("slow", "s", "second time constant", (10.0, 100.0), role="shape", log=True),
    Parameter("share", "", "of the first", (0.3, 0.7), role="shape"),
    group="friction",
    family="thermal_drift",
    over="time",
)
def two_stage_warm_up(ports: EffectPorts, p: Values) -> None:
    """Warm-up with two time constants: the film within seconds, the grease within minutes."""
    share = p["share"]
    ports.decay_coulomb(p["amplitude"] * share, p["fast"])
    ports.decay_coulomb(p["amplitude"] * (1.0 - share), p["slow"])


@unlisted(
    Parameter("amplitude", "", "change of Fc there", (0.15, 0.5), signed=True, above=-1.0),
    Parameter("center", "m", "where it changes", (-0.04, 0.04), role="place"),
    Parameter("width", "m", "of the change", (1e-3, 10e-3), role="shape", log=True),
    group="friction",
    family="friction_position",
    over="position_direction",
)
def worn_half(ports: EffectPorts, p: Values) -> None:
    """One end of the rail has more friction, or less: worn in, or never greased."""
    away = (ports.positions - p["center"]) / p["width"]
    ports.scale_position_coulomb(1.0 + p["amplitude"] * 0.5 * (1.0 + np.tanh(away)))


@unlisted(
    Parameter("slope", "", "change of Fc 60 mm off the middle", (0.1, 0.35), signed=True),
    group="friction",
    family="friction_position",
    over="position_direction",
)
def sloped_friction(ports: EffectPorts, p: Values) -> None:
    """Friction that grows along the rail: an uneven preload."""
    ports.scale_position_coulomb(1.0 + p["slope"] * ports.positions / 0.06)


@unlisted(
    Parameter("amplitude", "", "of the factor on Fc", (0.1, 0.4)),
    Parameter("pitch", "m", "period", (6e-3, 25e-3), role="shape", log=True),
    PHASE,
    group="friction",
    family="friction_position",
    over="position_direction",
)
def periodic_friction(ports: EffectPorts, p: Values) -> None:
    """Friction in waves over position: balls of the guide, joints of the rail."""
    ports.scale_position_coulomb(1.0 + p["amplitude"] * np.sin(wave_angle(ports, p)))


@unlisted(
    Parameter("force", "N", "40 mm beyond where it gets taut", (0.8, 3.0)),
    Parameter("taut", "m", "where it does", (-0.02, 0.03), role="place"),
    over="position",
)
def taut_hose(ports: EffectPorts, p: Values) -> None:
    """A hose that hangs loose until it becomes taut towards one end of the travel."""
    beyond = np.maximum(ports.positions - p["taut"], 0.0) / 0.04
    ports.add_position_force(p["force"] * beyond)


@unlisted(
    Parameter("force", "N", "of each part", (0.3, 1.0)),
    Parameter("stiffness", "N/m", "of the stiff part", (1e3, 5e3), role="shape", log=True),
    Parameter("slide", "m", "of the soft part", (2e-3, 8e-3), role="shape", log=True),
    family="cable_hysteresis",
    over="reversal_path",
)
def soft_cable(ports: EffectPorts, p: Values) -> None:
    """A cable loop of two parts, the second so soft that it takes millimetres to slide."""
    force = p["force"]
    ports.add_hysteresis(force, p["stiffness"])
    ports.add_hysteresis(force, force / p["slide"])


VARIANTS: tuple[UnlistedEffect, ...] = (
    *UNLISTED_VARIANTS, tent_profile, two_stage_warm_up, worn_half, sloped_friction,
    periodic_friction, soft_cable,
)  # fmt: skip
"""Of a family in the library, in another shape."""
OUTSIDE: tuple[UnlistedEffect, ...] = (*UNLISTED, taut_hose)
"""Of no family in the library."""
