"""What is wrong with the stage of a trial, drawn from the ranges that real stages show.

Ranges are those that each effect states (docs/formats/effects.md): uniform, or uniform in the
logarithm where the parameter says so. Nothing here was taken from the diagnosis.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hil_sim.effects import AppliedEffect, Effect, Parameter
from hil_sim.settings import AxisSettings, StageSettings
from sim2real.blind.reserved_effects import OUTSIDE, VARIANTS
from sim2real.blind.unlisted_effects import UnlistedEffect
from sim2real.fitting import plant_figure, with_figures

KINDS = ("one", "two", "none", "outside", "departing")
"""Kinds of trial: one or two effects of the library, none, of no family, of another shape.
"several", on one axis, are drawn on request only."""
SHARES = {"one": 0.42, "two": 0.14, "none": 0.14, "outside": 0.15, "departing": 0.15}
"""Probability of each kind; among the first three 0.6, 0.2, 0.2."""
BASE = (
    "coulomb", "viscous", "stiffness", "static_ratio", "stribeck_velocity", "attraction",
)  # fmt: skip
"""Friction figures that deviate within tolerance, besides the mass."""
LEAST = 2.0
"""Least combined gap that each effect opens alone, in floors."""
_TRIES = 40
_OTHERS = 40


@dataclass(frozen=True, slots=True)
class Drawn:
    """One effect that was drawn.

    Attributes:
        axis: on which it acts.
        effect: name.
        values: key -> value, SI units.
        gap: combined gap that it opens alone, in floors.
        kin: its family in the library: its own name for an effect of the library, "" for none.
        over: coordinate that it is a force over, of an effect outside the library.
    """

    axis: str
    effect: str
    values: Mapping[str, float]
    gap: float
    kin: str
    over: str = ""


@dataclass(frozen=True, slots=True)
class Key:
    """The answer to a trial.

    Attributes:
        kind: one of `KINDS`, or "several".
        effects: none, one or more.
        base: axis -> figure -> relative deviation from the machine file.
    """

    kind: str
    effects: tuple[Drawn, ...]
    base: Mapping[str, Mapping[str, float]]


GapOf = Callable[[StageSettings], float]
"""Combined gap of a stage against the machine file, in floors."""


def draw_kind(rng: np.random.Generator) -> str:
    """One of `KINDS`, drawn by its share."""
    return str(rng.choice(KINDS, p=[SHARES[kind] for kind in KINDS]))


def draw_key(
    rng: np.random.Generator,
    settings: StageSettings,
    tolerance: Mapping[str, float],
    library: Mapping[str, Effect],
    gap_of: GapOf,
    *,
    kind: str | None = None,
    only: str | None = None,
    several: int | None = None,
) -> Key:
    """Draw what is wrong with a stage.

    Args:
        rng: random generator.
        settings: of the machine file.
        tolerance: axis -> relative standard deviation of the plant's figures.
        library: effects to draw from; those that are not searched for, and those of transmissions,
            which the reference stage does not have, are left out.
        gap_of: used to draw again what does not show.
        kind: of the trial; None draws that too.
        only: name of the only effect to draw (of the library or outside it).
        several: effects of the library to draw on one axis.

    Raises:
        ValueError: `only` is no effect's name, or never opens a gap.
    """
    base = {axis.name: draw_base(rng, tolerance.get(axis.name, 0.0)) for axis in settings.axes}
    known = tuple(
        effect for effect in library.values() if effect.searched and not effect.transmission
    )
    if several is not None:
        axis = settings.axes[int(rng.integers(len(settings.axes)))]
        together: list[Drawn] = []
        for _ in range(several):
            together.append(_draw_visible(rng, settings, known, together, gap_of, (axis,)))
        return Key("several", tuple(together), base)
    kind = draw_kind(rng) if kind is None else kind
    pool: Sequence[Effect]
    if only is not None:
        kind, pool = find_pool(only, library)
    else:
        pool = {"outside": OUTSIDE, "departing": VARIANTS}.get(kind, known)
    drawn: list[Drawn] = []
    for _ in range({"none": 0, "two": 2}.get(kind, 1)):
        drawn.append(_draw_visible(rng, settings, pool, drawn, gap_of, settings.axes))
    return Key(kind, tuple(drawn), base)


def find_pool(only: str, library: Mapping[str, Effect]) -> tuple[str, tuple[Effect, ...]]:
    """The kind of trial that draws a single effect, and that effect.

    Raises:
        ValueError: no effect has that name.
    """
    known = tuple(effect for effect in library.values() if effect.searched)
    for kind, pool in (("one", known), ("departing", VARIANTS), ("outside", OUTSIDE)):
        for effect in pool:
            if effect.name == only:
                return kind, (effect,)
    names = ", ".join(sorted(e.name for e in (*known, *VARIANTS, *OUTSIDE)))
    raise ValueError(f"no effect {only}; there are {names}")


def _draw_visible(
    rng: np.random.Generator,
    settings: StageSettings,
    pool: Sequence[Effect],
    taken: Sequence[Drawn],
    gap_of: GapOf,
    axes: Sequence[AxisSettings],
) -> Drawn:
    """Draw an effect that opens a gap on its own.

    Values that open none are drawn again, up to `_TRIES` times, then the effect is.
    """
    for _ in range(_OTHERS):
        effect = pool[int(rng.integers(len(pool)))]
        axis = axes[int(rng.integers(len(axes)))]
        if any(d.axis == axis.name and d.effect == effect.name for d in taken):
            continue
        for _ in range(_TRIES):
            values = draw_values(rng, effect, axis)
            if effect.refusal(values, axis):
                continue
            gap = gap_of(add_effects(settings, axis.name, effect.at(**values)))
            if gap >= LEAST:
                over = effect.over if isinstance(effect, UnlistedEffect) else ""
                return Drawn(axis.name, effect.name, values, gap, family_of(effect), over)
    raise ValueError(f"{', '.join(e.name for e in pool)}: opens no gap of {LEAST:g} floors")


def family_of(effect: Effect) -> str:
    """Name in the library that an effect should be given; "" where there is none."""
    return effect.family if isinstance(effect, UnlistedEffect) else effect.name


def draw_values(rng: np.random.Generator, effect: Effect, axis: AxisSettings) -> dict[str, float]:
    """Draw values for all parameters of an effect, within its plausible ranges."""
    return {parameter.key: _draw_value(rng, parameter, axis) for parameter in effect.parameters}


def _draw_value(rng: np.random.Generator, parameter: Parameter, axis: AxisSettings) -> float:
    intervals = parameter.ranges(axis)
    low, high = intervals[int(rng.integers(len(intervals)))]
    if parameter.log:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))
    return float(rng.uniform(low, high))


def draw_base(rng: np.random.Generator, tolerance: float) -> dict[str, float]:
    """Draw relative deviations of the mass and the friction's figures, each independently."""
    return {name: float(tolerance * rng.standard_normal()) for name in ("mass", *BASE)}


def add_effects(settings: StageSettings, axis: str, *effects: AppliedEffect) -> StageSettings:
    """The stage with effects added to one axis."""
    return replace(
        settings,
        axes=tuple(
            replace(a, effects=(*a.effects, *effects)) if a.name == axis else a
            for a in settings.axes
        ),
    )


def off_nominal(settings: StageSettings, base: Mapping[str, Mapping[str, float]]) -> StageSettings:
    """The stage with its figures changed by relative deviations."""
    axes = (
        with_figures(a, {key: plant_figure(a, key) * (1.0 + d) for key, d in base[a.name].items()})
        for a in settings.axes
    )
    return replace(settings, axes=tuple(axes))


def find_effect(library: Mapping[str, Effect], name: str) -> Effect:
    """An effect of the library or outside it, by name."""
    everything = {e.name: e for e in (*VARIANTS, *OUTSIDE)} | dict(library)
    return everything[name]


def build_stage(settings: StageSettings, key: Key, library: Mapping[str, Effect]) -> StageSettings:
    """The stage that a key describes."""
    stage = off_nominal(settings, key.base)
    for drawn in key.effects:
        stage = add_effects(
            stage, drawn.axis, find_effect(library, drawn.effect).at(**drawn.values)
        )
    return stage
