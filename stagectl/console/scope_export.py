"""Samples of the scope as CSV and HDF5, in SI units, at full resolution."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence

import numpy as np

from stagectl.console.samples import UNITS, Stretch


def as_csv(stretch: Stretch, names: Sequence[str]) -> bytes:
    """A table with a column per signal; what was missed is empty.

    Args:
        stretch: of samples.
        names: of its columns.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["sample", *(f"{name} [{_unit(name)}]" for name in names)])
    for number, row in enumerate(stretch.values.T.tolist(), stretch.first):
        writer.writerow([number, *("" if value != value else repr(value) for value in row)])
    return text.getvalue().encode()


def as_hdf5(stretch: Stretch, names: Sequence[str], about: str) -> bytes:
    """An HDF5 file with a data set per signal and attribute `unit`; nan where missed.

    Args:
        stretch: of samples.
        names: of its columns.
        about: machine and bus, as attribute `stage`.
    """
    import h5py

    memory = io.BytesIO()
    with h5py.File(memory, "w") as file:
        file.attrs["format"], file.attrs["version"] = "stagectl-scope", 1
        file.attrs["stage"] = about
        file["sample"] = stretch.first + np.arange(stretch.values.shape[1])
        for name, values in zip(names, stretch.values, strict=True):
            data = file.create_dataset(name.replace(".", "/"), data=values, compression="gzip")
            data.attrs["unit"] = _unit(name)
    return memory.getvalue()


def _unit(name: str) -> str:
    return UNITS[name.rpartition(".")[2]]
