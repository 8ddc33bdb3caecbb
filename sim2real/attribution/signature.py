"""The signature of an effect: what it would leave in the innovations, to first order.

An effect that is a force on the carriage, or a factor on the Coulomb level or the motor force, is
evaluated along the tracked motion and passed through the filter's error equations: cheap enough to
try hundreds of pitches, frequencies, places and time constants. Effects that enter elsewhere
(stiffness, dead time, current loop) have to be simulated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hil_sim.effects.ports import EffectPorts
from hil_sim.settings import AxisSettings
from sim2real.filters import filtered
from sim2real.fitting import Term, with_effects
from sim2real.tracking import Gains, Track, innovation_response
from stagedata import F64

_SIMULATED = (
    "stiffness",
    "static_ratio",
    "current_bandwidth",
    "delay",
    "saturation",
    "hysteresis",
    "coupled_mass",
    "fields",
)
"""Ports whose response is not a force or a factor along the motion."""


@dataclass(frozen=True, slots=True, eq=False)
class EffectInputs:
    """What an effect adds to the model along a track of K samples.

    Attributes:
        force: on the carriage, float64[K] [N]; None where there is none.
        level: relative change of the Coulomb level, float64[K]; None where there is none.
    """

    force: F64 | None
    level: F64 | None


def effect_inputs(
    axis: AxisSettings,
    term: Term,
    track: Track,
    time: F64,
    acceleration: F64,
    start: float = 0.0,
) -> EffectInputs | None:
    """What a term adds along a track; None where it has to be simulated.

    Args:
        axis: without the term.
        term: to be added.
        track: of the axis under that model.
        time: of the samples, float64[K] [s].
        acceleration: of the carriage, float64[K] [m/s^2].
        start: of the recording, on the clock of effects that fade with time [s].
    """
    period, duration = float(time[1] - time[0]), float(time[-1])
    plain = EffectPorts.filled(axis, period, duration, start)
    ports = EffectPorts.filled(with_effects(axis, (term,)), period, duration, start)
    if any(getattr(ports, name) != getattr(plain, name) for name in _SIMULATED):
        return None
    force = _resisting_force(plain, track, time) - _resisting_force(ports, track, time)
    force += (_force_gain(ports, track) - _force_gain(plain, track)) * track.motor
    force -= (ports.mass - plain.mass) * acceleration
    force -= (ports.viscous - plain.viscous) * track.v
    force += _swing_force(ports, acceleration, period) - _swing_force(plain, acceleration, period)
    level = _coulomb_level(ports, track, time) / _coulomb_level(plain, track, time) - 1.0
    return EffectInputs(force if force.any() else None, level if level.any() else None)


def first_order_signature(found: EffectInputs, gains: Gains) -> F64:
    """What a term would leave in the normalised innovations of a model without it, float64[K]."""
    out = np.zeros(len(gains.deviation))
    if found.force is not None:
        out += innovation_response(gains, gains.force, found.force)
    if found.level is not None:
        out += innovation_response(gains, gains.level, found.level)
    return out


def _swing_force(ports: EffectPorts, acceleration: F64, period: float) -> F64:
    """Force on the carriage by masses hanging from it and by compliant bases, float64[K] [N].

    With mass m, mass ratio r, rate w = 2 pi f and damping d of a mode it is the acceleration
    relative to the base, filtered by m r s^2 / (i s^2 + 2 d w g s + w^2 g): i = 1, g = 1 - r for a
    hanging mass, i = 1 + r, g = 1 for a base. Bilinear transform, exact at the mode's frequency.
    """
    force = np.zeros(len(acceleration))
    modes = [(part, 1.0 - part.mass_ratio, 1.0) for part in ports.hanging]
    modes += [(part, 1.0, 1.0 + part.mass_ratio) for part in ports.bases]
    for part, softer, inertia in modes:
        rate = 2.0 * np.pi * part.frequency
        c = rate / np.tan(0.5 * rate * period)
        second = c**2 * np.array([1.0, -2.0, 1.0])
        first = 2.0 * part.damping * rate * softer * c * np.array([1.0, 0.0, -1.0])
        zeroth = rate**2 * softer * np.array([1.0, 2.0, 1.0])
        force += (
            ports.mass
            * part.mass_ratio
            * filtered(second, inertia * second + first + zeroth, acceleration)
        )
    return force


def _resisting_force(ports: EffectPorts, track: Track, time: F64) -> F64:
    pull = ports.force + ports.spring * track.x
    if ports.position_force is not None:
        pull = pull + np.interp(track.x, ports.positions, ports.position_force)
    if ports.velocity_force is not None:
        pull = pull + np.interp(track.v, ports.velocities, ports.velocity_force)
    if ports.time_force is not None:
        pull = pull + np.interp(time, ports.times, ports.time_force)
    for amplitude, frequency, phase in ports.harmonics:
        pull = pull + amplitude * np.sin(2.0 * np.pi * frequency * time + phase)
    return np.asarray(pull)


def _force_gain(ports: EffectPorts, track: Track) -> F64:
    gain = np.full(len(track.x), ports.force_constant)
    if ports.position_gain is not None:
        gain *= np.interp(track.x, ports.positions, ports.position_gain)
    return gain


def _coulomb_level(ports: EffectPorts, track: Track, time: F64) -> F64:
    level = ports.coulomb * np.where(track.v > 0.0, ports.coulomb_forward, ports.coulomb_backward)
    if ports.position_coulomb is not None:
        level = level * np.interp(track.x, ports.positions, ports.position_coulomb)
    if ports.time_coulomb is not None:
        level = level * np.interp(time, ports.times, ports.time_coulomb)
    for amplitude, constant in ports.decays:
        level = level * (1.0 + amplitude * np.exp(-time / constant))
    return np.maximum(level, 1e-6)
