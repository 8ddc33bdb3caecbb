"""The files that a command reads and writes, and the one rule for what it may overwrite.

An output is never one of the command's inputs nor another of its outputs, under whatever name, and
it replaces an existing file of another kind only with `--overwrite`. Every parameter that names a
file has one of the types below; `LazyGroup` has every command checked by `guarded`.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from copy import copy
from functools import wraps
from pathlib import Path
from typing import Any

import click

from stagectl.cli.file_kinds import ANY, FileKind

OVERWRITE = "overwrite"
_OWN = "an output must be a file of its own"
_RUN_FILES = frozenset(
    f"{stem}{middle}.{suffix}"
    for stem, suffix in (
        ("recording", "h5"), ("recording", "journal"), ("summary", "json"), ("report", "html"),
        ("bus", "asc"), ("bus", "frames"),
    )
    for middle in ("", "-recovered")
)  # fmt: skip
"""Names of what a run leaves in its folder."""


class NamesFile:
    """A parameter type whose values name files."""

    def is_at(self, value: Any, path: Path) -> bool:
        """Whether a path is, under whatever name, a file that a value stands for."""
        raise NotImplementedError


class Input(click.Path, NamesFile):
    """A file to read. Whoever reads it checks that it can be read, and has the better message."""

    def __init__(self) -> None:
        super().__init__(path_type=Path, dir_okay=True)

    def is_at(self, value: Path, path: Path) -> bool:
        """Whether a path is the file; where a folder is named, a file of a run in it."""
        if value.is_dir():
            return _is_of_run(value, path)
        return _is_same(value, path)


class InputFolder(click.Path, NamesFile):
    """A folder to read, of a run or of many runs.

    Args:
        exists: refuse one that does not exist.
    """

    def __init__(self, exists: bool = False) -> None:
        super().__init__(path_type=Path, file_okay=False, exists=exists)

    def is_at(self, value: Path, path: Path) -> bool:
        """Whether a path is the folder, or a file of a run in it."""
        return _is_same(value, path) or _is_of_run(value, path)


class OutputFolder(InputFolder):
    """The folder of a run to be made."""

    def is_at(self, value: Path, path: Path) -> bool:
        """Whether a path is the folder, or what the run writes into it."""
        inside = path.name in _RUN_FILES and _is_same(value, path.absolute().parent)
        return inside or _is_same(value, path)


class HistoryFile(click.ParamType[str], NamesFile):
    """The address of a history, a file or a server; it is read, and continued."""

    name = "FILE|URL"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """As it is."""
        return str(value)

    def is_at(self, value: str, path: Path) -> bool:
        """Whether a path is the history's file or one of those that SQLite keeps beside it."""
        from stagectl.config import is_server

        if is_server(value):
            return False
        beside = (Path(value + suffix) for suffix in ("", "-wal", "-shm", "-journal"))
        return any(_is_same(file, path) for file in beside)


class Output(click.Path, NamesFile):
    """A file to write, checked before a long computation rather than after it.

    Args:
        kind: of the file.
        standard: whether `-` stands for standard output.
    """

    def __init__(self, kind: FileKind = ANY, standard: bool = False) -> None:
        super().__init__(path_type=Path)
        self.kind = kind
        self._standard = standard

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Check that its folder exists and that it can be written."""
        path = Path(value)
        if str(path) == "-":
            if not self._standard:
                self.fail("cannot be written to standard output: name a file", param, ctx)
            return path
        if path.is_dir():
            self.fail(f"{path}: is a directory", param, ctx)
        if not path.absolute().parent.is_dir():
            self.fail(f"{path}: there is no folder {path.parent}", param, ctx)
        if not os.access(path if path.exists() else path.absolute().parent, os.W_OK):
            self.fail(f"{path}: cannot be written", param, ctx)
        return path

    def is_at(self, value: Path, path: Path) -> bool:
        """Whether a path is the file."""
        return _is_same(value, path)


def guarded(command: click.Command) -> click.Command:
    """The command with the rule; with `--overwrite` where it has outputs."""
    callback, params = command.callback, tuple(command.params)
    outputs = any(isinstance(param.type, Output) for param in params)
    if callback is None or not (outputs or any(isinstance(p.type, OutputFolder) for p in params)):
        return command

    @wraps(callback)
    def check_first(*arguments: Any, **values: Any) -> Any:
        overwrite = values.pop(OVERWRITE, False)
        _check(params, values, overwrite)
        return callback(*arguments, **values)

    made = copy(command)
    made.callback = check_first
    if outputs:
        text = "Let outputs replace existing files of another kind."
        made.params = [*params, click.Option([f"--{OVERWRITE}"], is_flag=True, help=text)]
    return made


def check_output(path: Path, kind: FileKind) -> None:
    """Check a file about to be written: it has a default name, or may have come into being since.

    Raises:
        click.UsageError: it is one of the command's inputs, or a file of another kind.
    """
    context = click.get_current_context(silent=True)
    values = {} if context is None else context.params
    named = [] if context is None else _named(context.command.params, values)
    for param, role, value in named:
        if not isinstance(role, Output) and role.is_at(value, path):
            raise click.UsageError(f"{path}: is {_name(param)} itself; {_OWN}", context)
    if not values.get(OVERWRITE):
        _check_kind(path, kind, context)


def _check(params: Sequence[click.Parameter], values: Mapping[str, Any], overwrite: bool) -> None:
    """Check every output of a command against all else that it names.

    Raises:
        click.UsageError: an output must not be written.
    """
    context = click.get_current_context(silent=True)
    named = _named(params, values)
    for param, role, path in named:
        if not isinstance(role, Output | OutputFolder):
            continue
        for other, its_role, value in named:
            if other is not param and (
                its_role.is_at(value, path) or role.is_at(path, Path(value))
            ):
                raise click.UsageError(
                    f"{path}: given as {_name(other)} and as {_name(param)}; {_OWN}", context
                )
        if isinstance(role, Output) and not overwrite:
            _check_kind(path, role.kind, context)


def _named(
    params: Sequence[click.Parameter], values: Mapping[str, Any]
) -> list[tuple[click.Parameter, NamesFile, Any]]:
    """The files that a command was given, each with the parameter and its type."""
    found: list[tuple[click.Parameter, NamesFile, Any]] = []
    for param in params:
        if not isinstance(param.type, NamesFile):
            continue
        value = values.get(param.name or "")
        for one in value if isinstance(value, tuple) else (value,):
            if one is not None and str(one) != "-":
                found.append((param, param.type, one))
    return found


def _check_kind(path: Path, kind: FileKind, context: click.Context | None) -> None:
    if not kind.is_at(path):
        raise click.UsageError(
            f"{path}: exists and is not {kind.name}; name another file, or replace it with "
            f"--{OVERWRITE}",
            context,
        )


def _name(param: click.Parameter) -> str:
    """As the command line's help names it."""
    if isinstance(param, click.Option):
        return param.opts[0]
    return (param.metavar or param.human_readable_name.upper()).strip("[].")


def _is_same(one: Path, other: Path) -> bool:
    """Whether two paths lead to the same file or folder, which need not exist yet.

    Devices and pipes are no files.
    """
    if one.resolve() == other.resolve():
        return not one.exists() or one.is_file() or one.is_dir()
    try:
        return one.samefile(other) and (one.is_file() or one.is_dir())
    except OSError:
        return False


def _is_of_run(folder: Path, path: Path) -> bool:
    """Whether a path is a file that a run left in a folder or below it."""
    file = path.resolve()
    return file.name in _RUN_FILES and folder.resolve() in file.parents
