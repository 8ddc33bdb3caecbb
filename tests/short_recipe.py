"""A recipe of few sites, as text: soon over, and otherwise like any other."""

from __future__ import annotations

_MOVES = """\
recipe: short
macro: {velocity: 0.5, acceleration: 3.0, jerk: 200.0}
micro: {velocity: 0.01, acceleration: 0.2, jerk: 20.0}
settle: {window: 5.0e-8, hold: 0.005, timeout: 0.15}
"""
_SLOW_MOVES = """\
recipe: short
macro: {velocity: 0.5, acceleration: 5.0, jerk: 20.0}
micro: {velocity: 0.01, acceleration: 0.2, jerk: 20.0}
settle: {window: 5.0e-7, hold: 0.02, timeout: 0.3}
"""


def short_recipe(*sites: tuple[float, float], slow: bool = False) -> str:
    """The recipe that goes to these sites [m].

    Args:
        sites: in their order.
        slow: for a SYNC of some ms, in real time.
    """
    return (
        f"{_SLOW_MOVES if slow else _MOVES}"
        "expose: 0.02\n"
        f"sites: {[list(site) for site in sites]}\n"
        "fiducial: {source: simulated, range: 80.0e-6, seed: 1}\n"
    )
