"""The host's compensation of each effect of the library: one function per effect, named like it.

Each adds to the terms of its axis what its parameters mean (docs/formats/effects.md). They are
found by the name that the effect declares; another package's effect names a function of its own
with the same arguments.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from estimation.known_effects.terms import Base, KnownTerms, Surface
from estimation.low_speed_friction import low_speed_shape
from stagedata import F64, FrictionFigures

Values = Mapping[str, float]

WAVES = 300
DOMAIN = 0x4D4150
"""First word of the generator's seed."""
_FINER = 25.0
"""Points evaluated per correlation length."""


def _wave(values: Values, position: F64) -> F64:
    """sin(2 pi x/pitch + phase)."""
    turns = np.asarray(position) / values["pitch"]
    return np.asarray(np.sin(2.0 * math.pi * turns + values["phase"]))


def payload_mass(terms: KnownTerms, values: Values) -> None:
    """Mass [kg] on top of the machine file's."""
    terms.mass += values["mass"]


def current_bandwidth(terms: KnownTerms, values: Values) -> None:
    """Another bandwidth [Hz] of the current loop."""
    terms.bandwidth = values["bandwidth"]


def dead_time(terms: KnownTerms, values: Values) -> None:
    """Delay [s] before the current loop."""
    terms.delay += values["delay"]


def force_constant(terms: KnownTerms, values: Values) -> None:
    """Force on the carriage over measured force."""
    terms.gain *= values["ratio"]


def force_ripple(terms: KnownTerms, values: Values) -> None:
    """Factor on the motor force over position."""
    terms.gains.append(lambda x: 1.0 + values["ratio"] * _wave(values, x))


def motor_gain_table(terms: KnownTerms, values: Mapping[str, Sequence[float]]) -> None:
    """Factor on the motor force over position, from a table."""
    terms.gains.append(lambda x: np.interp(x, values["position"], values["factor"]))


def force_saturation(terms: KnownTerms, values: Values) -> None:
    """Force [N] that the motor cannot exceed."""
    terms.saturation = min(terms.saturation, values["force"])


def coulomb_level(terms: KnownTerms, values: Values) -> None:
    """Factor on Fc everywhere."""
    terms.coulomb *= values["ratio"]


def friction_asymmetry(terms: KnownTerms, values: Values) -> None:
    """Fc (1 ± ratio), plus forwards."""
    terms.forward *= 1.0 + values["ratio"]
    terms.backward *= 1.0 - values["ratio"]


def friction_map(terms: KnownTerms, values: Values) -> None:
    """Factor on Fc over both axes, drawn from the seed."""
    terms.table_factors.append(
        random_field(values["amplitude"], values["length"], int(values["seed"]))
    )


def random_field(amplitude: float, length: float, seed: int) -> Surface:
    """The factor 1 + amplitude g over the positions of both axes, drawn from a seed.

    docs/formats/effects.md, "The field of friction_map". Evaluated along a path at points much
    closer than the correlation length, and linearly between.

    Args:
        amplitude: largest deviation from 1.
        length: correlation length [m].
        seed: of the field.
    """
    generator = np.random.default_rng([DOMAIN, seed])
    along, across = generator.normal(0.0, 1.0 / length, (2, WAVES))
    phase = generator.uniform(0.0, 2.0 * math.pi, WAVES)

    def factor(own: F64, other: F64) -> F64:
        own, other = (np.atleast_1d(np.asarray(x, np.float64)) for x in (own, other))
        gone = np.append(0.0, np.cumsum(np.hypot(np.diff(own), np.diff(other))))
        points = min(len(gone), 2 + int(_FINER * gone[-1] / length))
        nodes = np.linspace(0.0, gone[-1], points)
        near = np.searchsorted(gone, nodes[1:-1])
        rows = np.unique(np.concatenate(([0], near, [len(gone) - 1])))
        angle = np.outer(own[rows], along) + np.outer(other[rows], across) + phase
        normal = math.sqrt(2.0 / WAVES) * np.cos(angle).sum(axis=1)
        level = np.array([math.erf(value / math.sqrt(2.0)) for value in normal])
        return np.asarray(np.interp(np.arange(len(gone)), rows, 1.0 + amplitude * level))

    return factor


def friction_position(terms: KnownTerms, values: Values) -> None:
    """Bell over the axis' own position."""
    terms.table_factors.append(
        lambda x, _: (
            1.0
            + values["amplitude"]
            * np.exp(-0.5 * np.square((x - values["center"]) / values["width"]))
        )
    )


def friction_spot(terms: KnownTerms, values: Values) -> None:
    """Bell over both positions."""

    def factor(x: F64, y: F64) -> F64:
        away = np.square(x - values["center"]) + np.square(y - values["other"])
        bell = np.exp(-0.5 * away / values["width"] ** 2)
        return np.asarray(1.0 + values["amplitude"] * bell)

    terms.table_factors.append(factor)


def low_speed_friction(terms: KnownTerms, values: Values) -> None:
    """Force in proportion to Fc that dies out with speed."""

    def force(velocity: F64, friction: FrictionFigures) -> F64:
        shape = low_speed_shape(np.asarray(velocity) / values["speed"])
        return np.asarray(friction.coulomb * values["ratio"] * shape)

    terms.friction_forces.append(force)


def presliding_stiffness(terms: KnownTerms, values: Values) -> None:
    """Factor on sigma0."""
    terms.stiffness *= values["ratio"]


def stribeck(terms: KnownTerms, values: Values) -> None:
    """Another alpha."""
    terms.static_ratio = values["static_ratio"]


def thermal_drift(terms: KnownTerms, values: Values) -> None:
    """Factor on Fc that decays from the first SYNC on."""
    amplitude, constant = values["amplitude"], values["time_constant"]
    terms.time_factors.append(lambda t: 1.0 + amplitude * np.exp(-np.asarray(t) / constant))


def viscous_asymmetry(terms: KnownTerms, values: Values) -> None:
    """sigma_v (1 ± ratio), plus forwards: besides sigma_v v a force against either motion."""
    terms.friction_forces.append(
        lambda velocity, friction: friction.viscous * values["ratio"] * np.abs(velocity)
    )


def viscous_damping(terms: KnownTerms, values: Values) -> None:
    """Factor on sigma_v."""
    terms.viscous *= values["ratio"]


def cable_hysteresis(terms: KnownTerms, values: Values) -> None:
    """An element that slides at its force [N], of a stiffness [N/m]."""
    terms.hysteresis.append((values["force"], values["stiffness"]))


def cable_stiffness(terms: KnownTerms, values: Values) -> None:
    """A spring [N/m] relaxed at its center [m]."""
    terms.forces.append(lambda x: values["stiffness"] * (np.asarray(x) - values["center"]))


def cogging(terms: KnownTerms, values: Values) -> None:
    """Force [N] that is periodic over position."""
    terms.forces.append(lambda x: values["amplitude"] * _wave(values, x))


def force_offset(terms: KnownTerms, values: Values) -> None:
    """The same force [N] everywhere."""
    terms.forces.append(lambda x: np.full(np.shape(x), values["force"]))


def residual_table(terms: KnownTerms, values: Mapping[str, Sequence[float]]) -> None:
    """Forces [N] over position and velocity, and a factor on Fc over position, from tables."""
    places, speeds = np.array(values["position"]), np.array(values["velocity"])
    heights = {key: np.array(values[key]) for key in ("force", "coulomb", "velocity_force")}
    terms.forces.append(lambda x: np.interp(x, places, heights["force"]))
    terms.velocity_forces.append(lambda v: np.interp(v, speeds, heights["velocity_force"]))
    if (heights["coulomb"] != 1.0).any():
        terms.table_factors.append(lambda x, _: np.interp(x, places, heights["coulomb"]))


def unbalance(terms: KnownTerms, values: Values) -> None:
    """Torque [N m] of a weight over the angle of a rotary axis."""
    terms.forces.append(lambda x: values["torque"] * np.sin(np.asarray(x) + values["phase"]))


def base_motion(terms: KnownTerms, values: Values) -> None:
    """A base that yields to the reaction."""
    terms.bases.append(Base(values["mass_ratio"], values["frequency"], values["damping"]))


def cross_coupling(terms: KnownTerms, values: Values) -> None:
    """Force per acceleration of the other axis [kg]."""
    terms.coupled_mass += values["mass"]


torque_ripple = force_ripple
transmission_ripple = cogging
