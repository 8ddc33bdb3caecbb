"""Options and parameter types that several commands share."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from datetime import UTC
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.file_kinds import JSON
from stagectl.cli.files import Input, Output, check_output

if TYPE_CHECKING:
    from stagectl.config.parsing.units import Dimension
    from stagectl.run import Remarks

DATA = Path(__file__).parents[1] / "data"
FILE = Input()
"""A file to read."""


def option(
    text: str, kind: Any = None, default: Any = None, *, flags: str = "", **more: Any
) -> Any:
    """A field that is an option, in a dataclass for `takes`.

    Args:
        text: its help.
        kind: of its value; None for that of the default.
        default: its value where it is not given.
        flags: its names; by default the field's own.
        more: of `click.option`.
    """
    is_flag = True if isinstance(default, bool) else None
    attributes = {"help": text, "type": kind, "default": default, "is_flag": is_flag, **more}
    return field(default=default, metadata={"flags": flags, "attributes": attributes})


def takes(group: type[Any]) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """A decorator: the command has the options that a dataclass declares, and takes its object.

    Objects of several groups come first, in the order of the decorators; then all else by name.
    """
    declared = fields(group)

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        @wraps(command)
        def with_group(*before: Any, **values: Any) -> None:
            own = {each.name: values.pop(each.name) for each in declared}
            command(*before, group(**own), **values)

        made: Callable[..., None] = with_group
        for each in reversed(declared):
            flags = each.metadata["flags"] or f"--{each.name.replace('_', '-')}"
            made = click.option(flags, each.name, **each.metadata["attributes"])(made)
        return made

    return decorate


class Recording(Input):
    """A recording, by its path or by the folder of its run."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """The file; other files are passed on as they are: whoever reads it has the message."""
        path = Path(value)
        if not path.is_dir():
            return path
        from stagectl.store import recording_in

        return recording_in(path)

    def is_at(self, value: Path, path: Path) -> bool:
        """Whether a path is the recording; or another file of its run, where it stands for that."""
        from stagectl.store import RECORDING_NAME

        of_run = value.name == RECORDING_NAME and super().is_at(value.parent, path)
        return of_run or super().is_at(value, path)


RECORDING = Recording()
"""A recording to read; in its place the folder of a run."""


class _Packaged(Input):
    """A file to read, or one of those that come with the program.

    Args:
        folder: of these, in `stagectl/data`.
    """

    def __init__(self, folder: str) -> None:
        super().__init__()
        self._folder = folder

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """The file; if there is none, the packaged NAME, NAME.yaml or FOLDER/NAME.yaml."""
        path = Path(value)
        if not path.exists() and path.parent in (Path(), Path(self._folder)):
            packaged = {file.stem: file for file in sorted((DATA / self._folder).glob("*.yaml"))}
            name = path.name.removesuffix(".yaml")
            if name not in packaged:
                self.fail(f"{value}: no such file; packaged: {', '.join(packaged)}", param, ctx)
            return packaged[name]
        return path


RECIPE = _Packaged("recipes")
"""A recipe or calibration file."""


JSON_FILE = Output(JSON, standard=True)
"""A file to write JSON to; `-` is standard output."""

JSON_OUT = click.option(
    "--json", "json_out", type=JSON_FILE, help="Also write the result as JSON; - is stdout."
)
"""`--json`; with `-`, all text for people goes to standard error."""


def is_json_on_stdout(json_out: Path | None) -> bool:
    """Whether standard output is reserved for JSON."""
    return json_out is not None and str(json_out) == "-"


class NumberRange(click.FloatRange):
    """A number within bounds; click's own class accepts nan."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """The number, refused if it is nan."""
        number = float(super().convert(value, param, ctx))
        if math.isnan(number):
            self.fail(f"{value} is not a number", param, ctx)
        return number


class Quantity(click.ParamType[float]):
    """A number in SI units, or a number with its unit, such as `-50um`."""

    def __init__(self, dimension: str) -> None:
        self.name = dimension

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """The value in SI units."""
        from stagectl.config.parsing import units

        if isinstance(value, float):
            return value
        dimension: Dimension = getattr(units, self.name)
        try:
            try:
                return units.parse_quantity(float(value), dimension)
            except ValueError:
                return units.parse_quantity(str(value), dimension)
        except ValueError as error:
            self.fail(str(error), param, ctx)


class UtcTime(click.DateTime):
    """A date and time in UTC, as seconds since 1970."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """In seconds."""
        if isinstance(value, float):
            return value
        return super().convert(value, param, ctx).replace(tzinfo=UTC).timestamp()


@dataclass(frozen=True)
class RunBy:
    """Options of commands that make a run."""

    operator: str | None = option("Name of the operator, stored with the run.", metavar="NAME")
    comment: str | None = option("One-line comment, stored with the run.")

    def remarks(self) -> Remarks:
        """For the run."""
        from stagectl.run import Remarks

        return Remarks((self.operator or "").strip() or None, (self.comment or "").strip() or None)


class BusType(click.ParamType[tuple[str, str]]):
    """INTERFACE:CHANNEL of any python-can interface."""

    name = "INTERFACE:CHANNEL"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[str, str]:
        """Split at the first colon; a channel may contain more of them."""
        if isinstance(value, tuple):
            return value
        interface, colon, channel = str(value).partition(":")
        if not (interface and colon and channel):
            self.fail(f"'{value}' is not INTERFACE:CHANNEL, such as socketcan:can0", param, ctx)
        return interface, channel


def write_json(values: Any, path: Path | None) -> None:
    """Write JSON to a file, to standard output if the path is `-`, or nowhere if it is None."""
    if path is None:
        return
    text = json.dumps(values, indent=1, allow_nan=False) + "\n"
    if is_json_on_stdout(path):
        click.echo(text, nl=False)
    else:
        from stagectl.store import write_atomically

        check_output(path, JSON)
        write_atomically(path, text, "JSON")
