"""What a profile makes of a machine file: it fills the keys that the file leaves open, no other.

What it changes, and what it warns of, is one line: `Filled.note`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
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
_AGAINST = "acts against the direction of positions by its profile"


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
    given, facts = drive.model_fields_set, profile.facts()
    known = {key: value for key, value in _known(axis, facts) if key not in given}
    filled = ", ".join(f"{key}: {_shown(value)}" for key, value in known.items())
    clauses = [*([f"fills {filled}"] if filled else []), *_warnings(facts)]
    clauses += [remark.value for remark in profile.remarks]
    return Filled(
        drive.model_copy(update=known),
        f"profile {profile.family}: {'; '.join(clauses)}" if clauses else "",
        facts.get("csp_mode", CSP),
        facts.get("homing_attained", True),
        _AGAINST if facts.get("offset_sign", 1) < 0 else "",
    )


def _known(axis: Axis, facts: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Keys of a drive section, with the values that a profile's facts give."""
    yield from ((key, facts[key]) for key in _KEYS if key in facts)
    turn = _turn(axis)
    if "rated_force_unit" in facts and turn is not None:
        yield "rated_force_unit", facts["rated_force_unit"] / turn
    for key in _RATES:
        if key in facts and (size := unit_size(axis, facts[key])) is not None:
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


def _warnings(facts: Mapping[str, Any]) -> Iterator[str]:
    """What no key can fill."""
    if (mode := facts.get("csp_mode", CSP)) != CSP:
        yield f"csp is selected by mode {mode}"
    if (of := facts.get("force_of", "rated torque")) != "rated torque":
        yield f"forces are in 1/1000 of its {of}: rated_force has to be that"
    factors = facts.get("force_factors", ())
    if any(abs(factor - 1.0) > _LEAST for factor in factors):
        shown = " or ".join(f"{f:.4g}" for f in factors)
        yield f"forces may have to be multiplied by {shown}: try check --move"
    if (late := facts.get("demand_delay", 0.0)) >= 0.5:
        yield f"csp follows {late:g} SYNCs late"
    if not facts.get("interpolates", True):
        yield "csp steps from setpoint to setpoint"


def _shown(value: object) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(map(str, value))}]"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
