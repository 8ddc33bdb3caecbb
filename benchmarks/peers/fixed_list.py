"""A peer of the diagnosis: a fixed list of figures fitted by least squares, as identification toolboxes do.

What MuJoCo's `sysid` offers for a joint and its actuator: mass, gain, friction loss, damping,
spring with its rest position, constant force, delay and time constant of the actuator. All are
fitted at once to the signals of the free closed loop; nothing is selected. An effect counts as
named where its value differs from none by three standard errors and its removal shows in the loop.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hil_sim.effects.effect import Effect
from sim2real.diagnosis import Examination
from sim2real.fitting import STEP, AxisModel, Term, coordinates
from sim2real.free_loop import FreeLoop
from sim2real.free_loop.fit import fit_free, least_squares_covariance

FIXED_LIST = (
    "payload_mass", "force_constant", "coulomb_level", "viscous_damping", "cable_stiffness",
    "force_offset", "dead_time", "current_bandwidth",
)  # fmt: skip
"""Effects that the list has."""
_ITERATIONS = 12
"""Of Gauss-Newton."""
_SIGMAS, _VISIBLE = 3.0, 0.25
"""An effect is named if it is this many standard errors from neutral and its removal raises the
squared gap over floor by this much."""


def fit_fixed_list(
    examined: Examination, tolerance: Mapping[str, float], library: Mapping[str, Effect]
) -> dict[str, AxisModel]:
    """Axis -> model with the effects named, strongest first.

    Args:
        examined: the recordings.
        tolerance: axis -> relative standard deviation of the plant's figures.
        library: effects by name.
    """
    found = {}
    for axis in examined.settings.axes:
        loop = FreeLoop(axis.name, examined.measured, examined.settings, tolerance[axis.name])
        found[axis.name] = _fit_axis(loop, library)
    return found


def _fit_axis(loop: FreeLoop, library: Mapping[str, Effect]) -> AxisModel:
    model = loop.start
    for name in FIXED_LIST:
        if name in library:
            model = model.added(_absent(library[name], loop))
    fitted = fit_free(loop, model, _ITERATIONS)
    spread = np.sqrt(np.diag(least_squares_covariance(loop, fitted)))
    gap = loop.gap(fitted.residual)
    named: list[tuple[float, Term]] = []
    at = STEP
    for index, term in enumerate(fitted.model.terms):
        entry = coordinates(term.effect, loop.axis)[0]
        neutral = entry.parameter.neutral_on(loop.axis)
        away = abs(entry.inward(term.values[0]) - entry.inward(float(neutral or 0.0)))
        rise = loop.gap(loop.residual(fitted.model.without(index))) - gap
        if away > _SIGMAS * float(spread[at]) and rise > _VISIBLE:
            named.append((rise, term))
        at += len(term.values)
    named.sort(key=lambda pair: -pair[0])
    return AxisModel(fitted.model.base, tuple(term for _, term in named))


def _absent(effect: Effect, loop: FreeLoop) -> Term:
    """The effect at its neutral values; parameters that have none are in mid-range."""
    values = []
    for parameter in effect.parameters:
        neutral = parameter.neutral_on(loop.axis)
        low, high = parameter.ranges(loop.axis)[0]
        values.append(0.5 * (low + high) if neutral is None else float(neutral))
    return Term(effect, tuple(values))
