"""The effects that are installed: one per module of this package, and those of other packages.

Another distribution provides an effect by an entry point in the group `stagectl.effects` that names
a subclass of `Effect` or an object of one:

    [project.entry-points."stagectl.effects"]
    quadratic_drag = "my_package.drag:QuadraticDrag"
"""

from __future__ import annotations

import pkgutil
from collections.abc import Mapping
from importlib import import_module, metadata

from hil_sim import effects
from hil_sim.effects.effect import GROUPS, Effect
from hil_sim.settings import AxisSettings

GROUP = "stagectl.effects"
"""Entry-point group of effects in other packages."""

_NO_EFFECT = ("effect", "library", "parameter", "ports")  # modules that define none


class EffectError(ValueError):
    """An effect of another package cannot be used; the message names package and cause."""


def own_effects() -> dict[str, Effect]:
    """The effects of this package by name, in groups; each has the name of its module."""
    found: dict[str, Effect] = {}
    for module in pkgutil.iter_modules(effects.__path__):
        if module.name in _NO_EFFECT:
            continue
        content = import_module(f"{effects.__name__}.{module.name}")
        for kind in vars(content).values():
            is_effect = isinstance(kind, type) and issubclass(kind, Effect)
            if is_effect and kind.__module__ == content.__name__:
                found[kind.name] = kind()
    return _sort_by_group(found)


def library() -> dict[str, Effect]:
    """All installed effects by name, in groups.

    Raises:
        EffectError: another package's effect cannot be loaded, is no effect, or has a name that
            exists already.
    """
    found = own_effects()
    for point in metadata.entry_points(group=GROUP):
        effect = _load(point)
        if effect.name in found:
            raise EffectError(f"{_describe_origin(point)}: effect '{effect.name}' exists already")
        found[effect.name] = effect
    return _sort_by_group(found)


def _load(point: metadata.EntryPoint) -> Effect:
    try:
        loaded = point.load()
        effect = loaded() if isinstance(loaded, type) else loaded
    except Exception as error:
        raise EffectError(f"{_describe_origin(point)}: {type(error).__name__}: {error}") from error
    if not isinstance(effect, Effect):
        raise EffectError(f"{_describe_origin(point)}: is not a hil_sim.effects.Effect")
    for name in ("group", "parameters", "equation", "enters", "remedy"):
        if not hasattr(effect, name):
            raise EffectError(f"{_describe_origin(point)}: has no {name}")
    if effect.group not in GROUPS:
        raise EffectError(f"{_describe_origin(point)}: group must be one of {', '.join(GROUPS)}")
    return effect


def _describe_origin(point: metadata.EntryPoint) -> str:
    package = point.dist.name if point.dist is not None else "an installed package"
    return f"{package}: entry point '{point.name}' in {GROUP}"


def _sort_by_group(found: dict[str, Effect]) -> dict[str, Effect]:
    return dict(sorted(found.items(), key=lambda item: (GROUPS.index(item[1].group), item[0])))


def possible_on(axis: AxisSettings, effects: Mapping[str, Effect]) -> dict[str, Effect]:
    """The effects that can act on an axis and have plausible values there.

    Unbalance, for example, needs a rotary axis; a table has no plausible values.
    """
    found = {}
    for name, effect in effects.items():
        ranges = {p.key: p.ranges(axis) for p in effect.parameters}
        if all(ranges.values()):
            usual = {key: own[-1][0] for key, own in ranges.items()}
            if not effect.refusal(usual, axis):
                found[name] = effect
    return found
