"""The stiffness that a move's onset shows, while everything still sticks."""

from __future__ import annotations

from estimation.friction.law import stick_range
from estimation.online.belief.belief import COULOMB, MASS, STIFFNESS, VISCOUS
from estimation.online.solver.zones import REST, SLIDE
from stagedata.compiled import kernel


@kernel()
def first_stiffness(p, axis, law, samples, rest, use, slides, belief):  # type: ignore[no-untyped-def]
    """Stiffness, relative, at which to start the solve of all that is usable.

    Args:
        p: unknowns found so far, by column.
        axis: settings.
        law: constants of the friction law.
        samples: of the move.
        rest: friction state before it.
        use: rows that count, shape (K,).
        slides: zone A has been solved. Else Fc is as believed, and the stiffness is sought behind
            missing samples, too: what sticks goes by the position alone. From one that is off, the
            solve takes stiffness for elements that slip, at an Fc far too low.
        belief: before the move.
    """
    coulomb = axis.unit[COULOMB] * p[COULOMB]
    mass, viscous = axis.unit[MASS] * p[MASS], axis.unit[VISCOUS] * p[VISCOUS]
    down, up = stick_range(law, rest.forces, rest.known, coulomb)
    square = product = 0.0
    for k in range(samples.zone.shape[0]):
        if samples.zone[k] == SLIDE:
            break
        if samples.zone[k] != REST and not use[k]:
            if slides:
                break
            continue
        friction = (
            samples.force[k + 1] - mass * samples.acceleration[k] - viscous * samples.velocity[k]
            - rest.total
        )  # fmt: skip
        if not 0.8 * down < friction < 0.8 * up:
            break
        travel = samples.position[k + 1] - samples.position[0]
        square += travel * travel
        product += travel * friction
    outer = mass * axis.position_noise / axis.period**2
    missed = axis.model_error * coulomb
    variance = axis.force_noise**2 + missed * missed + 6.0 * outer * outer
    unit = axis.unit[STIFFNESS]
    believed = 1.0 / belief.covariance[STIFFNESS, STIFFNESS]
    shown = square * unit**2 / variance
    found = (believed * belief.mean[STIFFNESS] + shown * product / max(square * unit, 1e-300)) / (
        believed + shown
    )
    return min(max(found, axis.lower[STIFFNESS]), axis.upper[STIFFNESS])
