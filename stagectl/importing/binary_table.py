"""Columns of binary files: MATLAB's (versions 4 to 7 by scipy, 7.3 as HDF5), .npz and other HDF5.

A column is named as in MATLAB: `t`, `log.q` for a field of a structure or a group, `q(:,2)` for the
second column of a matrix, or `q(2,:)` for the second row where samples run along the rows.
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import numpy.typing as npt

from stagectl.errors import UnusableInput

FloatArray = npt.NDArray[np.float64]
_MOST = 64
"""Columns of a matrix; one that is wider both ways is an image or a table of something else."""


def read_matlab(path: Path) -> dict[str, FloatArray]:
    """All columns of numbers of a file, by name.

    Raises:
        UnusableInput: the file cannot be read.
    """
    return _hdf5(path, of_matlab=True) if h5py.is_hdf5(path) else _matlab(path)


def read_arrays(path: Path) -> dict[str, FloatArray]:
    """All columns of numbers of an .npz or HDF5 file, by name.

    Raises:
        UnusableInput: the file cannot be read.
    """
    if h5py.is_hdf5(path):
        return _hdf5(path, of_matlab=False)
    try:
        with path.open("rb") as content, np.load(content, allow_pickle=False) as file:
            return dict(_flatten("", {name: file[name] for name in file.files}))
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, TypeError) as error:
        line = str(error).split("\n")[0]
        raise UnusableInput(f"{path}: not a readable {path.suffix} file: {line}") from error


def _matlab(path: Path) -> dict[str, FloatArray]:
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    try:
        content = loadmat(path, simplify_cells=True)
    except (MatReadError, ValueError, TypeError, OSError, NotImplementedError, KeyError) as error:
        line = str(error).split("\n")[0]
        raise UnusableInput(f"{path}: not a readable .mat file: {line}") from error
    content = {name: value for name, value in content.items() if not name.startswith("__")}
    return dict(_flatten("", content))


def _flatten(name: str, value: object) -> Iterator[tuple[str, FloatArray]]:
    """The columns in a variable, a field or an element of a structure array."""
    if isinstance(value, dict):
        for key, member in value.items():
            yield from _flatten(f"{name}.{key}" if name else str(key), member)
    elif isinstance(value, list):
        for i, member in enumerate(value, start=1):
            yield from _flatten(f"{name}({i})", member)
    elif isinstance(value, np.ndarray) and value.dtype.kind in "fiub":
        yield from _of_array(name, value)
    elif isinstance(value, np.ndarray) and value.dtype.kind == "O":
        yield from _flatten(name, list(value.ravel()))


def _of_array(name: str, values: npt.NDArray[np.generic]) -> Iterator[tuple[str, FloatArray]]:
    """A vector, or the columns of a matrix."""
    numbers = np.asarray(values, dtype=np.float64)
    if numbers.size > 1 and max(numbers.shape) == numbers.size:
        yield name, numbers.ravel()
    elif numbers.ndim == 2 and 1 < min(numbers.shape) <= _MOST:
        if numbers.shape[0] >= numbers.shape[1]:
            yield from ((f"{name}(:,{i})", row) for i, row in enumerate(numbers.T, start=1))
        else:
            yield from ((f"{name}({i},:)", row) for i, row in enumerate(numbers, start=1))


def _hdf5(path: Path, *, of_matlab: bool) -> dict[str, FloatArray]:
    found: dict[str, FloatArray] = {}

    def visit(name: str, member: object) -> None:
        if name.startswith("#") or not isinstance(member, h5py.Dataset):
            return
        if member.dtype.kind in "fiub":
            values = np.asarray(member[()])
            # MATLAB writes the last dimension first.
            found.update(_of_array(name.replace("/", "."), values.T if of_matlab else values))

    try:
        with h5py.File(path, "r") as file:
            file.visititems(visit)
    except (OSError, RuntimeError, KeyError) as error:
        kind = ".mat file (version 7.3)" if of_matlab else "HDF5 file"
        raise UnusableInput(f"{path}: not a readable {kind}") from error
    return found
