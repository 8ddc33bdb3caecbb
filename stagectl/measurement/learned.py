"""What moves show of a drive, as facts for its profile: by a short move, by a measured response.

Positions that lag the demand by half a SYNC less than CiA 402 has it show that csp steps. What a
response does not determine is left out.
"""

from __future__ import annotations

from collections.abc import Sequence

from estimation.response import AxisResponse
from stagectl.config.machine import Axis
from stagectl.measurement.findings import MISFIT, SIGMAS, find_contradictions
from stagectl.measurement.scale import OFFSET, PUSH, Compared

_NEAR = 0.2
"""A lag this near to a multiple of half a SYNC period is taken for it."""
Facts = list[tuple[str, object, str]]
"""Key of a profile, value and source of each."""


def facts_of_scale(compared: Sequence[Compared]) -> Facts:
    """The sign of force offsets by `scale.check_scale`."""
    acting = [c for c in compared if c.what in (OFFSET, PUSH) and c.found is not None]
    signs = {1 if c.found > 0 else -1 for c in acting if c.found}
    if len(signs) != 1:
        return []
    return [("offset_sign", signs.pop(), "steps of 0x60B2, 0x6077 and 0x6064 after them")]


def facts_of_response(axis: Axis, period: float, response: AxisResponse) -> tuple[Facts, str]:
    """Scale of forces, the demand's delay, whether csp interpolates.

    Args:
        axis: of the machine file, which has mass and friction.
        period: Ts [s].
        response: measured.

    Returns:
        The facts, and what could not be told; "": all was.
    """
    found = find_contradictions(axis, axis.plant.friction.figures, period, response).fitted
    if found.misfit > MISFIT:
        return [], f"the response does not fit the machine file (misfit {found.misfit:.1f})"
    figures, how = found.figures, "response to force offsets and demand"
    facts: Facts = [
        ("force_factors", [float(f"{axis.plant.mass / figures.mass:.3g}")], f"{how}, by the mass")
    ]
    lag = (figures.age + figures.smoothing) / period
    if SIGMAS * found.sigma["position_delay"] > _NEAR * period:
        return facts, "the demand's delay is not known well enough"
    facts.append(("demand_delay", round(lag, 2), f"{how}, the age of positions included"))
    for value, interpolates in ((0.0, True), (-0.5, False)):
        if abs(lag - value) < _NEAR:
            facts.append(("interpolates", interpolates, f"{how}: {lag:.2f} SYNCs late"))
            return facts, ""
    return facts, "whether csp interpolates cannot be told from so late a position"
