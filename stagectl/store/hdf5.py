"""Reads HDF5 files that other programs may have written: every value is checked before use.

A problem raises `UnusableInput` with one line that begins with the place in the file, to which
`open_hdf5` adds the file's name. Links to other files are not followed, and nothing of implausible
size is read.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import numpy.typing as npt

from stagectl.errors import UnusableInput
from stagectl.plain_text import find_control, one_line
from stagedata import F64

MAX_SAMPLES = 50_000_000
"""14 hours at 1 kHz; a larger declared size means a damaged file."""


@contextmanager
def open_hdf5(path: Path | str) -> Iterator[h5py.File]:
    """Open for reading; any failure inside becomes one line that begins with the file's name."""
    if not Path(path).is_file():
        missing = "is not a file" if Path(path).exists() else "no such file"
        inside = Path(path) / "recording.h5"
        raise UnusableInput(f"{path}: {missing}{f'; {inside} is' if inside.is_file() else ''}")
    try:
        with h5py.File(path, "r") as file:
            yield file
    except UnusableInput as error:
        raise UnusableInput(f"{path}: {one_line(error, 400)}") from error
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:
        # h5py raises any of these for a damaged file.
        raise UnusableInput(
            f"{path}: not a readable HDF5 file (damaged or truncated): "
            f"{one_line(reason_of(error), 400)}"
        ) from error


def reason_of(error: BaseException) -> str:
    """The reason given by h5py or the system, in one line."""
    if isinstance(error, OSError) and error.errno:
        return os.strerror(error.errno)  # h5py's own text runs over several lines
    return str(error).strip("\"'").split("\n")[0]


def read_text(file: h5py.File, name: str, default: str | None = None) -> str:
    """A text attribute of the file; a missing one is `default`, or an error where that is None."""
    value = file.attrs.get(name, default)
    if value is None:
        raise UnusableInput(f"attribute {name}: missing")
    if not isinstance(value, str | bytes):
        raise UnusableInput(f"attribute {name}: must be text")
    try:
        if isinstance(value, bytes):
            value = value.decode("utf-8")
        value.encode("utf-8")  # h5py passes broken bytes on as lone surrogates
    except UnicodeError:
        raise UnusableInput(f"attribute {name}: not UTF-8 text") from None
    return value


def read_line(file: h5py.File, name: str, default: str | None = None) -> str:
    """As `read_text`, of one line without control characters."""
    text = read_text(file, name, default)
    if (reason := find_control(text)) is not None:
        raise UnusableInput(f"attribute {name}: {reason}")
    return text


def member_names(group: h5py.Group) -> Iterator[str]:
    """The names in a group, which messages and reports show."""
    for name in group:
        if (reason := find_control(name)) is not None:
            raise UnusableInput(f"{group.name}: the name {one_line(name)!r} {reason}")
        yield name


def _member(group: h5py.Group, name: str) -> object:
    place = f"{group.name.rstrip('/')}/{name}"
    if isinstance(group.get(name, getlink=True), h5py.ExternalLink):
        raise UnusableInput(f"{place}: is a link to another file")
    try:
        member: object = group[name]
    except KeyError:
        raise UnusableInput(f"{place}: missing") from None
    return member


def open_group(parent: h5py.Group, name: str) -> h5py.Group:
    """A group inside another."""
    member = _member(parent, name)
    if not isinstance(member, h5py.Group):
        raise UnusableInput(f"{parent.name.rstrip('/')}/{name}: must be a group")
    return member


WHOLE = slice(0, None)


def read_array(
    group: h5py.Group,
    name: str,
    kinds: str,
    limit: int,
    length: int | None = None,
    part: slice = WHOLE,
) -> npt.NDArray[Any]:
    """A part of a one-dimensional dataset of these numpy kinds, shape (n,).

    Args:
        group: that it is in.
        name: of the dataset.
        kinds: as `dtype.kind` has them.
        limit: on its length.
        length: of `/time`, which it must have.
        part: to read.
    """
    member = _member(group, name)
    place = f"{group.name.rstrip('/')}/{name}"
    if not isinstance(member, h5py.Dataset):
        raise UnusableInput(f"{place}: must be a dataset")
    if member.external or member.is_virtual:
        raise UnusableInput(f"{place}: its data is in another file")
    if member.ndim != 1:
        raise UnusableInput(f"{place}: must have one dimension, has shape {member.shape}")
    if member.dtype.kind not in kinds:
        raise UnusableInput(f"{place}: holds {member.dtype}, which is of the wrong kind")
    if len(member) > limit:
        raise UnusableInput(f"{place}: {len(member)} entries, at most {limit} are read")
    if length is not None and len(member) != length:
        raise UnusableInput(f"{place}: {len(member)} samples, /time has {length}")
    try:
        values: npt.NDArray[Any] = member[part]
    except OSError as error:
        raise UnusableInput(f"{place}: damaged: {reason_of(error)}") from error
    return values


def read_floats(
    group: h5py.Group,
    name: str,
    length: int | None = None,
    part: slice = WHOLE,
    *,
    finite: bool = True,
) -> F64:
    """Samples of a signal, shape (n,); arguments as of `read_array`."""
    values = read_array(group, name, "fiu", MAX_SAMPLES, length, part)
    values = values.astype(np.float64, copy=False)
    if finite and not np.all(np.isfinite(values)):
        sample = int(np.argmin(np.isfinite(values)))
        raise UnusableInput(
            f"{group.name.rstrip('/')}/{name}: sample {part.start + sample}: is {values[sample]}"
        )
    return values


def check_unit(group: h5py.Group, name: str, unit: str) -> None:
    """Refuse samples whose attribute `unit` names another unit."""
    stated = group[name].attrs.get("unit", unit)
    if isinstance(stated, bytes):
        stated = stated.decode("utf-8", "replace")
    if stated != unit:
        raise UnusableInput(
            f"{group.name.rstrip('/')}/{name}: attribute unit is {stated!r}, must be {unit!r}"
        )


def read_integers(
    group: h5py.Group, name: str, length: int | None = None, part: slice = WHOLE
) -> npt.NDArray[Any]:
    """Integer samples, shape (n,); arguments as of `read_array`."""
    return read_array(group, name, "iub", MAX_SAMPLES, length, part)
