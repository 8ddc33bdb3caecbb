"""Limits, windows, option codes and homing that a drive is given, and what it makes of them.

Drives round to a grid of their own, clamp to what they can do, or have a value fixed. What an
object holds in the end counts, by these rules: a value rounded by 1 % or one unit is taken; a
clamped one where that is the safe side (less force, a smaller window, a narrower travel, slower);
another reaction to a stop is taken and said. Anything else is refused. What a drive does without
its host (0x6007) is `host_watch.py`'s. The host goes by what the drive has.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum, auto

from drivers import objects as od
from drivers.canopen import RemoteObjects
from drivers.errors import ConfigurationError, NodeError
from drivers.objects import ObjectRef
from drivers.settings import AxisSettings

ROUNDING = 0.01
"""What drives may round by, relative; one unit is always allowed."""
PLACE_ROUNDING = 1e-6
"""The same of positions: an end of the travel must not move by 1 %."""
HOMING_ACCELERATION = 1.0

_MISSED = {
    od.FOLLOWING_ERROR_WINDOW: "the drive does not watch the following error as asked",
    od.QUICK_STOP_OPTION: "how it stops on a quick stop is the drive's own matter",
    od.SOFT_LIMIT_HIGH: "only the host watches the travel",
}
"""What is missing without these objects."""

_COASTS = "it switches the power off and the axis coasts, nothing brakes it"
_BRAKES = {
    0: _COASTS,
    1: "it brakes on the profile's ramp",
    2: "it brakes on the quick-stop ramp",
    3: "it brakes at its current limit",
    4: "it brakes at its voltage limit",
}
_REACTIONS: dict[ObjectRef, tuple[str, dict[int, str]]] = {
    od.QUICK_STOP_OPTION: (
        "on a quick stop, that for a lost host included,",
        _BRAKES | {n + 4: f"{_BRAKES[n]} and holds there" for n in (1, 2, 3, 4)},
    ),
    od.SHUTDOWN_OPTION: ("on shutdown", _BRAKES),
    od.DISABLE_OPTION: ("when disabled", _BRAKES),
    od.HALT_OPTION: ("on a halt", _BRAKES),
    od.FAULT_REACTION_OPTION: ("on a fault", _BRAKES),
}
"""When an option code counts, and what its values mean (CiA 402)."""


class Rule(Enum):
    """Which value besides the one asked for is taken."""

    EXACT = auto()
    ROUNDED = auto()
    LESS = auto()
    ABOVE = auto()
    BELOW = auto()
    ANY = auto()


@dataclass(frozen=True, slots=True)
class Parameter:
    """One object and what it is to hold.

    Attributes:
        object: the object.  value: asked for, in the drive's unit.
        rule: what else is taken: ROUNDED; besides that LESS, but not 0; a lower end of the travel
            ABOVE, an upper one BELOW; or ANY.
        unit: one unit of it in SI.  dimension: that SI unit.
        consequence: of a value that is not just rounded.
    """

    object: ObjectRef
    value: int
    rule: Rule = Rule.EXACT
    unit: float = 1.0
    dimension: str = ""
    consequence: str = ""

    def rounded(self, held: int) -> bool:
        """Whether the drive has only rounded."""
        share = PLACE_ROUNDING if self.rule in (Rule.ABOVE, Rule.BELOW) else ROUNDING
        near = abs(held - self.value) <= max(1.0, share * abs(self.value))
        return near and self.rule is not Rule.EXACT and (held != 0 or self.value == 0)

    def taken(self, held: int) -> bool:
        """Whether the axis can do with what the drive holds."""
        if held == self.value or self.rounded(held):
            return True
        match self.rule:
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
        """One clause on a value that is not the one asked for."""
        has, asked = f"{held * self.unit:.6g}", f"{self.value * self.unit:.6g}"
        if has == asked:
            has, asked = f"{held * self.unit:.10g}", f"{self.value * self.unit:.10g}"
        what = "the drive rounds it" if self.rounded(held) else self.consequence
        return f"{self.object} is {has} {self.dimension}, not {asked} {self.dimension}: {what}"


def give(node: RemoteObjects, asked: AxisSettings) -> tuple[AxisSettings, list[str]]:
    """Writes an axis' settings into its drive, where the drive does not hold them already.

    Returns:
        The settings as the drive has them, and what is missing or different, one clause each.

    Raises:
        ConfigurationError: the drive holds a value that is none to go by.
        NodeError: no answer, or a write refused where the value held is none to go by.
    """
    clauses: list[str] = []
    for ref, code in _option_codes(asked):
        clauses += _give_option(node, ref, code)
    held: dict[ObjectRef, float] = {}
    for parameter in _parameters(asked):
        ref = parameter.object
        value, said = _give(node, parameter)
        if value is None:
            if ref in _MISSED:
                clauses.append(f"{ref} is not offered: {_MISSED[ref]}")
        elif said is not None:
            clauses.append(said)
            held[ref] = value * parameter.unit
    return _as_held(asked, held), clauses


def give_profile(
    node: RemoteObjects, settings: AxisSettings, velocity: float, acceleration: float
) -> tuple[float, dict[ObjectRef, str | None]]:
    """Writes velocity [m/s] and acceleration [m/s^2] of the drive's own profiles (pp).

    Returns:
        How many times longer than asked for a move takes at most, and for each object a clause
        on what it holds, None where that is what was asked for.

    Raises:
        ConfigurationError, NodeError: as `give`.
    """
    speed, rate = settings.velocity_unit_si, settings.acceleration_unit
    slower, clauses = 1.0, dict[ObjectRef, str | None]()
    for ref, value, unit, dimension in (
        (od.PROFILE_VELOCITY, velocity, speed, "m/s"),
        (od.PROFILE_ACCELERATION, acceleration, rate, "m/s^2"),
        (od.PROFILE_DECELERATION, acceleration, rate, "m/s^2"),
    ):
        wanted = Parameter(
            ref, round(value / unit), Rule.LESS, unit, dimension, "the move takes longer"
        )
        held, clauses[ref] = _give(node, wanted)
        if held is None:
            raise ConfigurationError("is not offered", axis=settings.name, obj=ref)
        if held:
            slower = max(slower, wanted.value / held)
    return slower, clauses


def _option_codes(s: AxisSettings) -> tuple[tuple[ObjectRef, int], ...]:
    return (
        (od.QUICK_STOP_OPTION, s.options.quick_stop),
        (od.FAULT_REACTION_OPTION, s.options.fault_reaction),
        (od.SHUTDOWN_OPTION, s.options.shutdown),
        (od.DISABLE_OPTION, s.options.disable),
        (od.HALT_OPTION, s.options.halt),
    )


def _parameters(s: AxisSettings) -> tuple[Parameter, ...]:
    length, speed, rate = s.increment, s.velocity_unit_si, s.acceleration_unit
    force = s.rated_force / 1000
    search, index = s.homing_velocity
    homing = min(HOMING_ACCELERATION, s.acceleration)
    sooner, slower = "the drive faults sooner", "homing is slower"
    beyond, window = "set-points beyond it are refused", "the drive's own moves end by that"
    return (
        Parameter(od.QUICK_STOP_DECELERATION, round(s.acceleration / rate), Rule.ROUNDED,
                  rate, "m/s^2"),
        Parameter(od.FOLLOWING_ERROR_WINDOW, round(s.following_error / length), Rule.LESS,
                  length, "m", sooner),
        Parameter(od.FOLLOWING_ERROR_TIMEOUT, round(s.following_error_time * 1e3), Rule.LESS,
                  1e-3, "s", sooner),
        Parameter(od.POSITION_WINDOW, round(s.position_window / length), Rule.ANY,
                  length, "m", window),
        Parameter(od.POSITION_WINDOW_TIME, round(s.position_window_time * 1e3), Rule.ANY,
                  1e-3, "s", window),
        Parameter(od.MAX_FORCE, round(s.peak_force / force), Rule.LESS,
                  force, "N", "there is no more force than that"),
        Parameter(od.SOFT_LIMIT_LOW, round(s.travel[0] / length), Rule.ABOVE, length, "m", beyond),
        Parameter(od.SOFT_LIMIT_HIGH, round(s.travel[1] / length), Rule.BELOW, length, "m", beyond),
        Parameter(od.HOME_OFFSET, 0),
        Parameter(od.HOMING_METHOD, s.homing_method),
        Parameter(od.HOMING_SEARCH_SPEED, round(search / speed), Rule.LESS, speed, "m/s", slower),
        Parameter(od.HOMING_INDEX_SPEED, round(index / speed), Rule.LESS, speed, "m/s", slower),
        Parameter(od.HOMING_ACCELERATION, round(homing / rate), Rule.LESS, rate, "m/s^2", slower),
    )  # fmt: skip


def _give(node: RemoteObjects, wanted: Parameter) -> tuple[int | None, str | None]:
    """What the object holds in the end (None: there is none), and what is to be said of it."""
    kept = node.keep(wanted.object, wanted.value)
    if kept is None:
        return None, None
    held, refusal = kept
    if held == wanted.value:
        return held, None
    if wanted.taken(held):
        return held, wanted.describe(held) + _because(refusal)
    raise node.not_kept(wanted.object, wanted.value, held, refusal)


def _give_option(node: RemoteObjects, ref: ObjectRef, code: int) -> list[str]:
    kept = node.keep(ref, code)
    if kept is None:
        return [f"{ref} is not offered: {_MISSED[ref]}"] if ref in _MISSED else []
    held, refusal = kept
    if held == code:
        return []
    when, meanings = _REACTIONS[ref]
    meaning = meanings.get(held, "the drive does what its maker has it do")
    return [f"{ref} is {held}, not {code}: {when} {meaning}{_because(refusal)}"]


def _because(refusal: NodeError | None) -> str:
    return "" if refusal is None else f" ({refusal.cause})"


def _as_held(asked: AxisSettings, held: dict[ObjectRef, float]) -> AxisSettings:
    """The settings within what the drive has, which may be less than was asked for."""

    def least(ref: ObjectRef, value: float) -> float:
        return min(value, held.get(ref, value))

    low, high = asked.travel
    search, index = asked.homing_velocity
    return replace(
        asked,
        travel=(max(low, held.get(od.SOFT_LIMIT_LOW, low)), least(od.SOFT_LIMIT_HIGH, high)),
        following_error=least(od.FOLLOWING_ERROR_WINDOW, asked.following_error),
        peak_force=least(od.MAX_FORCE, asked.peak_force),
        homing_velocity=(
            least(od.HOMING_SEARCH_SPEED, search), least(od.HOMING_INDEX_SPEED, index),
        ),
    )  # fmt: skip
