"""What the estimator is told of an axis by its machine file: friction, noise, delay, drift."""

from __future__ import annotations

import math
from collections.abc import Mapping

from estimation.friction import Friction
from estimation.noise import encoder_noise, quantisation
from estimation.online import FIGURES, BeliefSettings, EstimatorSettings
from stagectl.config.machine import Axis, Drive

SETTLED_DRIFT = (7e-4, 4e-4, 4e-4, 2e-4, 5e-5, 2e-4, 1e-4)
"""Relative 1-sigma per move of `estimation.belief.FIGURES` where a map takes what changes with
place and warm-up: a history shows the others to change over days, not from move to move."""


def kink_tip(drive: Drive) -> float:
    """When a kink of a drive's force comes after the sample, see `estimation.sampled_force` [s]."""
    return 1.0 / (2.0 * math.pi * drive.current_bandwidth) - drive.control_period / 2.0


def friction_model(axis: Axis) -> Friction:
    """The friction that a machine file states for an axis, as the estimator's model."""
    friction = axis.plant.friction
    return Friction(
        elements=friction.elements,
        coulomb=friction.coulomb,
        viscous=friction.viscous,
        stiffness=friction.stiffness,
        relaxation_rate=friction.attraction / friction.coulomb,
        static_ratio=friction.static_ratio,
        stribeck_velocity=friction.stribeck_velocity,
        stribeck_shape=friction.stribeck_shape,
    )


def estimator_settings(
    axis: Axis, period: float, settled: Mapping[str, float] | None = None
) -> EstimatorSettings:
    """What the estimator of an axis goes by.

    Args:
        axis: as the host believes it.
        period: Ts [s].
        settled: relative 1-sigma per move of figures by name where it is known from elsewhere how
            the Coulomb force differs from place to place, `SETTLED_DRIFT` for those that are
            missing; None: it is not.
    """
    drive, wander = axis.drive, axis.plant.friction.repeatability
    return EstimatorSettings(
        mass=axis.plant.mass,
        period=period,
        position_noise=encoder_noise(axis.encoder.noise, axis.encoder.increment),
        force_noise=quantisation(drive.force_unit),
        peak_force=drive.peak_force,
        request=("lag",),
        belief=BeliefSettings(
            wander=wander.coulomb,
            correlation_time=wander.correlation_time,
            drift=BeliefSettings().drift if settled is None else _drift(settled),
        ),
    )


def _drift(settled: Mapping[str, float]) -> tuple[float, ...]:
    """Drift of all figures; that of the Coulomb force and of the mass is not learnt."""
    drift = list(SETTLED_DRIFT)
    for name, value in settled.items():
        drift[FIGURES.index(name)] = value
    return tuple(drift)
