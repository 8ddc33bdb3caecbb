"""What an effect is: a physical term that the simulator can add to an axis.

An effect is an object of a subclass of `Effect`: name, parameters with units and the ranges that
real stages show, equation, usual remedy, how a host that knows it makes up for it, and `apply`,
which writes the term into the plant's ports (`hil_sim.effects.ports`). Names, keys, ranges and
equations of the library: docs/formats/effects.md.
"""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from hil_sim.effects.parameter import Parameter, Value
from hil_sim.effects.ports import EffectPorts
from hil_sim.settings import AxisSettings

Group = Literal["mass", "motor", "friction", "force", "dynamics"]
Values = Mapping[str, float]
"""Checked values by key, of an effect without tables."""
GROUPS: tuple[Group, ...] = ("mass", "motor", "friction", "force", "dynamics")


@dataclass(frozen=True, slots=True)
class Compensation:
    """Whether and how a host makes up for an effect that its machine file names.

    Attributes:
        text: a clause: how, or why not.
        inverse: the host's own equation as "module:function", called with
            `estimation.known_effects.KnownTerms` and the value of each key; it shares no code with
            `Effect.apply`. Without ":function" it is the one named like the effect. None: not
            compensated.
    """

    text: str
    inverse: str | None = None


HOST = "estimation.known_effects.inverses"
"""Where the host has its equations of this library's effects, each named like the effect."""
FED_FORWARD = Compensation("fed forward along the planned path", HOST)
STARTED_WITH = Compensation("in the figures that the host starts from", HOST)
FRICTION_FACTOR = Compensation(
    "a factor on the Coulomb force of the friction model along the planned path", HOST
)


class Effect(ABC):
    """A physical term with a name; the class docstring says what causes it on real stages.

    Attributes:
        name: as in machine files and reports, lower case with underscores; where a class gives
            none, that of its module.
        group: the part of the axis it belongs to.
        parameters: all required.
        equation: as in docs/formats/effects.md.
        enters: how it enters the plant, in a sentence.
        remedy: what is usually done about it, in a sentence.
        compensation: what a host that knows the effect does about it.
        searched: a diagnosis searches for it. False if an ordinary recording cannot show it: the
            parameter is a seed, the place is off the path.
        any_size: it only changes a figure that every machine has, or pulls one way: no size of it
            is implausible.
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
    any_size: ClassVar[bool] = False
    transmission: ClassVar[bool] = False

    def __init_subclass__(cls) -> None:
        if "name" not in vars(cls):
            cls.name = cls.__module__.rpartition(".")[2]

    @abstractmethod
    def apply(self, ports: EffectPorts, parameters: Values) -> None:
        """Write the term into the ports of its axis.

        Args:
            ports: of the axis; other effects may have written to them already.
            parameters: a checked value for each key.

        Raises:
            ValueError: the ports cannot accept these values; the message is shown to the user.
        """

    def refusal(self, parameters: Values, axis: AxisSettings) -> str | None:
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
