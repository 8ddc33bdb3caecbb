"""Parameters of effects: what their values mean, are usually, and can be.

`size`, `shape`, `place` and `phase` make one of that role; `factor`, `share`, `pitch` and
`oscillator` make what several effects have.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np

from hil_sim.settings import AxisSettings

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
            table = np.asarray(value, np.float64)  # a force over time has thousands of values
            within = (table > self.above) & (table >= self.least) & (table < self.below)
            refused = np.flatnonzero(~(within & np.isfinite(table)))
            first = int(refused[0]) if len(refused) else None
            return None if first is None else f"value {first + 1}: {self._refusal(value[first])}"
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


size = partial(Parameter, neutral=0.0)
"""A parameter at whose neutral value there is no effect."""
shape = partial(Parameter, role="shape", log=True)
"""A parameter > 0 whose logarithm is searched."""


def place(key: str, meaning: str) -> Parameter:
    """A position anywhere on the travel."""
    return Parameter(key, "m", meaning, role="place")


def phase(meaning: str = "phase at position 0") -> Parameter:
    """An angle."""
    return Parameter("phase", "rad", meaning, role="phase")


def factor(meaning: str, plausible: Interval) -> Parameter:
    """A ratio that multiplies a figure of the axis."""
    return size("ratio", "", meaning, plausible, neutral=1.0, above=0.0)


def share(meaning: str, plausible: Interval, signed: bool = False) -> Parameter:
    """A ratio by which a figure of the axis grows here and falls there."""
    return size("ratio", "", meaning, plausible, signed=signed, above=-1.0, below=1.0)


def asymmetry(plausible: Interval) -> Parameter:
    """The share by which a figure differs with the direction of motion."""
    meaning = "half the difference between the directions over their mean"
    return share(meaning, plausible, signed=True)


def force(
    key: str, meaning: str, plausible: Interval, signed: bool = False, least: float = -math.inf
) -> Parameter:
    """A force [N] that vanishes at 0, its range in multiples of the Coulomb force."""
    relative = "Coulomb force"
    return size(key, "N", meaning, plausible, signed=signed, least=least, relative_to=relative)


def mass(meaning: str, plausible: Interval) -> Parameter:
    """A mass [kg] of either sign, its range in multiples of the axis'."""
    return size("mass", "kg", meaning, plausible, signed=True, relative_to="mass")


def pitch(plausible: Interval, turning: Interval, least: float = 1e-3) -> Parameter:
    """A spatial period [m], or angle [rad] of an axis that turns."""
    meaning = "spatial period"
    return shape("pitch", "m", meaning, plausible, least=least, plausible_turning=turning)


def oscillator(
    frequency: tuple[str, Interval], damping: tuple[str, Interval], mass_ratio: tuple[str, Interval]
) -> tuple[Parameter, ...]:
    """Frequency [Hz], damping ratio and mass ratio of a mass on a spring and damper.

    Args:
        frequency: meaning and plausible range.
        damping: likewise.
        mass_ratio: likewise.
    """
    return (
        shape("frequency", "Hz", *frequency, above=0.0, below=1500.0),
        shape("damping", "", *damping, least=0.0, below=1.0),
        size("mass_ratio", "", *mass_ratio, least=0.0, below=1.0),
    )
