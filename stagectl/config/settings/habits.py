"""What a drive profile is to the simulator: the habits of the virtual drive that plays it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from stagectl.config.machine import Drive
from stagectl.config.profiles import Profile

if TYPE_CHECKING:
    from hil_sim.habits import Habits

MODES = {"pp": 1, "pv": 3, "hm": 6, "csp": 8, "csv": 9, "cst": 10}
"""Modes of operation by their names in files."""
_MAPPABLE = ((0x60B2_00, "offset_bits"), (0x6077_00, "force_bits"))
_STATED = ((0x6502_00, "modes_claimed"), (0x60A8_00, "position_unit"), (0x60A9_00, "velocity_unit"))
_SHARED = ("absent", "only", "long_answers", "homing_attained", "in_sync", "interpolates",
           "pdo_entries", "tpdos")  # fmt: skip
"""Facts that are a habit by the same name."""


def habits_of(profile: Profile | None, drive: Drive) -> Habits:
    """The habits of the drive of an axis.

    Args:
        profile: of its family; None: it has none.
        drive: its drive section, filled by the profile.
    """
    from hil_sim import habits

    if profile is None:
        return habits.Habits()
    facts = profile.facts()
    csp = facts.get("csp_mode", habits.CSP)
    modes = [MODES[name] for name in facts.get("modes", ())]
    stated = {k: facts[name] for k, name in _STATED if name in facts}
    return habits.Habits(
        values=tuple({**dict(facts.get("values", ())), **stated}.items()),
        modes=tuple(csp if mode == habits.CSP else mode for mode in modes),
        csp_mode=csp,
        rated_force_unit=drive.rated_force_unit,
        force_factor=max(facts.get("force_factors", (1.0,))),
        wide=tuple(k for k, name in _MAPPABLE if facts.get(name) == 32),
        **{name: facts[name] for name in _SHARED if name in facts},
    )
