"""What a profile makes of a machine file: it fills the keys that the file leaves open, no other.

What it changes, and what it warns of, is one line: `Filled.note`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from stagectl.config.machine import Axis, Drive, Machine
from stagectl.config.profiles.model import Profile

_KEYS = ("modes", "heartbeat", "boot_timeout", "enable_timeout", "warnings")
"""Keys of a machine file's drive section that a profile states as they are."""
_RATES = ("velocity_unit", "acceleration_unit")
_LEAST = 0.1
"""Factors nearer to 1 than this are not worth a word."""
CSP = 8
"""Value of 0x6060 that selects csp (CiA 402)."""


@dataclass(frozen=True, slots=True)
class Filled:
    """A drive section with what a profile knows.

    Attributes:
        drive: of the machine file, open keys filled.
        note: what was filled and what is to be known, one line; "" for nothing.
        csp_mode: value of 0x6060 that selects csp.
        homing_attained: whether it confirms homing (statusword bit 12).
        without_offset: why force offsets must not be sent; "": they may.
    """

    drive: Drive
    note: str = ""
    csp_mode: int = CSP
    homing_attained: bool = True
    without_offset: str = ""


def fill(axis: Axis, profile: Profile | None) -> Filled:
    """The drive section of an axis with what its drive's profile knows.

    Args:
        axis: of a machine file.
        profile: of its drive; None: there is none, nothing is filled.
    """
    drive = axis.drive
    if profile is None:
        return Filled(drive)
    given = drive.model_fields_set
    known = {key: value for key, value in _known(axis, profile) if key not in given}
    filled = ", ".join(f"{key}: {_shown(value)}" for key, value in known.items())
    clauses = [*([f"fills {filled}"] if filled else []), *_warnings(profile)]
    sign = profile.offset_sign
    return Filled(
        drive.model_copy(update=known),
        f"profile {profile.family}: {'; '.join(clauses)}" if clauses else "",
        CSP if profile.csp_mode is None else profile.csp_mode.value,
        profile.homing_attained is None or profile.homing_attained.value,
        "acts against the direction of positions by its profile"
        if sign is not None and sign.value < 0
        else "",
    )


def _known(axis: Axis, profile: Profile) -> Iterator[tuple[str, Any]]:
    """Keys of a drive section, with the values that the profile knows."""
    for key in _KEYS:
        fact = getattr(profile, key)
        if fact is not None:
            yield key, fact.value
    turn = _turn(axis)
    if profile.rated_force_unit is not None and turn is not None:
        yield "rated_force_unit", profile.rated_force_unit.value / turn
    for key in _RATES:
        fact = getattr(profile, key)
        size = None if fact is None else unit_size(axis, fact.value)
        if size is not None:
            yield key, size


def with_profile(machine: Machine, family: str) -> Machine:
    """The machine with drives of a family, by a packaged profile."""
    axes = {
        name: axis.model_copy(update={"drive": axis.drive.model_copy(update={"profile": family})})
        for name, axis in machine.axes.items()
    }
    return machine.model_copy(update={"axes": axes})


def _turn(axis: Axis) -> float | None:
    """Travel per radian of the motor [m], 1 of an axis that turns; None: not known."""
    if axis.rotary:
        return 1.0
    return None if axis.drive.lead is None else axis.drive.lead / (2 * math.pi)


def unit_size(axis: Axis, notation: int) -> float | None:
    """A unit of CiA 303-2 on an axis [m or rad, by s or s^2]; None where it has none there."""
    from drivers.drive.units import INCREMENT, read_unit

    stated = read_unit(notation)
    if not stated.size:
        return None
    if stated.base == INCREMENT:
        return stated.size * axis.encoder.increment
    if stated.base == "rad":
        turn = _turn(axis)
        return None if turn is None else stated.size * turn
    return None if axis.rotary else stated.size


def _warnings(profile: Profile) -> Iterator[str]:
    """What no key can fill."""
    if profile.csp_mode is not None and profile.csp_mode.value != CSP:
        yield f"csp is selected by mode {profile.csp_mode.value}"
    if profile.force_of is not None and profile.force_of.value != "rated torque":
        yield f"forces are in 1/1000 of its {profile.force_of.value}: rated_force has to be that"
    if profile.force_factors is not None and any(
        abs(factor - 1.0) > _LEAST for factor in profile.force_factors.value
    ):
        factors = " or ".join(f"{f:.4g}" for f in profile.force_factors.value)
        yield f"forces may have to be multiplied by {factors}: try check --move"
    if profile.demand_delay is not None and profile.demand_delay.value >= 0.5:
        yield f"csp follows {profile.demand_delay.value:g} SYNCs late"
    if profile.interpolates is not None and not profile.interpolates.value:
        yield "csp steps from setpoint to setpoint"
    for remark in profile.remarks:
        yield remark.value


def _shown(value: object) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(map(str, value))}]"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
