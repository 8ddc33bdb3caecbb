"""Coulomb-Stribeck friction of the simulated plant: no presliding, rest is rest.

    F = sgn(v) s(v) Fc in motion, |F| <= s(0) Fc at rest

with s(v) as in docs/reference/reference-stage.md. At rest the force is whatever keeps the axis
there. So each step takes the force that brings the velocity to zero at its end, as far as the limit
allows (implicit Euler, which neither chatters nor creeps). Viscous friction is the plant's
business.
"""

from __future__ import annotations

import math

from hil_sim.plant.friction.stribeck import stribeck
from hil_sim.plant.ports.disturbances import coulomb_factor
from stagedata.compiled import kernel


@kernel()
def hold(p, s, v, dt):  # type: ignore[no-untyped-def]
    """Velocity of an axis after a step [m/s]; sets its friction force.

    What the change of that force does to another axis, through coupled masses, comes a step later.

    Args:
        p: record of the axis.
        s: state of the axis.
        v: velocity at the end of the step if friction stayed as in the step before [m/s].
        dt: of the step [s].
    """
    response = dt * p.mobility
    wanted = s.friction + v / response
    limit = p.coulomb * (1.0 + s.wander)
    limit *= stribeck(s.velocity, p.static_ratio, p.stribeck_velocity, p.stribeck_shape)
    if p.ported:
        limit *= coulomb_factor(p, s, wanted)
    held = wanted
    after = 0.0
    if abs(wanted) > limit:
        held = math.copysign(limit, wanted)
        after = v - response * (held - s.friction)
    s.net -= held - s.friction
    s.friction = held
    return after
