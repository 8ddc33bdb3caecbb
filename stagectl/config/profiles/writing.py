"""A profile as text, from facts that were learned of a drive."""

from __future__ import annotations

import json
from collections.abc import Iterable

from stagectl.config.profiles.library import parse_profile

_IDENTITY = ("vendor", "product", "revision")
_HEXADECIMAL = (*_IDENTITY, "modes_claimed", "position_unit", "velocity_unit", "acceleration_unit")


def family_of(facts: Iterable[tuple[str, object, str]]) -> str:
    """A name by the identity among the facts: "v539-p7"."""
    known = {key: value for key, value, _ in facts if key in _IDENTITY}
    parts = (f"{key[0]}{value:x}" for key, value in known.items() if isinstance(value, int))
    return "-".join(parts) or "unknown"


def render_profile(
    family: str, drives: str, facts: Iterable[tuple[str, object, str]], tested: str
) -> str:
    """The text of a profile.

    Args:
        family: its name.
        drives: what it is of.
        facts: key, value and source of each; objects as index numbers.
        tested: on what.

    Raises:
        ConfigError: a fact that no profile can hold.
    """
    identity, lines, remarks = [], [], []
    for key, value, source in facts:
        fact = f"{{value: {_shown(key, value)}, source: {_text(source)}, tested: {_text(tested)}}}"
        if key == "remarks":
            remarks.append(f"  - {fact}")
        elif key in _IDENTITY:
            identity.append(f"  {key}: {fact}")
        else:
            lines.append(f"{key}: {fact}")
    head = [f"family: {family}", f"drives: {_text(drives)}"]
    head += ["identity:", *identity] if len(identity) >= 2 else []
    text = "\n".join([*head, *lines, *(["remarks:", *remarks] if remarks else [])]) + "\n"
    parse_profile(text, "learned profile")
    return text


def _shown(key: str, value: object) -> str:
    if key in _HEXADECIMAL and isinstance(value, int):
        return _text(f"0x{value:X}")
    if key == "absent" and isinstance(value, list):
        return json.dumps([f"0x{index:04X}" for index in value])
    return json.dumps(value)


def _text(value: str) -> str:
    return json.dumps(value[:200], ensure_ascii=False)
