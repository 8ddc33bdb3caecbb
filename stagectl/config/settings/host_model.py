"""From a machine file to the estimator's model of an axis: friction, noise, delay, drift."""

from __future__ import annotations

import math
from collections.abc import Mapping

from estimation.noise import encoder_noise, quantisation
from estimation.observer import DriveLoop
from estimation.online import FIGURES, BeliefSettings, EstimatorSettings
from stagectl.config.machine import Axis, Drive

SETTLED_DRIFT = (7e-4, 4e-4, 4e-4, 2e-4, 5e-5, 2e-4, 1e-4)
"""Drift of `estimation.online.FIGURES` when a friction map covers place and warm-up (relative
1-sigma per move): histories show the other parameters to change over days, not between moves."""

UNMODELLED = 0.1
"""Rms of forces that no friction figure explains, over the Coulomb force that a run begins with: a
first guess, which the first moves that determine it replace."""
UNMODELLED_BY_MAP = 0.01
"""The same where a friction map is in use: so little that a move shows the level of its place, and
enough to be learned from."""
VARIATION = 0.03
"""The same of the Coulomb force over place, relative."""
SCATTER = 0.1
"""The same of the other figures, from move to move, relative."""
RATE_DRIFT = 0.01
"""Of C/Fc per move where every move says something of it: a fast one takes up model errors."""


def current_lag(drive: Drive) -> float:
    """Time constant of a drive's current loop [s]."""
    return 1.0 / (2.0 * math.pi * drive.current_bandwidth)


def kink_delay(drive: Drive) -> float:
    """Delay from a sample to the kink of a drive's force [s], see `estimation.sampled_force`."""
    return current_lag(drive) - drive.control_period / 2.0


def drive_loop(drive: Drive) -> DriveLoop | None:
    """The drive's position loop; None where it is a cascade."""
    if drive.pid is None:
        return None
    return DriveLoop(
        **drive.pid.model_dump(),
        current_bandwidth=drive.current_bandwidth,
        control_period=drive.control_period,
    )


def estimator_settings(
    axis: Axis,
    period: float,
    settled: Mapping[str, float] | None = None,
    calibration: bool = False,
) -> EstimatorSettings:
    """Settings of an axis' estimator.

    Args:
        axis: of the host's machine file.
        period: Ts [s].
        settled: with a friction map in use, drift by parameter name (relative 1-sigma per move),
            `SETTLED_DRIFT` for parameters not named; None without a map.
        calibration: the friction of places is measured. There, and with a map, how the Coulomb
            force differs over the table has a model of its own.
    """
    places = calibration or settled is not None
    drive, wander = axis.drive, axis.plant.friction.repeatability
    return EstimatorSettings(
        mass=axis.plant.mass,
        period=period,
        position_noise=encoder_noise(axis.encoder.noise, axis.encoder.increment),
        force_noise=quantisation(drive.force_unit),
        peak_force=drive.peak_force,
        request=("lag",) if places else ("lag", "relaxation_rate"),
        consider=() if places else ("static_ratio",),
        belief=BeliefSettings(
            wander=wander.coulomb,
            correlation_time=wander.correlation_time,
            unmodelled=UNMODELLED if settled is None else UNMODELLED_BY_MAP,
            variation=0.0 if places else VARIATION,
            scatter=0.0 if places else SCATTER,
            drift=_drift(settled, calibration),
        ),
    )


def _drift(settled: Mapping[str, float] | None, calibration: bool) -> tuple[float, ...]:
    """Drift of all parameters: `SETTLED_DRIFT` with some replaced, or that without a map."""
    drift = list(BeliefSettings().drift if settled is None else SETTLED_DRIFT)
    if settled is None and not calibration:
        drift[FIGURES.index("relaxation_rate")] = RATE_DRIFT
    for name, value in (settled or {}).items():
        drift[FIGURES.index(name)] = value
    return tuple(drift)
