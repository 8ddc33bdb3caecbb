"""The profile of a drive: named in the machine file, or found by the identity in the drive's EDS.

By identity, files in the folder `drives` beside the machine file come before the packaged ones: a
learned profile is of that very drive. The driver checks that drive and EDS agree.
"""

from __future__ import annotations

import configparser
from collections.abc import Iterator
from functools import cache
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path

from stagectl.config.machine import Axis, Machine
from stagectl.config.parsing.validation import suggest, validate
from stagectl.config.parsing.yaml_nodes import load_document, parse_document
from stagectl.config.profiles.model import Profile
from stagectl.errors import ConfigError

FOLDER = "drives"
"""Beside a machine file: profiles that are chosen by identity."""

Key = tuple[int, int, int | None]
"""Vendor, product, and major revision or None."""


def _packaged() -> Traversable:
    return resources.files("stagectl") / "data" / "drives"


def families() -> list[str]:
    """Names of the packaged profiles."""
    return sorted(
        entry.name.removesuffix(".yaml")
        for entry in _packaged().iterdir()
        if entry.name.endswith(".yaml")
    )


@cache
def load_profile(family: str) -> Profile:
    """A packaged profile.

    Raises:
        ConfigError: there is none of this name.
    """
    if family not in families():
        raise ConfigError(f"no drive profile {family}{suggest(family, families())}")
    text = (_packaged() / f"{family}.yaml").read_text(encoding="utf-8")
    return parse_profile(text, f"{family}.yaml (packaged)")


def parse_profile(text: str, name: str) -> Profile:
    """The profile of a text; messages call it `name`.

    Raises:
        ConfigError: it cannot be used; one line per problem.
    """
    return validate(parse_document(text, name), Profile)


def profile_of(machine: Machine, name: str, eds: Path | None) -> Profile | None:
    """The profile of an axis' drive, None where there is none.

    Args:
        machine: whose axis.
        name: of the axis.
        eds: of its drive; None: a virtual drive, whose identity says nothing.

    Raises:
        ConfigError: the profile that the machine file names does not exist, is not of the device
            that the EDS describes, or a profile cannot be used.
    """
    axis = machine.axes[name]
    own = None if eds is None else _identity(eds)
    if axis.drive.profile is None:
        if own is None:
            return None
        return next((p for p in _candidates(machine) if _agree(_key(p), own)), None)
    found = _named(machine, name, axis)
    wanted = _key(found)
    if wanted is not None and own is not None and not _agree(wanted, own):
        reason = f"{found.family} is of another device than the EDS describes (0x1018)"
        raise ConfigError(machine.document.problem(("axes", name, "drive", "profile"), reason))
    return found


def _named(machine: Machine, name: str, axis: Axis) -> Profile:
    given = str(axis.drive.profile)
    if given.endswith(".yaml"):
        return validate(load_document(Path(machine.source).parent / given), Profile)
    try:
        return load_profile(given)
    except ConfigError as error:
        where = ("axes", name, "drive", "profile")
        raise ConfigError(machine.document.problem(where, str(error))) from None


def _candidates(machine: Machine) -> Iterator[Profile]:
    beside = Path(machine.source).parent / FOLDER
    if Path(machine.source).is_file() and beside.is_dir():
        for path in sorted(beside.glob("*.yaml")):
            yield validate(load_document(path), Profile)
    for family in families():
        yield load_profile(family)


def _key(profile: Profile) -> Key | None:
    found = profile.identity
    if found is None:
        return None
    revision = None if found.revision is None else found.revision.value >> 16
    return found.vendor.value, found.product.value, revision


def _agree(wanted: Key | None, own: Key) -> bool:
    if wanted is None or wanted[:2] != own[:2]:
        return False
    return wanted[2] is None or own[2] is None or wanted[2] == own[2]


def _identity(eds: Path) -> Key | None:
    """Identity in an EDS, read without the rest of it; None where it does not state one."""
    parser = configparser.RawConfigParser(strict=False, allow_no_value=True)
    try:
        parser.read(eds, encoding="latin-1")
    except configparser.Error:
        return None  # the driver says what is wrong with it
    found = [
        _integer(parser, f"1018sub{sub}", "DefaultValue") or _integer(parser, "DeviceInfo", key)
        for sub, key in ((1, "VendorNumber"), (2, "ProductNumber"), (3, "RevisionNumber"))
    ]
    if not (found[0] and found[1]):
        return None
    return found[0], found[1], None if found[2] is None else found[2] >> 16


def _integer(parser: configparser.RawConfigParser, section: str, key: str) -> int | None:
    try:
        return int(parser.get(section, key), 0)
    except (configparser.Error, TypeError, ValueError):
        return None
