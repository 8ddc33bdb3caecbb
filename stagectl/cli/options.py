"""Options and parameter types that several commands share."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

FILE = click.Path(path_type=Path, dir_okay=True)
"""A file to read; that it can be read is checked where it is read, with a better message."""


class BusType(click.ParamType[tuple[str, str]]):
    """INTERFACE:CHANNEL of any python-can interface."""

    name = "INTERFACE:CHANNEL"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[str, str]:
        """Split at the first colon (channels may hold more of them)."""
        if isinstance(value, tuple):
            return value
        interface, colon, channel = str(value).partition(":")
        if not (interface and colon and channel):
            self.fail(f"'{value}' is not INTERFACE:CHANNEL, such as socketcan:can0", param, ctx)
        return interface, channel


def write_json(values: Any, path: Path) -> None:
    """Write JSON to a file, or to standard output where the path is `-`."""
    text = json.dumps(values, indent=1, allow_nan=False) + "\n"
    if str(path) == "-":
        click.echo(text, nl=False)
    else:
        path.write_text(text, encoding="utf-8")
