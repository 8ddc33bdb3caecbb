"""Plug-ins of other packages: callables without arguments, by entry point group and name."""

from __future__ import annotations

from importlib import metadata
from typing import Any

from stagectl.errors import ConfigError


def load_plug_in(group: str, name: str) -> Any:
    """What a plug-in makes.

    Raises:
        ConfigError: it is not installed or cannot be loaded.
    """
    found = list(metadata.entry_points(group=group, name=name))
    if not found:
        raise ConfigError(f"plug-in '{name}' is not installed")
    try:
        return found[0].load()()
    except Exception as error:
        reason = f"{type(error).__name__}: {error}".splitlines()[0]
        raise ConfigError(f"plug-in '{name}' cannot be loaded: {reason}") from error
