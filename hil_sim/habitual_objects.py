"""What habits make of a virtual drive's object dictionary."""

from __future__ import annotations

import copy
from collections.abc import Callable

from canopen.objectdictionary import ODVariable, datatypes
from canopen.sdo import constants as abort

from hil_sim.cia301 import Dictionary, key, require
from hil_sim.habits import Habits

_RATED_FORCE = key(0x6076)
_PDOS = 4
_INVALID = 1 << 31


def adopt(dictionary: Dictionary, habits: Habits) -> None:
    """Changes objects and their values after power-on, before anything is made of them."""
    rated = dictionary.integer(_RATED_FORCE) * 1e-3 / habits.rated_force_unit
    preset = {_RATED_FORCE: round(rated)} | dict(habits.values) | dict(habits.only)
    absent = {*habits.absent}
    for number in range(habits.tpdos or _PDOS, _PDOS):
        preset[key(0x1800 + number, 1)] = _INVALID
        absent |= {k for k in dictionary.variables if k >> 8 in (0x1800 + number, 0x1A00 + number)}
    for mapping in (base + number for base in (0x1600, 0x1A00) for number in range(_PDOS)):
        entries = {dictionary.integer(key(mapping, sub)) >> 8 for sub in range(1, 9)}
        if entries & absent:  # nobody can map what is not there
            preset[key(mapping)] = 0
    dictionary.preset(preset)
    for k in absent & dictionary.variables.keys():
        del dictionary.variables[k]
    for k in habits.wide:
        dictionary.variables[k] = _widened(dictionary.variables[k])


def guard(dictionary: Dictionary, habits: Habits) -> None:
    """Refuses values, or ignores them; after the drive's own checks are in place."""
    for k, value in habits.only:
        _check(dictionary, k, value, value)
    for k, low, high in habits.limits:
        _check(dictionary, k, low, high)
    for index in (0x1600, 0x1A00) if habits.pdo_entries else ():
        for number in range(_PDOS):
            k = key(index + number)
            _check(dictionary, k, 0, habits.pdo_entries, abort.ABORT_PDO_LENGTH_EXCEEDED)
    for k in habits.silent:
        dictionary.on_write[k] = _keeper(dictionary, k)


def _check(
    dictionary: Dictionary, k: int, low: int, high: int, code: int = abort.ABORT_INVALID_VALUE
) -> None:
    """Refuses values outside [low, high], besides those that are refused already."""
    before = dictionary.check.get(k)

    def check(value: int) -> None:
        require(low <= value <= high, code)
        if before is not None:
            before(value)

    dictionary.check[k] = check


def _keeper(dictionary: Dictionary, k: int) -> Callable[[int], None]:
    kept = dictionary.values[k]
    return lambda _: dictionary.values.update({k: kept})


def _widened(variable: ODVariable) -> ODVariable:
    wide = copy.copy(variable)
    wide.data_type = datatypes.INTEGER32
    return wide
