"""What an effect is: a physical term that the simulator can add to an axis.

An effect is an object of a subclass of `Effect`: name, parameters with units and the ranges that
real stages show, equation, usual remedy, how a host that knows it makes up for it, and `apply`,
which writes the term into the plant's ports (`hil_sim.effects.ports`). Names, keys, ranges and
equations of the library: docs/formats/effects.md.
"""

from __future__ import annotations

import inspect
import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from hil_sim.effects.ports import EffectPorts
from hil_sim.settings import AxisSettings

Group = Literal["mass", "motor", "friction", "force", "dynamics"]
GROUPS: tuple[Group, ...] = ("mass", "motor", "friction", "force", "dynamics")

_LEAST_COULOMB = 0.01
"""Smallest Fc that plausible forces are multiples of, as a share of the rated force: an axis on air
bearings has disturbances, too."""


def _coulomb(axis: AxisSettings) -> float:
    return max(axis.friction.coulomb, _LEAST_COULOMB * axis.control.rated_force)


_AXIS_FIGURES = {
    "mass": lambda axis: axis.mass,
    "rated force": lambda axis: axis.control.rated_force,
    "Coulomb force": lambda axis: _coulomb(axis),
    "travel": lambda axis: axis.travel[1] - axis.travel[0],
    "velocity limit": lambda axis: axis.velocity,
    "Coulomb force over the travel": lambda axis: (
        _coulomb(axis) / (axis.travel[1] - axis.travel[0])
    ),
    "static_ratio": lambda axis: axis.friction.static_ratio,
    "current_bandwidth": lambda axis: axis.control.current_bandwidth,
}

Interval = tuple[float, float]
Value = float | tuple[float, ...]
"""Of a parameter: a number, or the values of a table."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter of an effect.

    Attributes:
        key: as in machine files.
        unit: SI, "" where it has none.
        meaning: a short noun phrase.
        role: "size" parameters make the effect vanish at `neutral`; "place" is a position,
            "phase" an angle (period 2 pi), "table" a list of numbers, "shape" anything else.
        plausible: lowest and highest value on real stages, in SI units or, with `relative_to`, in
            multiples of that value of the axis; None: anywhere on the travel (place), any angle
            (phase), anything (table). It is no limit.
        signed: the range with the opposite sign is plausible, too.
        relative_to: value of the axis ("mass", "travel", "velocity limit", "rated force", "Coulomb
            force", the same "over the travel") that `plausible` multiplies.
        neutral: value of a size parameter at which there is no effect; a string names the value of
            the axis that it equals. None: not a size parameter.
        above: a physical value is > this.
        least: a physical value is >= this.
        below: a physical value is < this.
        log: search and prior use the logarithm.
        plausible_turning: the range in place of `plausible` on an axis that turns; None: the same.
    """

    key: str
    unit: str
    meaning: str
    plausible: Interval | None = None
    role: Literal["size", "shape", "place", "phase", "table"] = "size"
    signed: bool = False
    relative_to: str | None = None
    neutral: float | str | None = None
    above: float = -math.inf
    least: float = -math.inf
    below: float = math.inf
    log: bool = False
    plausible_turning: Interval | None = None

    def ranges(self, axis: AxisSettings) -> tuple[Interval, ...]:
        """Plausible values on this axis in SI units: one interval, or two of opposite sign.

        Empty for a table.
        """
        if self.role == "table":
            return ()
        if self.plausible is None:
            return (axis.travel,) if self.role == "place" else ((0.0, 2.0 * math.pi),)
        scale = 1.0 if self.relative_to is None else _AXIS_FIGURES[self.relative_to](axis)
        usual = self.plausible
        if axis.rotary and self.plausible_turning is not None:
            usual = self.plausible_turning
        low, high = (scale * value for value in usual)
        return ((-high, -low), (low, high)) if self.signed else ((low, high),)

    def neutral_on(self, axis: AxisSettings) -> float | None:
        """Value at which a size parameter has no effect on this axis; None for other roles."""
        if isinstance(self.neutral, str):
            return float(_AXIS_FIGURES[self.neutral](axis))
        return self.neutral

    def refusal(self, value: Value) -> str | None:
        """Why the value is not physical, or None."""
        if isinstance(value, tuple) != (self.role == "table"):
            return f"must be a {'list of numbers' if self.role == 'table' else 'number'}"
        if isinstance(value, tuple):
            reasons = ((i, self._refusal(one)) for i, one in enumerate(value, 1))
            return next((f"value {i}: {reason}" for i, reason in reasons if reason), None)
        return self._refusal(value)

    def _refusal(self, value: float) -> str | None:
        if not math.isfinite(value):
            return f"must be finite, is {value!r}"
        for limit, holds, words in (
            (self.above, value > self.above, "> "),
            (self.least, value >= self.least, ">= "),
            (self.below, value < self.below, "< "),
        ):
            if not holds:
                unit = f" {self.unit}" if self.unit else ""
                return f"must be {words}{limit:g}{unit}, is {value:.12g}"
        return None


@dataclass(frozen=True, slots=True)
class Compensation:
    """Whether and how a host makes up for an effect that its machine file names.

    Attributes:
        text: a clause: how, or why not.
        inverse: the host's own equation as "module:function", called with
            `estimation.known_effects.KnownTerms` and the value of each key; it shares no code with
            `Effect.apply`. None: not compensated.
    """

    text: str
    inverse: str | None = None


class Effect(ABC):
    """A physical term with a name; the class docstring says what causes it on real stages.

    Attributes:
        name: as in machine files and reports, lower case with underscores.
        group: the part of the axis it belongs to.
        parameters: all required.
        equation: as in docs/formats/effects.md.
        enters: how it enters the plant, in a sentence.
        remedy: what is usually done about it, in a sentence.
        compensation: what a host that knows the effect does about it.
        searched: a diagnosis searches for it. False if an ordinary recording cannot show it: the
            parameter is a seed, the place is off the path.
        transmission: it comes with a screw, belt, rack or gear between motor and carriage: searched
            for where the other effects leave an axis unexplained.
    """

    name: ClassVar[str]
    group: ClassVar[Group]
    parameters: ClassVar[tuple[Parameter, ...]]
    equation: ClassVar[str]
    enters: ClassVar[str]
    remedy: ClassVar[str]
    compensation: ClassVar[Compensation] = Compensation("its package does not say how")
    searched: ClassVar[bool] = True
    transmission: ClassVar[bool] = False

    @abstractmethod
    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """Write the term into the ports of its axis.

        Args:
            ports: of the axis; other effects may have written to them already.
            parameters: a checked value for each key.

        Raises:
            ValueError: the ports cannot accept these values; the message is shown to the user.
        """

    def refusal(self, parameters: Mapping[str, float], axis: AxisSettings) -> str | None:
        """Why these values together are not physical on this axis, or None."""
        return None

    def check(self, parameters: Mapping[str, Any], axis: AxisSettings | None = None) -> None:
        """Check that exactly the keys of the effect are given and all values are physical.

        Raises:
            ValueError: the first problem, worded for the user.
        """
        known = {p.key: p for p in self.parameters}
        for key in parameters:
            if key not in known:
                raise ValueError(f"{key}: not a key of {self.name}; it has {', '.join(known)}")
        for key, parameter in known.items():
            if key not in parameters:
                raise ValueError(f"{key}: is missing")
            if reason := parameter.refusal(parameters[key]):
                raise ValueError(f"{key}: {reason}")
        if axis is not None and (reason := self.refusal(parameters, axis)):
            raise ValueError(reason)

    def at(self, **parameters: Value) -> AppliedEffect:
        """Return this effect with these values.

        Raises:
            ValueError: as `check`.
        """
        self.check(parameters)
        return AppliedEffect(self, tuple((p.key, parameters[p.key]) for p in self.parameters))

    @classmethod
    def origin(cls) -> str:
        """What causes it on real stages: the class docstring on one line."""
        return " ".join(inspect.cleandoc(cls.__doc__ or "").split())


@dataclass(frozen=True, slots=True)
class AppliedEffect:
    """An effect with values, as added to an axis.

    Attributes:
        effect: the effect.
        values: (key, value) in the order of its parameters.
    """

    effect: Effect
    values: tuple[tuple[str, Value], ...]

    @property
    def parameters(self) -> dict[str, Any]:
        """Value by key: a number, or a tuple of them for a table."""
        return dict(self.values)

    def apply(self, ports: EffectPorts) -> None:
        """Write the effect into the ports.

        Raises:
            ValueError: naming effect and key.
        """
        parameters = self.parameters
        try:
            self.effect.check(parameters, ports.axis)
            self.effect.apply(ports, parameters)
        except ValueError as error:
            raise ValueError(f"{self.effect.name}: {error}") from error
