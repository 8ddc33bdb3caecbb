"""The effects of a machine file, checked against the simulator's library."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from hil_sim.effects import Effect, Parameter
from hil_sim.effects.library import EffectError, library
from hil_sim.effects.ports import EffectPorts
from hil_sim.settings import AxisSettings
from stagectl.config.machine import Effect as Wanted
from stagectl.config.machine import Machine
from stagectl.config.parsing.validation import sort_problems, suggest
from stagectl.errors import ConfigError
from stagectl.plain_text import one_line

_MAX_VALUE = 1e15  # of any parameter, SI: keeps all results finite
_TRIAL = 1.0  # duration for which the ports are checked [s], arbitrary


def add_effects(machine: Machine, axes: Sequence[AxisSettings]) -> list[AxisSettings]:
    """The axes with the machine file's effects, which the simulator can simulate.

    Args:
        machine: its axes name the effects.
        axes: their settings without effects, in the same order.

    Raises:
        ConfigError: an unknown effect, an unknown or missing key, a physically impossible value,
            or a plant that is too stiff; one line per problem.
    """
    try:
        known = library() if any(axis.effects for axis in machine.axes.values()) else {}
    except EffectError as error:
        raise ConfigError(f"{one_line(machine.source, 300)}: effects: {error}") from error
    problems: list[str] = []
    complete = []
    for settings, (name, axis) in zip(axes, machine.axes.items(), strict=True):
        place: tuple[str | int, ...] = ("axes", name, "effects")
        if reason := _refusal(settings, machine):
            problems.append(machine.document.problem(("axes", name, "plant"), reason))
            continue
        applied = []
        for index, wanted in enumerate(axis.effects):
            found = _problems(wanted, known, settings)
            if not found:
                effect = known[wanted.name].at(**wanted.parameters)
                if reason := _refusal(replace(settings, effects=(effect,)), machine):
                    found = [((), reason, False)]
                else:
                    applied.append(effect)
            problems += [
                machine.document.problem((*place, index, *key), reason, at_key=at_key)
                for key, reason, at_key in found
            ]
        complete.append(replace(settings, effects=tuple(applied)))
        if not problems and (reason := _refusal(complete[-1], machine)):
            problems.append(machine.document.problem(place, reason))
    if problems:
        raise ConfigError(sort_problems(problems))
    return complete


Problem = tuple[tuple[str, ...], str, bool]
"""Key of the effect, or none; reason; whether the key itself is wrong."""


def _problems(wanted: Wanted, known: dict[str, Effect], axis: AxisSettings) -> list[Problem]:
    if wanted.name not in known:
        hint = suggest(wanted.name, list(known))
        return [(("effect",), f"unknown effect '{one_line(wanted.name)}'{hint}", False)]
    effect = known[wanted.name]
    keys = {p.key: replace(p, unit=axis.unit_of(p.unit)) for p in effect.parameters}
    found: list[Problem] = []
    extra = [key for key in wanted.parameters if key not in keys]
    for key in extra:
        found.append(((key,), f"unknown key of {effect.name}{suggest(key, list(keys))}", True))
    for key, parameter in keys.items():
        if key in wanted.parameters:
            value = wanted.parameters[key]
            reason = parameter.refusal(value)
            largest = max(value, key=abs, default=0.0) if isinstance(value, tuple) else value
            if reason is None and abs(largest) > _MAX_VALUE:
                reason = f"must be within +-{_MAX_VALUE:g} {parameter.unit}".rstrip()
                reason += f", is {largest:g}"
            if reason:
                found.append(((key,), reason, False))
        elif not extra:  # else it may be there misspelt
            found.append(((), f"{effect.name}: {key} is missing ({_describe(parameter)})", False))
    if not found and (reason := effect.refusal(wanted.parameters, axis)):
        found.append(((), reason, False))
    return found


def _describe(parameter: Parameter) -> str:
    return f"{parameter.meaning} [{parameter.unit}]" if parameter.unit else parameter.meaning


def _refusal(settings: AxisSettings, machine: Machine) -> str | None:
    """Why the simulator refuses the effects of this axis, or None."""
    try:
        ports = EffectPorts.filled(settings, machine.bus.sync_period, _TRIAL)
        ports.check(len(machine.axes))
    except ValueError as error:
        return str(error)
    return None
