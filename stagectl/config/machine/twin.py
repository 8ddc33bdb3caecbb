"""The twin of a stage: its machine file with effects added and plant parameters adjusted."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from hil_sim.effects import Value
from stagectl.config.history_address import OFF, is_path
from stagectl.config.machine.file import parse_machine
from stagectl.config.machine.model import Machine
from stagectl.config.machine.unknown import spell_out
from stagectl.errors import StagectlError


def render_twin(
    machine: Machine,
    effects: Mapping[str, Sequence[tuple[str, Mapping[str, Value]]]],
    plant: Mapping[str, Mapping[str, float]] | None = None,
    comments: Sequence[str] = (),
    folder: Path | None = None,
) -> str:
    """The text of a machine file with effects added and parameters changed.

    Args:
        machine: to start from; the rest is kept, except comments.
        effects: axis -> (name, parameters in SI units) of each effect to add.
        plant: axis -> parameter -> value in SI units: `mass`, or a key of `friction`.
        comments: lines for the head of the file.
        folder: where the file will be, whose relative paths then begin there; None: as they are.

    Raises:
        StagectlError: the machine file does not have an axis or parameter.
        ConfigError: a value is refused, of a parameter or of an effect.
    """
    from stagectl.config.settings.package_settings import stage_settings  # made of machines

    document = spell_out(machine.document)
    axes = document["axes"]
    if folder is not None and Path(machine.source).is_file():
        _move_paths(document, Path(machine.source).parent, folder)
    for name in {*effects, *(plant or {})}:
        if name not in axes:
            raise StagectlError(f"{machine.source}: no axis {name}")
    for name, figures in (plant or {}).items():
        of_axis = axes[name]["plant"]
        for key, value in figures.items():
            section = of_axis if key == "mass" else of_axis["friction"]
            if key not in section:
                raise StagectlError(f"{machine.source}: axis {name} has no parameter {key}")
            section[key] = float(value)
    for name, added in effects.items():
        listed = axes[name].setdefault("effects", [])
        for effect, parameters in added:
            listed.append({"effect": effect, **{k: _plain(v) for k, v in parameters.items()}})
    title = f"{machine.name} with what the gap diagnosis found; SI units."
    if not any(effects.values()):
        title = f"{machine.name}: the gap diagnosis found no effect to add; SI units."
    head = "".join(f"# {line}\n" for line in (title, *comments))
    text = head + yaml.safe_dump(document, sort_keys=False, allow_unicode=True, width=100)
    stage_settings(parse_machine(text, "twin", fitted=True))
    return text


def _move_paths(document: dict[str, Any], beside: Path, folder: Path) -> None:
    """Make the paths in a machine file, relative to one folder, relative to another one."""
    named = [(document, "history")] if is_path(document.get("history") or OFF) else []
    for axis in document["axes"].values():
        named.append((axis, "eds"))
        if str(axis["drive"].get("profile")).endswith(".yaml"):
            named.append((axis["drive"], "profile"))
    for section, key in named:
        path = section.get(key)
        if path is not None and not Path(path).is_absolute():
            section[key] = os.path.relpath(beside / path, folder)


def _plain(value: Value) -> float | list[float]:
    return [float(v) for v in value] if isinstance(value, tuple) else float(value)
