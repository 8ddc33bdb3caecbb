"""What a machine file's effects tell the host: which it makes up for, how, and which not and why.

Each effect of the library declares it (`hil_sim.effects.Compensation`); the equations are those of
`estimation.known_effects`, or of the package that the effect comes from.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module

from estimation.known_effects import KnownTerms
from hil_sim.effects import Effect
from hil_sim.effects.library import EffectError, library
from stagectl.config.machine import Axis, Machine
from stagectl.config.machine import Effect as Wanted
from stagectl.config.settings.package_settings import stage_settings
from stagectl.errors import ConfigError


@dataclass(frozen=True, slots=True)
class KnownEffect:
    """An effect of the host's machine file.

    Attributes:
        axis, effect: their names.
        compensated: whether the host makes up for it.
        text: a clause: how, or why not.
    """

    axis: str
    effect: str
    compensated: bool
    text: str

    def describe(self) -> str:
        """In a line."""
        verb = "is compensated" if self.compensated else "is not compensated"
        return f"{self.axis}: {self.effect} {verb}: {self.text}"


def known_effects(
    machine: Machine, compensating: bool = True, mapped: bool = False
) -> tuple[KnownEffect, ...]:
    """The effects of a machine file in its order.

    Args:
        machine: the host's.
        compensating: False where the host makes up for nothing but mass (`--compensation none`).
        mapped: as in `known_terms`.

    Raises:
        ConfigError: an effect is not installed.
    """
    found = []
    for name, axis in machine.axes.items():
        for wanted in axis.effects:
            effect = _find(wanted.name, machine)
            how = "of all forces only the mass's is fed forward"
            if compensating:
                how = effect.compensation.text
            done = compensating and effect.compensation.inverse is not None
            if done and mapped and _is_on_map(effect, wanted):
                done, how = False, "friction over place and time is measured, with the effect in it"
            found.append(KnownEffect(name, wanted.name, done, how))
    return tuple(found)


def known_terms(machine: Machine, mapped: bool = False) -> dict[str, KnownTerms]:
    """What is known of each axis that has effects that the host makes up for.

    Args:
        machine: the host's.
        mapped: the Coulomb force over place and time comes from a friction map, or is measured for
            one: what effects say of it is left out, for the map has it.

    Raises:
        ConfigError: an effect is not installed, has keys or values that it cannot have, or what it
            names for its inverse cannot be used.
    """
    known: dict[str, KnownTerms] = {}
    if any(axis.effects for axis in machine.axes.values()):
        stage_settings(machine)  # checks them
    for name, axis in machine.axes.items():
        for wanted in axis.effects:
            effect = _find(wanted.name, machine)
            if effect.compensation.inverse is not None:
                terms = known.setdefault(name, KnownTerms())
                try:
                    _inverse(effect)(terms, wanted.parameters)
                except Exception as error:
                    raise ConfigError(
                        f"{machine.source}: axes.{name}.effects: {wanted.name}: its inverse "
                        f"{effect.compensation.inverse} cannot be used: "
                        f"{type(error).__name__}: {error}"
                    ) from error
    if mapped:
        for terms in known.values():
            terms.table_factors.clear()
            terms.time_factors.clear()
    return known


def axis_as_known(axis: Axis, terms: KnownTerms) -> Axis:
    """The axis with the mass and the current loop that its effects say."""
    plant = axis.plant.model_copy(update={"mass": axis.plant.mass + terms.mass})
    drive = axis.drive
    if terms.bandwidth is not None:
        drive = drive.model_copy(update={"current_bandwidth": terms.bandwidth})
    return axis.model_copy(update={"plant": plant, "drive": drive})


def _is_on_map(effect: Effect, wanted: Wanted) -> bool:
    """Whether an effect is a factor on the Coulomb force over place or time, and nothing else."""
    terms = KnownTerms()
    _inverse(effect)(terms, wanted.parameters)
    return bool(terms.table_factors or terms.time_factors) and not terms.has_forces


def _find(name: str, machine: Machine) -> Effect:
    try:
        found = library().get(name)
    except EffectError as error:
        raise ConfigError(f"{machine.source}: effects: {error}") from error
    if found is None:
        raise ConfigError(f"{machine.source}: effects: unknown effect '{name}'")
    return found


def _inverse(effect: Effect) -> Callable[[KnownTerms, Mapping[str, float]], object]:
    module, _, function = (effect.compensation.inverse or "").partition(":")
    loaded: Callable[[KnownTerms, Mapping[str, float]], object]
    loaded = getattr(import_module(module), function or effect.name)
    return loaded
