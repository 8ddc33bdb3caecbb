"""Limits, windows, option codes and homing: written to the drive, and judged by what it holds then.

Drives round values, clamp them to their range or have them fixed. Accepted are values rounded by
1 % or one unit; values clamped to the safe side (less force, smaller window, narrower travel,
slower); a quick stop that brakes half to twice as hard; other reactions to a stop. All of them are
reported, all else is refused. The host uses the values that the drive holds. The reaction to a lost
host (0x6007) is in `host_loss.py`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import Enum, auto

from drivers import objects as od
from drivers.canopen import RemoteObjects
from drivers.drive.scaling import counts, dimension, unit
from drivers.errors import ConfigurationError, NodeError
from drivers.objects import ObjectRef
from drivers.settings import AxisSettings

ROUNDING = 0.01
"""Accepted rounding, relative; one unit is always accepted."""
POSITION_ROUNDING = 1e-6
"""The same for positions: the end of the travel must not move by 1 %."""
HOMING_ACCELERATION = 1.0

_MISSING = {
    od.FOLLOWING_ERROR_WINDOW: "the drive does not monitor the following error as requested",
    od.QUICK_STOP_OPTION: "its reaction to a quick stop is manufacturer specific",
    od.FAULT_REACTION_OPTION: "its reaction to a fault is manufacturer specific",
    od.QUICK_STOP_DECELERATION: "how hard it brakes on a quick stop is not known",
    od.MAX_FORCE: "nothing but its own set-up limits the force",
    od.SOFT_LIMIT_HIGH: "only the host monitors the travel",
}
"""Consequence where these objects are not offered."""

_COASTS = "it switches the power off and the axis coasts, nothing brakes it"
_BRAKES = {
    0: _COASTS,
    1: "it brakes on the profile's ramp",
    2: "it brakes on the quick-stop ramp",
    3: "it brakes at its current limit",
    4: "it brakes at its voltage limit",
}
_HOLDS = {n + 4: f"{_BRAKES[n]} and holds there" for n in (1, 2, 3, 4)}
_OPTIONS = (
    (od.QUICK_STOP_OPTION, "quick_stop", "on a quick stop, also when the host is lost,"),
    (od.FAULT_REACTION_OPTION, "fault_reaction", "on a fault"),
    (od.SHUTDOWN_OPTION, "shutdown", "on shutdown"),
    (od.DISABLE_OPTION, "disable", "when disabled"),
    (od.HALT_OPTION, "halt", "on a halt"),
)
"""Option codes: the object, its field in `OptionCodes`, when it applies."""


class Rule(Enum):
    """Which values besides the requested one are accepted."""

    EXACT = auto()
    ROUNDED = auto()
    NEAR = auto()
    LESS = auto()
    ABOVE = auto()
    BELOW = auto()
    ANY = auto()


@dataclass(frozen=True, slots=True)
class Parameter:
    """One object and the value it is to hold.

    Attributes:
        object: the object.  value: requested, in the drive's unit.
        rule: what else is accepted: ROUNDED values; with the other rules also NEAR ones (half to
            twice), LESS but not 0, ABOVE or BELOW (ends of the travel, and times of which 0 is the
            shortest), or ANY.
        unit: SI value of one unit.  dimension: that SI unit.
        consequence: of a value that is not merely rounded.
    """

    object: ObjectRef
    value: int
    rule: Rule = Rule.EXACT
    unit: float = 1.0
    dimension: str = ""
    consequence: str = ""

    def is_rounded(self, held: int) -> bool:
        """Whether the drive holds the requested value rounded."""
        share = POSITION_ROUNDING if self.rule in (Rule.ABOVE, Rule.BELOW) else ROUNDING
        near = abs(held - self.value) <= max(1.0, share * abs(self.value))
        return near and self.rule is not Rule.EXACT and (held != 0 or self.value == 0)

    def is_accepted(self, held: int) -> bool:
        """Whether the axis can be operated with the value that the drive holds."""
        if held == self.value or self.is_rounded(held):
            return True
        match self.rule:
            case Rule.NEAR:
                return self.value <= 2 * held <= 4 * self.value
            case Rule.LESS:
                return 0 < held < self.value
            case Rule.ABOVE:
                return held > self.value
            case Rule.BELOW:
                return held < self.value
            case Rule.ANY:
                return True
        return False

    def describe(self, held: int) -> str:
        """One clause on a value other than the requested one."""
        has, asked = f"{held * self.unit:.6g}", f"{self.value * self.unit:.6g}"
        if has == asked:
            has, asked = f"{held * self.unit:.10g}", f"{self.value * self.unit:.10g}"
        what = "the drive rounds it" if self.is_rounded(held) else self.consequence
        return f"{self.object} is {has} {self.dimension}, not {asked} {self.dimension}: {what}"


def write_settings(node: RemoteObjects, requested: AxisSettings) -> tuple[AxisSettings, list[str]]:
    """Writes the settings of an axis to its drive, where the drive does not hold them already.

    Returns:
        The settings as the drive holds them, and what is missing or different, one clause each.

    Raises:
        ConfigurationError: the drive holds a value that is not accepted.
        NodeError: no answer, or a write is refused and the value held is not accepted.
    """
    clauses: list[str] = []
    for ref, name, when in _OPTIONS:
        clauses += _write_option(node, ref, getattr(requested.options, name), when)
    held: dict[ObjectRef, float] = {}
    raw: dict[ObjectRef, int] = {}
    for parameter in _parameters(requested):
        ref = parameter.object
        value, clause = _write(node, parameter)
        if value is None:
            if ref in _MISSING:
                clauses.append(f"{ref} is not offered: {_MISSING[ref]}")
            continue
        raw[ref] = value
        if clause is not None:
            clauses.append(clause)
            held[ref] = value * parameter.unit
    if raw.get(od.SOFT_LIMIT_LOW) == raw.get(od.SOFT_LIMIT_HIGH) == 0:  # CiA 402: no limits
        for ref in (od.SOFT_LIMIT_LOW, od.SOFT_LIMIT_HIGH):
            held.pop(ref, None)
            clauses = [clause for clause in clauses if not clause.startswith(f"{ref} ")]
        clauses.append(f"{od.SOFT_LIMIT_HIGH} is 0, as the lower one: {_MISSING[ref]}")
    return _as_held(requested, held), clauses


def write_profile(
    node: RemoteObjects, settings: AxisSettings, velocity: float, acceleration: float
) -> tuple[float, dict[ObjectRef, str | None]]:
    """Writes velocity [m/s] and acceleration [m/s^2] of the drive's own profiles (pp).

    Returns:
        Largest factor by which moves take longer than requested; for each object a clause where it
        holds another value than requested, else None.

    Raises:
        ConfigurationError, NodeError: as `write_settings`.
    """
    slower, clauses = 1.0, dict[ObjectRef, str | None]()
    for ref, value in (
        (od.PROFILE_VELOCITY, velocity),
        (od.PROFILE_ACCELERATION, acceleration),
        (od.PROFILE_DECELERATION, acceleration),
    ):
        wanted = _parameter(settings, ref, value, Rule.LESS, "the move takes longer")
        held, clauses[ref] = _write(node, wanted)
        if held is None:
            raise ConfigurationError("is not offered", axis=settings.name, obj=ref)
        if held:
            slower = max(slower, value / (held * wanted.unit))
    return slower, clauses


def _parameters(s: AxisSettings) -> Iterator[Parameter]:
    search, index = s.homing_velocity
    low, high = s.travel
    sooner, slower = "the drive faults sooner", "homing is slower"
    beyond, window = "setpoints beyond it are refused", "the drive's own moves end by that"
    for row in (
        (od.QUICK_STOP_DECELERATION, s.acceleration, Rule.NEAR, "quick stops brake by that"),
        (od.FOLLOWING_ERROR_WINDOW, s.following_error, Rule.LESS, sooner),
        (od.FOLLOWING_ERROR_TIMEOUT, s.following_error_time, Rule.BELOW, sooner),
        (od.POSITION_WINDOW, s.position_window, Rule.ANY, window),
        (od.POSITION_WINDOW_TIME, s.position_window_time, Rule.ANY, window),
        (od.MAX_FORCE, s.peak_force, Rule.LESS, "there is no more force than that"),
        (od.SOFT_LIMIT_LOW, low, Rule.ABOVE, beyond),
        (od.SOFT_LIMIT_HIGH, high, Rule.BELOW, beyond),
        (od.HOME_OFFSET, 0.0),
        (od.HOMING_METHOD, s.homing_method),
        (od.HOMING_SEARCH_SPEED, search, Rule.LESS, slower),
        (od.HOMING_INDEX_SPEED, index, Rule.LESS, slower),
        (od.HOMING_ACCELERATION, min(HOMING_ACCELERATION, s.acceleration), Rule.LESS, slower),
    ):
        yield _parameter(s, *row)


def _parameter(
    axis: AxisSettings,
    ref: ObjectRef,
    value: float,
    rule: Rule = Rule.EXACT,
    consequence: str = "",
) -> Parameter:
    """An object that is to hold an SI value."""
    one, si = unit(axis, ref), dimension(axis, ref)
    return Parameter(ref, counts(axis, ref, value), rule, one, si, consequence)


def _write(node: RemoteObjects, wanted: Parameter) -> tuple[int | None, str | None]:
    """What the object holds (None: it is not offered), and a clause where that differs."""
    result = node.write_if_accepted(wanted.object, wanted.value)
    if result is None:
        return None, None
    held, refusal = result
    if held == wanted.value:
        return held, None
    if wanted.is_accepted(held):
        return held, wanted.describe(held) + _because(refusal)
    raise node.mismatch(wanted.object, wanted.value, held, refusal)


def _write_option(node: RemoteObjects, ref: ObjectRef, code: int, when: str) -> list[str]:
    result = node.write_if_accepted(ref, code)
    if result is None:
        return [f"{ref} is not offered: {_MISSING[ref]}"] if ref in _MISSING else []
    held, refusal = result
    if held == code:
        return []
    meanings = _BRAKES | (_HOLDS if ref == od.QUICK_STOP_OPTION else {})
    meaning = meanings.get(held, "the reaction is manufacturer specific")
    return [f"{ref} is {held}, not {code}: {when} {meaning}{_because(refusal)}"]


def _because(refusal: NodeError | None) -> str:
    return "" if refusal is None else f" ({refusal.cause})"


def _as_held(requested: AxisSettings, held: dict[ObjectRef, float]) -> AxisSettings:
    """The settings limited to the values that the drive holds."""

    def least(ref: ObjectRef, value: float) -> float:
        return min(value, held.get(ref, value))

    low, high = requested.travel
    search, index = requested.homing_velocity
    return replace(
        requested,
        travel=(max(low, held.get(od.SOFT_LIMIT_LOW, low)), least(od.SOFT_LIMIT_HIGH, high)),
        following_error=least(od.FOLLOWING_ERROR_WINDOW, requested.following_error),
        peak_force=least(od.MAX_FORCE, requested.peak_force),
        homing_velocity=(
            least(od.HOMING_SEARCH_SPEED, search), least(od.HOMING_INDEX_SPEED, index),
        ),
    )  # fmt: skip
