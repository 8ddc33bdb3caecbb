"""The stiffness that a move's onset shows, while all elements still stick."""

from __future__ import annotations

from estimation.compiled import kernel
from estimation.online.belief import COULOMB, MASS, STIFFNESS, VISCOUS
from estimation.online.move_tables import T_ACCELERATION, T_FORCE, T_POSITION, T_VELOCITY
from estimation.online.update_tables import (
    C_FORCE_NOISE,
    C_MODEL_ERROR,
    C_PERIOD,
    C_POSITION_NOISE,
    F_LOWER,
    F_UNIT,
    F_UPPER,
    R_KNOWN,
    R_REST_FORCE,
)
from estimation.online.zones import REST, SLIDE


@kernel()
def first_stiffness(  # type: ignore[no-untyped-def]
    p, prior_mean, prior_covariance, zone, tables, use, forces, constants, units, report
):
    """Start zone B's problem at the stiffness that the onset shows while all elements stick."""
    known_coulomb, rest_force = report[R_KNOWN], report[R_REST_FORCE]
    coulomb = units[F_UNIT, COULOMB] * p[COULOMB]
    mass, viscous = units[F_UNIT, MASS] * p[MASS], units[F_UNIT, VISCOUS] * p[VISCOUS]
    n = forces.shape[0]
    up = down = 1e300
    for i in range(n):
        limit = 2.0 * (i + 1) / (n * (n + 1)) * coulomb
        force = forces[i] * coulomb / known_coulomb
        up, down = min(up, limit - force), min(down, limit + force)
    up, down = 0.8 * n * max(up, 0.0), -0.8 * n * max(down, 0.0)
    square = product = 0.0
    origin = tables[T_POSITION, 0]
    for k in range(zone.shape[0]):
        friction = (
            tables[T_FORCE, k + 1] - mass * tables[T_ACCELERATION, k]
            - viscous * tables[T_VELOCITY, k] - rest_force
        )  # fmt: skip
        if zone[k] == SLIDE or not down < friction < up or (not use[k] and zone[k] != REST):
            break
        travel = tables[T_POSITION, k + 1] - origin
        square += travel * travel
        product += travel * friction
    spread = constants[C_MODEL_ERROR] * coulomb
    outer = mass * constants[C_POSITION_NOISE] / constants[C_PERIOD] ** 2
    variance = constants[C_FORCE_NOISE] ** 2 + spread**2 + 6.0 * outer**2
    unit = units[F_UNIT, STIFFNESS]
    believed = 1.0 / prior_covariance[STIFFNESS, STIFFNESS]
    shown = square * unit**2 / variance
    found = (believed * prior_mean[STIFFNESS] + shown * product / max(square * unit, 1e-300)) / (
        believed + shown
    )
    p[STIFFNESS] = min(max(found, units[F_LOWER, STIFFNESS]), units[F_UPPER, STIFFNESS])
