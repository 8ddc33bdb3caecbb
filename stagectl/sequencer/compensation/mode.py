"""What the force offsets of a run consist of, and the figures that it starts from."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum

Figures = Mapping[str, tuple[float, float]]
"""Friction figures by name (coulomb, viscous, stiffness, relaxation_rate), each with its sigma."""


class Mode(StrEnum):
    """What the force offsets consist of."""

    NONE = "none"  # mass times acceleration only
    MODEL = "model"  # and friction of the machine file
    ESTIMATED = "estimated"  # and friction as estimated
    ORACLE = "oracle"  # and the virtual stage's own friction
