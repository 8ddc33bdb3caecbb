"""All effects that the check draws besides the library, some of them reserved for it.

The reserved ones are kept out of sight of anything a diagnosis may be tuned on. Variants belong
to a family of the library but depart from its equation: the right answer is the family's name,
and that something is left. Outside effects belong to none: the right answer is that no cause is
known.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hil_sim.effects import Parameter
from hil_sim.effects.ports import EffectPorts
from sim2real.blind.unlisted_effects import UNLISTED, UNLISTED_VARIANTS, UnlistedEffect

Values = Mapping[str, float]

_TURN = 2.0 * np.pi
_PHASE = Parameter("phase", "rad", "at 0", role="phase")
_CENTER = Parameter("center", "m", "where", role="place")


class TentProfile(UnlistedEffect):
    """Friction that rises linearly to one place: a rail that is bent there."""

    name = "tent_profile"
    group = "friction"
    family = "friction_position"
    parameters = (
        Parameter("amplitude", "", "surplus of Fc", (0.25, 0.6)),
        _CENTER,
        Parameter("half_width", "m", "of its base", (10e-3, 50e-3), role="shape", log=True),
    )

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        away = np.abs(ports.positions - parameters["center"]) / parameters["half_width"]
        ports.scale_position_coulomb(1.0 + parameters["amplitude"] * np.maximum(1.0 - away, 0.0))


class TwoStageWarmUp(UnlistedEffect):
    """Warm-up with two time constants: the film within seconds, the grease within minutes."""

    name = "two_stage_warm_up"
    group = "friction"
    family = "thermal_drift"
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


class WornHalf(UnlistedEffect):
    """One end of the rail has more friction, or less: worn in, or never greased."""

    name = "worn_half"
    group = "friction"
    family = "friction_position"
    parameters = (
        Parameter("amplitude", "", "change of Fc there", (0.15, 0.5), signed=True, above=-1.0),
        Parameter("center", "m", "where it changes", (-0.04, 0.04), role="place"),
        Parameter("width", "m", "of the change", (1e-3, 10e-3), role="shape", log=True),
    )

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        away = (ports.positions - parameters["center"]) / parameters["width"]
        ports.scale_position_coulomb(1.0 + parameters["amplitude"] * 0.5 * (1.0 + np.tanh(away)))


class SlopedFriction(UnlistedEffect):
    """Friction that grows along the rail: an uneven preload."""

    name = "sloped_friction"
    group = "friction"
    family = "friction_position"
    parameters = (
        Parameter("slope", "", "change of Fc 60 mm off the middle", (0.1, 0.35), signed=True),
    )

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        ports.scale_position_coulomb(1.0 + parameters["slope"] * ports.positions / 0.06)


class PeriodicFriction(UnlistedEffect):
    """Friction in waves over position: balls of the guide, joints of the rail."""

    name = "periodic_friction"
    group = "friction"
    family = "friction_position"
    parameters = (
        Parameter("amplitude", "", "of the factor on Fc", (0.1, 0.4)),
        Parameter("pitch", "m", "period", (6e-3, 25e-3), role="shape", log=True),
        _PHASE,
    )

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        turn = _TURN * ports.positions / parameters["pitch"] + parameters["phase"]
        ports.scale_position_coulomb(1.0 + parameters["amplitude"] * np.sin(turn))


class TautHose(UnlistedEffect):
    """A hose that hangs loose until it becomes taut towards one end of the travel."""

    name = "taut_hose"
    parameters = (
        Parameter("force", "N", "40 mm beyond where it gets taut", (0.8, 3.0)),
        Parameter("taut", "m", "where it does", (-0.02, 0.03), role="place"),
    )

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        beyond = np.maximum(ports.positions - parameters["taut"], 0.0) / 0.04
        ports.add_position_force(parameters["force"] * beyond)


class SoftCable(UnlistedEffect):
    """A cable loop of two parts, the second so soft that it takes millimetres to slide."""

    name = "soft_cable"
    family = "cable_hysteresis"
    parameters = (
        Parameter("force", "N", "of each part", (0.3, 1.0)),
        Parameter("stiffness", "N/m", "of the stiff part", (1e3, 5e3), role="shape", log=True),
        Parameter("slide", "m", "of the soft part", (2e-3, 8e-3), role="shape", log=True),
    )

    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """See `Effect.apply`."""
        force = parameters["force"]
        ports.add_hysteresis(force, parameters["stiffness"])
        ports.add_hysteresis(force, force / parameters["slide"])


VARIANTS: tuple[UnlistedEffect, ...] = (
    *UNLISTED_VARIANTS, TentProfile(), TwoStageWarmUp(), WornHalf(), SlopedFriction(),
    PeriodicFriction(), SoftCable(),
)  # fmt: skip
"""Of a family in the library, in another shape."""
OUTSIDE: tuple[UnlistedEffect, ...] = (*UNLISTED, TautHose())
"""Of no family in the library."""
