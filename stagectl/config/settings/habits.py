"""What a drive profile is to the simulator: the habits of the virtual drive that plays it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from stagectl.config.machine import Axis, Drive
from stagectl.config.profiles import Profile

if TYPE_CHECKING:
    from hil_sim.habits import Habits, Values

MODES = {"pp": 1, "pv": 3, "hm": 6, "csp": 8, "csv": 9, "cst": 10}
"""Modes of operation by their names in files."""
_CLAIMED, _MAPPABLE = 0x6502_00, ((0x60B2_00, "offset_bits"), (0x6077_00, "force_bits"))
_NOTATIONS = ((0x60A8_00, "position_unit"), (0x60A9_00, "velocity_unit"))
_SHARED = ("long_answers", "homing_attained", "in_sync", "interpolates", "pdo_entries", "tpdos")
"""Facts that are a habit by the same name."""


def habits_of(profile: Profile, axis: Axis, drive: Drive) -> Habits:
    """The habits of the drive of an axis.

    Args:
        profile: of its family.
        axis: of a machine file.
        drive: its drive section, filled by the profile.
    """
    from hil_sim import habits

    shared = {name: getattr(profile, name) for name in _SHARED}
    csp = profile.csp_mode.value if profile.csp_mode else habits.CSP
    modes = [MODES[name] for name in profile.modes.value] if profile.modes else []
    return habits.Habits(
        absent=profile.absent.value if profile.absent else (),
        values=_values(profile),
        only=profile.only.value if profile.only else (),
        modes=tuple(csp if mode == habits.CSP else mode for mode in modes),
        csp_mode=csp,
        rated_force_unit=drive.rated_force_unit,
        force_factor=max(profile.force_factors.value) if profile.force_factors else 1.0,
        wide=tuple(
            k for k, name in _MAPPABLE if (fact := getattr(profile, name)) and fact.value == 32
        ),
        **{name: fact.value for name, fact in shared.items() if fact is not None},
    )


def _values(profile: Profile) -> Values:
    """Values after power-on: modes claimed, units stated, and others that are known."""
    found = dict(profile.values.value) if profile.values else {}
    if profile.modes_claimed:
        found[_CLAIMED] = profile.modes_claimed.value
    for k, name in _NOTATIONS:
        fact = getattr(profile, name)
        if fact is not None:
            found[k] = fact.value
    return tuple(found.items())
