"""The inverse plant: the force that a drive must have reported along a known motion.

The equations are those of `hil_sim.plant.mechanics`, solved for the motor force instead of the
motion, without controller or demand. There is one step per sample: friction and hysteresis follow
the positions, and only oscillators are integrated, in as many steps as they need. What lies between
controller and reported force (dead time, current loop) does not show, nor does a misreading of the
encoder, whose positions are taken for the motion.

Source: docs/reference/reference-stage.md, the plant.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from hil_sim.effects.ports import EffectPorts
from hil_sim.plant.arrays import Arrays
from hil_sim.plant.friction.gms import Slip, slide
from hil_sim.plant.friction.laws import GMS
from hil_sim.plant.friction.stribeck import stribeck
from hil_sim.plant.ports.disturbances import (
    coulomb_factor,
    drag,
    drive,
    lose,
    refresh,
    reported_force,
    swing,
)
from hil_sim.settings import AxisSettings, StageSettings
from stagedata import F64
from stagedata.compiled import kernel

_MOST = 0.999
"""Largest share of a saturating motor's limit that is inverted."""


_ROUNDS = 30
"""Times that a force which lags behind the reported one is inserted into itself."""


def force_along(settings: StageSettings, motion: tuple[F64, F64, F64]) -> F64:
    """Force actual value of every axis along a motion, float64[K, axes] [N], without noise.

    Near the limit of a saturating motor the reported force grows without bound. Where the motion
    takes more than 0.999 of the limit, the result is that of 0.999: 3.8 times the limit.

    Args:
        settings: of the stage.
        motion: position [m], velocity [m/s] and acceleration [m/s^2] at each SYNC, each
            float64[K, axes].

    Raises:
        ValueError: shapes do not match, or effects are impossible.
    """
    return _force_along(settings, motion, alone=False)


def _force_along(settings: StageSettings, motion: tuple[F64, F64, F64], alone: bool) -> F64:
    """As `force_along`; `alone`: axes that are variants of one, so that none may act on another."""
    position, velocity, acceleration = (np.ascontiguousarray(part) for part in motion)
    shape = position.shape
    if len(shape) != 2 or shape[1] != len(settings.axes):
        raise ValueError(f"motion must have shape (K, {len(settings.axes)}), has {shape}")
    if velocity.shape != shape or acceleration.shape != shape:
        raise ValueError(f"velocity and acceleration must have shape {shape}")
    force = np.empty_like(position)
    if len(force):
        settings = settings.reaching(position)
        arrays = Arrays(settings, position[0].tolist(), len(position) * settings.sync_period)
        if alone and any(ports.involves_another for ports in arrays.ports):
            raise ValueError("a variant has an effect that involves another axis")
        arrays.state["velocity"] = velocity[0]
        coupled = np.array([ports.coupled_mass for ports in arrays.ports])
        steps = np.array([_swing_steps(p, settings.sync_period) for p in arrays.ports])
        course = (position, velocity, acceleration)
        _follow(arrays.mechanics, coupled, settings.sync_period, steps, course, force)
    return force


def _swing_steps(ports: EffectPorts, period: float) -> int:
    """Steps per sample period [s] in which the fastest oscillator turns by less than a radian."""
    fastest = max((o.frequency for o in (*ports.hanging, *ports.bases)), default=0.0)
    return max(1, math.ceil(2.0 * math.pi * fastest * period))


def force_variants(
    sync_period: float,
    variants: Sequence[AxisSettings],
    motion: tuple[F64, F64, F64],
    start: float = 0.0,
) -> F64:
    """The force of several variants of one axis along a motion, float64[K, variants] [N].

    Args:
        sync_period: distance of the samples [s].
        variants: settings of the axis; no effect may involve another axis.
        motion: position, velocity and acceleration, float64[K], or of each variant its own,
            float64[K, variants].
        start: on the clock of effects that fade with time [s].

    Raises:
        ValueError: as `force_along`, or a variant involves the other axis.
    """
    shape = (len(motion[0]), len(variants))
    position, velocity, acceleration = (
        np.broadcast_to(part.reshape(len(part), -1), shape) for part in motion
    )
    stage = StageSettings(sync_period, tuple(variants), start)
    return _force_along(stage, (position, velocity, acceleration), alone=True)


@kernel()
def _before_losses(p, arena, wanted):  # type: ignore[no-untyped-def]
    """The force that is `wanted` [N] after all losses [N]."""
    force = wanted
    for _ in range(_ROUNDS if p.lags_count > 0 else 1):
        force = wanted + lose(p, arena, force, False)
        if p.motor_loss >= 0:
            force = reported_force(p, arena, force)
    return force


@kernel(nogil=True)
def _follow(m, coupled, period, steps, course, force):  # type: ignore[no-untyped-def]
    """Follow a motion.

    Args:
        m: as in `mechanics.advance`.
        coupled: times the other axis' acceleration is a force, float64[axes] [kg].
        period: of the samples [s].
        steps: of the oscillators per sample, int64[axes].
        course: position, velocity, acceleration [m, m/s, m/s^2], float64[K, axes] each.
        force: written, float64[K, axes] [N].
    """
    plant, state, arena = m.plant, m.state, m.arena
    forces, slipping, shares = m.forces, m.slipping, m.shares
    position, velocity, acceleration = course
    axes = plant.shape[0]
    for k in range(position.shape[0]):
        for a in range(axes):
            p = plant[a]
            s = state[a]
            dx = position[k, a] - s.position
            v = velocity[k, a]
            s.position = position[k, a]
            s.velocity = v
            level = p.coulomb
            if p.ported:
                refresh(plant[a], state[a], position[k, axes - 1 - a], arena, 0.0, period)
                s.lost = 0.0
                drag(p, arena, dx)
                if p.load_friction > 0.0:
                    drive(p, s, arena, 0.0, 0.0, 0.0)
                    lacking = p.mass * acceleration[k, a] - s.net
                    s.transmitted += (1.0 - p.motor_share) * lacking
                level *= coulomb_factor(p, s, dx)
            if dx != 0.0:
                direction = math.copysign(1.0, dx)
                curve = stribeck(v, p.static_ratio, p.stribeck_velocity, p.stribeck_shape)
                if p.law == GMS:
                    decay = math.exp(-p.relaxation_rate * period / curve)
                    slip = Slip(direction, dx, level * curve, decay)
                    slide(p, s, forces, slipping, shares, slip)
                else:
                    s.friction = direction * level * curve
            resistance = s.friction + p.viscous * v
            if not p.ported:
                force[k, a] = p.mass * acceleration[k, a] + resistance
                continue
            unpowered = drive(p, s, arena, 0.0, 0.0, resistance)
            wanted = (acceleration[k, a] - unpowered) / p.mobility
            s.net += wanted
            for _ in range(steps[a]):
                swing(p, s, arena, period / steps[a])
            if coupled[a] != 0.0:
                wanted += coupled[a] * acceleration[k, axes - 1 - a]
            if p.position_gain >= 0:
                wanted /= s.gain + s.gain_slope * (s.position - s.place)
            if p.saturation > 0.0:
                bent = min(max(wanted / p.saturation, -_MOST), _MOST)
                wanted = p.saturation * math.atanh(bent)
            wanted /= p.gain
            s.motor_force = _before_losses(p, arena, wanted)
            force[k, a] = s.motor_force
