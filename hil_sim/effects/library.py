"""The effects there are: one module each in this package, and those of other packages.

Another distribution brings effects by an entry point in the group `stagectl.effects` that names a
subclass of `Effect` or an object of one:

    [project.entry-points."stagectl.effects"]
    quadratic_drag = "my_package.drag:QuadraticDrag"
"""

from __future__ import annotations

import pkgutil
from importlib import import_module, metadata

from hil_sim import effects
from hil_sim.effects.effect import GROUPS, Effect

GROUP = "stagectl.effects"
"""Entry-point group of other packages' effects."""

_FRAME = ("effect", "library", "ports")  # modules of this package that hold no effect


class EffectError(ValueError):
    """An effect of another package that can't be used; the message says whose and why."""


def own_effects() -> dict[str, Effect]:
    """The effects of this package, by name; one per module, named as the module."""
    found: dict[str, Effect] = {}
    for module in pkgutil.iter_modules(effects.__path__):
        if module.name in _FRAME:
            continue
        content = import_module(f"{effects.__name__}.{module.name}")
        for kind in vars(content).values():
            if isinstance(kind, type) and issubclass(kind, Effect) and kind is not Effect:
                found[kind.name] = kind()
    return _in_order(found)


def library() -> dict[str, Effect]:
    """All effects that are installed, by name, in groups.

    Raises:
        EffectError: another package's effect can't be loaded, is none, or takes a name over.
    """
    found = own_effects()
    for point in metadata.entry_points(group=GROUP):
        found_there = _loaded(point)
        if found_there.name in found:
            raise EffectError(f"{_whose(point)}: effect '{found_there.name}' is there already")
        found[found_there.name] = found_there
    return _in_order(found)


def _loaded(point: metadata.EntryPoint) -> Effect:
    try:
        loaded = point.load()
        effect = loaded() if isinstance(loaded, type) else loaded
    except Exception as error:
        raise EffectError(f"{_whose(point)}: {type(error).__name__}: {error}") from error
    if not isinstance(effect, Effect):
        raise EffectError(f"{_whose(point)}: is no hil_sim.effects.Effect")
    for name in ("name", "group", "parameters", "equation", "enters", "remedy"):
        if not hasattr(effect, name):
            raise EffectError(f"{_whose(point)}: has no {name}")
    if effect.group not in GROUPS:
        raise EffectError(f"{_whose(point)}: group must be one of {', '.join(GROUPS)}")
    return effect


def _whose(point: metadata.EntryPoint) -> str:
    package = point.dist.name if point.dist is not None else "an installed package"
    return f"{package}: entry point '{point.name}' in {GROUP}"


def _in_order(found: dict[str, Effect]) -> dict[str, Effect]:
    return dict(sorted(found.items(), key=lambda item: (GROUPS.index(item[1].group), item[0])))
