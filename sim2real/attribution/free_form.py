"""Friction over position, recognised whatever its shape, and where to start fitting it.

Its shape is measured (`sim2real.attribution.friction_profile`). The library's effect of that kind
is the nearest that a machine file can hold.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil_sim.effects import Effect
from hil_sim.settings import AxisSettings, StageSettings
from sim2real.attribution.friction_profile import FrictionProfile, fit_friction_profile
from sim2real.dictionary import typical
from sim2real.fitting import AxisModel, Coordinate, Term, coordinates
from sim2real.gap import Measured

F64 = NDArray[np.float64]

_OFTEN = 20.0
"""Weight of the samples at a node (`FrictionProfile.passed`) from which it is shown."""
_CENTERS, _WIDTHS, _WIDER = 25, 6, 2.0
"""Bells compared with a profile: number of centres and of widths, and the largest width as a
multiple of the largest plausible one."""


@dataclass(frozen=True, slots=True, eq=False)
class FreeForm:
    """A kind of effect in any shape, on one axis.

    Attributes:
        effect: of the library, of that kind.
        share: of the residual force in motion that it predicts.
        starts: terms of the effect that come nearest to that shape, to start a fit from.
    """

    effect: Effect
    share: float
    starts: tuple[Term, ...]


@dataclass(frozen=True, slots=True, eq=False)
class FrictionOverPosition:
    """Friction over position as measured, and as the named effect has it.

    Attributes:
        axis: name.
        places: passed often enough, float64[N] [m].
        heights: excess over the Coulomb force there, in free form, float64[N] (0.1 = 10 %).
        named: the same of the effect that was named, float64[N].
    """

    axis: str
    places: F64
    heights: F64
    named: F64


@dataclass(frozen=True, slots=True, eq=False)
class FreeFormTest:
    """Tests the residual force in motion of one axis for effects in free form.

    Attributes:
        name: of the axis.
        measured: recordings.
        settings: of the machine file.
    """

    name: str
    measured: Sequence[Measured]
    settings: StageSettings

    @property
    def _axis(self) -> AxisSettings:
        return next(a for a in self.settings.axes if a.name == self.name)

    def most_likely(self, library: Iterable[Effect]) -> FreeForm | None:
        """The kind that explains most of what the machine file leaves; None if there is none."""
        axis = self._axis
        forms = []
        for effect in library:
            if is_profile(effect, axis):
                profile = fit_friction_profile(self.name, {}, self.measured, self.settings)
                forms.append(FreeForm(effect, profile.share, tuple(_bells(effect, profile, axis))))
        return max(forms, key=lambda form: form.share, default=None)

    def profiles(self, models: Mapping[str, AxisModel]) -> tuple[FrictionOverPosition, ...]:
        """Friction over position beside everything else in the models, one per such effect."""
        axis = self._axis
        model = models[self.name]
        found = []
        for index, term in enumerate(model.terms):
            if not is_profile(term.effect, axis):
                continue
            rest = {**models, self.name: model.without(index)}
            profile = fit_friction_profile(self.name, rest, self.measured, self.settings)
            often = profile.passed >= _OFTEN
            places = profile.places[often]
            named = relative_profile(term, axis, places)
            found.append(FrictionOverPosition(self.name, places, profile.heights[often], named))
        return tuple(found)

    def share(self, effect: Effect, models: Mapping[str, AxisModel]) -> float:
        """Share of the residual force that an effect's kind explains; 0 without a free form."""
        axis = self._axis
        if is_profile(effect, axis):
            return fit_friction_profile(self.name, models, self.measured, self.settings).share
        return 0.0


def is_profile(effect: Effect, axis: AxisSettings) -> bool:
    """Whether an effect is friction over position."""
    return (
        effect.group == "friction"
        and typical(effect, axis).ports(axis).position_coulomb is not None
    )


def relative_profile(term: Term, axis: AxisSettings, places: F64) -> F64:
    """Excess over the Coulomb force that a term makes at places, float64[N] (0.1 = 10 %)."""
    ports = term.ports(axis)
    if ports.position_coulomb is None:
        return np.zeros(len(places))
    return np.interp(places, ports.positions, ports.position_coulomb) - 1.0


def _by_role(effect: Effect, axis: AxisSettings) -> dict[str, Coordinate]:
    return {entry.parameter.role: entry for entry in coordinates(effect, axis)}


def _term(effect: Effect, axis: AxisSettings, values: Mapping[str, float]) -> Term:
    """An effect by values for each role, within the limits."""
    entries = coordinates(effect, axis)
    return Term(effect, tuple(e.clipped(values[e.parameter.role]) for e in entries))


def _bells(effect: Effect, profile: FrictionProfile, axis: AxisSettings) -> list[Term]:
    """The terms nearest to a profile: the best one with more and the best with less friction."""
    entries = _by_role(effect, axis)
    least, most = entries["size"].parameter.ranges(axis)[0]
    narrow, wide = entries["shape"].parameter.ranges(axis)[0]
    typical = 0.5 * (least + most)
    best: dict[bool, tuple[float, Term]] = {}
    for center in np.linspace(profile.places[0], profile.places[-1], _CENTERS):
        for width in np.geomspace(narrow, _WIDER * wide, _WIDTHS):
            values = {"size": typical, "place": float(center), "shape": float(width)}
            bell = relative_profile(_term(effect, axis, values), axis, profile.places)
            along = float(profile.passed @ (bell * profile.heights))
            square = float(profile.passed @ bell**2)
            if square > 0.0 and along**2 / square > best.get(along > 0.0, (0.0,))[0]:
                values["size"] = typical * along / square
                best[along > 0.0] = (along**2 / square, _term(effect, axis, values))
    return [term for _, term in best.values()]
