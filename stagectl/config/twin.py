"""A machine file with effects switched on and plant figures moved: the improved twin of a stage."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import Any

import yaml

from stagectl.config.machine import Machine
from stagectl.config.machine_file import parse_machine
from stagectl.errors import StagectlError


def twin_text(
    machine: Machine,
    effects: Mapping[str, Sequence[tuple[str, Mapping[str, float]]]],
    plant: Mapping[str, Mapping[str, float]] | None = None,
) -> str:
    """The text of a machine file with effects added to those that it has.

    Args:
        machine: to start from; all else stays as it is there, but for comments.
        effects: axis -> (name, parameters in SI units) of each effect to add.
        plant: axis -> figure -> value in SI units: `mass`, or a key under `friction`.

    Raises:
        StagectlError: an axis or figure that the machine file does not have.
        ConfigError: a value that it may not have.
    """
    document: Any = copy.deepcopy(machine.document.data)
    axes = document["axes"]
    for name in {*effects, *(plant or {})}:
        if name not in axes:
            raise StagectlError(f"{machine.source}: no axis {name}")
    for name, figures in (plant or {}).items():
        of_axis = axes[name]["plant"]
        for key, value in figures.items():
            section = of_axis if key == "mass" else of_axis["friction"]
            if key not in section:
                raise StagectlError(f"{machine.source}: axis {name} has no figure {key}")
            section[key] = float(value)
    for name, added in effects.items():
        listed = axes[name].setdefault("effects", [])
        for effect, parameters in added:
            listed.append({"effect": effect, **{k: float(v) for k, v in parameters.items()}})
    text = f"# {machine.name} with what the gap diagnosis found; SI units.\n" + yaml.safe_dump(
        document, sort_keys=False, allow_unicode=True, width=100
    )
    parse_machine(text, "twin")
    return text
