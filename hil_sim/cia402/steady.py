"""Bounds within which SYNCs in csp change the demand and nothing else."""

from __future__ import annotations

from typing import NamedTuple


class Steady(NamedTuple):
    """Bounds of setpoints and measurements within which a SYNC in csp only moves the demand.

    Attributes:
        controlword: the only one.
        lowest, highest: of targets [units].
        force: largest force offset [1/1000 rated].
        ticks: control ticks in which a setpoint is reached.
        lowest_counts, highest_counts: of the encoder [increments].
        following_error: largest [units].
    """

    controlword: int
    lowest: int
    highest: int
    force: int
    ticks: int
    lowest_counts: int
    highest_counts: int
    following_error: float
