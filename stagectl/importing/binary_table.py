"""Columns of binary files: MATLAB's (versions 4 to 7 by scipy, 7.3 as HDF5), .npz and other HDF5.

A column is named as in MATLAB: `t`, `log.q` for a field of a structure or a group, `q(:,2)` for the
second column of a matrix, or `q(2,:)` for the second row where samples run along the rows.

The readers of these formats may fail in any way on a damaged file, ask for any amount of memory or
crash: `foreign_process` calls `read_binary` in a process of its own.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import numpy.typing as npt

from stagectl.errors import UnusableInput

FloatArray = npt.NDArray[np.float64]
_MOST = 64
"""Columns of a matrix; one that is wider both ways is an image or a table of something else."""
_NUMBERS = "fiub"


class _Wanted:
    """Columns that are read, and the names of all that there are.

    Args:
        wanted: names of columns to read; None: all.
    """

    def __init__(self, wanted: Collection[str] | None) -> None:
        self.found: dict[str, FloatArray] = {}
        self.names: list[str] = []
        self._wanted = wanted

    def wants(self, name: str) -> bool:
        """Whether a column is to be read."""
        return self._wanted is None or name in self._wanted

    def add(self, name: str, shape: tuple[int, ...], array: Any, turned: bool = False) -> None:
        """Take the columns wanted of an array.

        Args:
            name: of the array.
            shape: of it, as it is named.
            array: that can be indexed; only what is wanted is read of it.
            turned: its dimensions are in the other order.
        """
        for column, index in _columns_of(name, shape):
            self.names.append(column)
            if self.wants(column):
                values = array[index[::-1] if turned else index]
                self.found[column] = np.asarray(values, dtype=np.float64).ravel()


def read_binary(
    path: Path, wanted: Collection[str] | None = None
) -> tuple[dict[str, FloatArray], list[str]]:
    """Columns of numbers of a file by name, and the names of all of its columns.

    Args:
        path: of a .mat, .npz or HDF5 file.
        wanted: names of columns to read; None: all.

    Raises:
        UnusableInput: its data is in another file.
        Exception: any, where the file is damaged.
    """
    of_matlab = path.suffix.lower() == ".mat"
    found = _Wanted(wanted)
    if h5py.is_hdf5(path):
        _read_hdf5(path, found, of_matlab=of_matlab)
    elif of_matlab:
        _read_matlab(path, found, wanted)
    else:
        _read_arrays(path, found)
    return found.found, found.names


def _read_arrays(path: Path, found: _Wanted) -> None:
    with path.open("rb") as content, np.load(content, allow_pickle=False) as file:
        for name in file.files:
            shape, kind = _header(file, name)
            columns = [column for column, _ in _columns_of(name, shape)]
            if kind in _NUMBERS and any(map(found.wants, columns)):
                found.add(name, shape, file[name])
            elif kind in _NUMBERS:
                found.names += columns
            elif kind == "O":
                raise UnusableInput(f"{name}: holds objects of Python, which are not loaded")


def _header(file: Any, name: str) -> tuple[tuple[int, ...], str]:
    """Shape and kind of an array of an .npz file, without its values."""
    member = name if name in file.zip.namelist() else f"{name}.npy"
    with file.zip.open(member) as content:
        version = np.lib.format.read_magic(content)
        read = (
            np.lib.format.read_array_header_1_0
            if version == (1, 0)
            else np.lib.format.read_array_header_2_0
        )
        shape, _, dtype = read(content)
    return shape, dtype.kind


def _read_matlab(path: Path, found: _Wanted, wanted: Collection[str] | None) -> None:
    from scipy.io import loadmat

    variables = None
    if wanted is not None:
        variables = sorted({re.split(r"[.(]", name)[0] for name in wanted})
    content = loadmat(path, simplify_cells=True, variable_names=variables)
    for name, values in _flatten("", _variables(content)):
        found.add(name, values.shape, values)
    if wanted is not None and not set(wanted) <= set(found.found):
        content = loadmat(path, simplify_cells=True)  # a message will name what there is
        found.names = [
            column
            for name, values in _flatten("", _variables(content))
            for column, _ in _columns_of(name, values.shape)
        ]


def _variables(content: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in content.items() if not name.startswith("__")}


def _flatten(name: str, value: object) -> Iterator[tuple[str, npt.NDArray[Any]]]:
    """The arrays of numbers in a variable, a field or an element of a structure array."""
    if isinstance(value, dict):
        for key, member in value.items():
            yield from _flatten(f"{name}.{key}" if name else str(key), member)
    elif isinstance(value, list):
        for i, member in enumerate(value, start=1):
            yield from _flatten(f"{name}({i})", member)
    elif isinstance(value, np.ndarray) and value.dtype.kind in _NUMBERS:
        yield name, value
    elif isinstance(value, np.ndarray) and value.dtype.kind == "O":
        yield from _flatten(name, list(value.ravel()))


def _columns_of(name: str, shape: tuple[int, ...]) -> Iterator[tuple[str, tuple[Any, ...]]]:
    """Names of the columns of an array, a vector or a matrix, each with its index."""
    size = int(np.prod([int(n) for n in shape], dtype=object)) if shape else 1
    if size > 1 and max(shape) == size:
        yield name, (slice(None),) * len(shape)
    elif len(shape) == 2 and 1 < min(shape) <= _MOST:
        if shape[0] >= shape[1]:
            yield from ((f"{name}(:,{i + 1})", (slice(None), i)) for i in range(shape[1]))
        else:
            yield from ((f"{name}({i + 1},:)", (i, slice(None))) for i in range(shape[0]))


def _read_hdf5(path: Path, found: _Wanted, *, of_matlab: bool) -> None:
    def visit(name: str, member: object) -> None:
        if name.startswith("#") or not isinstance(member, h5py.Dataset):
            return
        if member.dtype.kind not in _NUMBERS or member.shape is None:
            return
        # MATLAB writes the last dimension first.
        shape = member.shape[::-1] if of_matlab else member.shape
        column = name.replace("/", ".")
        if any(found.wants(one) for one, _ in _columns_of(column, shape)) and (
            member.external or member.is_virtual
        ):
            raise UnusableInput(f"/{name}: its data is in another file")
        found.add(column, shape, member, turned=of_matlab)

    with h5py.File(path, "r") as file:
        file.visititems(visit)
