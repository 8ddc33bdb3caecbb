"""Units of what is reported of an axis, which may turn."""

from __future__ import annotations

from hil_sim.settings import AxisSettings


def unit_on(axis: AxisSettings, unit: str) -> str:
    """The unit on this axis of what has `unit` on an axis that slides."""
    return axis.unit_of(unit)
