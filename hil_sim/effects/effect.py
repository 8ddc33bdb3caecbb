"""What an effect is: a physical term that the simulator can switch on for an axis.

An effect is one object of a subclass of `Effect`: name, parameters with units and the ranges that
real stages show, the equation, the usual remedy, and `apply`, which writes the term into the
plant's ports (`hil_sim.effects.ports`). Its docstring says where it comes from on real stages.
Names, keys and equations of the library: docs/formats/effects.md.
"""

from __future__ import annotations

import inspect
import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

from hil_sim.effects.ports import EffectPorts
from hil_sim.settings import AxisSettings

Group = Literal["mass", "motor", "friction", "force", "dynamics"]
GROUPS: tuple[Group, ...] = ("mass", "motor", "friction", "force", "dynamics")

_AXIS_FIGURES = {
    "mass": lambda axis: axis.mass,
    "rated force": lambda axis: axis.control.rated_force,
    "static_ratio": lambda axis: axis.friction.static_ratio,
    "current_bandwidth": lambda axis: axis.control.current_bandwidth,
}

Interval = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter of an effect.

    Attributes:
        key: as in machine files.
        unit: SI, "" where it has none.
        meaning: in a few words.
        role: "size" parameters make the effect vanish at `neutral`; "place" is a position,
            "phase" an angle (period 2 pi), "shape" anything else.
        plausible: lowest and highest value that real stages show, in SI units or, with
            `relative_to`, in multiples of that figure of the axis; None: anywhere on the travel
            (place), any angle (phase). What real stages show, not a bound.
        signed: the same range with the other sign is as plausible.
        relative_to: figure of the axis ("mass", "rated force") that `plausible` multiplies.
        neutral: value of a size parameter at which there is no effect; a text names the figure of
            the axis that it equals. None: not a size parameter.
        above: physics asks for a value > this.
        least: physics asks for a value >= this.
        below: physics asks for a value < this.
        log: its scale is a ratio's: search and prior are best in the logarithm.
    """

    key: str
    unit: str
    meaning: str
    plausible: Interval | None = None
    role: Literal["size", "shape", "place", "phase"] = "size"
    signed: bool = False
    relative_to: str | None = None
    neutral: float | str | None = None
    above: float = -math.inf
    least: float = -math.inf
    below: float = math.inf
    log: bool = False

    def ranges(self, axis: AxisSettings) -> tuple[Interval, ...]:
        """Plausible values on this axis, SI units: one interval, or two where both signs are."""
        if self.plausible is None:
            return (axis.travel,) if self.role == "place" else ((0.0, 2.0 * math.pi),)
        scale = 1.0 if self.relative_to is None else _AXIS_FIGURES[self.relative_to](axis)
        low, high = (scale * value for value in self.plausible)
        return ((-high, -low), (low, high)) if self.signed else ((low, high),)

    def neutral_on(self, axis: AxisSettings) -> float | None:
        """The value at which a size parameter has no effect on this axis; None for the others."""
        if isinstance(self.neutral, str):
            return float(_AXIS_FIGURES[self.neutral](axis))
        return self.neutral

    def refusal(self, value: float) -> str | None:
        """Why physics does not allow the value, or None."""
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


class Effect(ABC):
    """A physical term with a name. Its docstring says where it comes from on real stages.

    Attributes:
        name: as in machine files and reports, lower case with underscores.
        group: what it is a matter of.
        parameters: all of them; each has to be given.
        equation: as in docs/formats/effects.md.
        enters: how it enters the plant, in a sentence.
        remedy: what is usually done about it, in a sentence.
        searched: whether a diagnosis looks for it in recordings. False for what an ordinary
            recording cannot show: a seed in place of a figure, a place off the path.
    """

    name: ClassVar[str]
    group: ClassVar[Group]
    parameters: ClassVar[tuple[Parameter, ...]]
    equation: ClassVar[str]
    enters: ClassVar[str]
    remedy: ClassVar[str]
    searched: ClassVar[bool] = True

    @abstractmethod
    def apply(self, ports: EffectPorts, parameters: Mapping[str, float]) -> None:
        """Write the term into the ports of its axis.

        Args:
            ports: of the axis; other effects may have written to them before.
            parameters: a value for each key, checked.

        Raises:
            ValueError: the ports can't take these values; the message is shown to the user.
        """

    def refusal(self, parameters: Mapping[str, float], axis: AxisSettings) -> str | None:
        """Why physics does not allow these values together on this axis, or None."""
        return None

    def check(self, parameters: Mapping[str, float], axis: AxisSettings | None = None) -> None:
        """Raise unless every key is there, no other is, and all values are physical.

        Raises:
            ValueError: the first problem, in words for the user.
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

    def at(self, **parameters: float) -> AppliedEffect:
        """This effect with these values.

        Raises:
            ValueError: as `check`.
        """
        self.check(parameters)
        return AppliedEffect(self, tuple((p.key, parameters[p.key]) for p in self.parameters))

    @classmethod
    def origin(cls) -> str:
        """Where it comes from on real stages: the docstring on one line."""
        return " ".join(inspect.cleandoc(cls.__doc__ or "").split())


@dataclass(frozen=True, slots=True)
class AppliedEffect:
    """An effect with values, as switched on for an axis.

    Attributes:
        effect: which.
        values: (key, value) in the order of its parameters.
    """

    effect: Effect
    values: tuple[tuple[str, float], ...]

    @property
    def parameters(self) -> dict[str, float]:
        """Key -> value."""
        return dict(self.values)

    def apply(self, ports: EffectPorts) -> None:
        """Write it into the ports.

        Raises:
            ValueError: naming effect and key.
        """
        parameters = self.parameters
        try:
            self.effect.check(parameters, ports.axis)
            self.effect.apply(ports, parameters)
        except ValueError as error:
            raise ValueError(f"{self.effect.name}: {error}") from error
