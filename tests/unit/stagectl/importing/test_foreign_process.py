"""Damaged and hostile binary files: one line, whatever their format's reader does."""

import io
import struct
import zipfile

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from stagectl.errors import UnusableInput
from stagectl.importing.foreign_process import read_foreign

GIB = 1 << 30


def refusal(path):
    with pytest.raises(UnusableInput) as refused:
        read_foreign(path, ["q"])
    text = str(refused.value)
    assert text.startswith(str(path))
    assert "\n" not in text
    return text


def test_declared_sizes_beyond_memory_are_one_line(tmp_path):
    huge = 22 * GIB // 8
    mat = tmp_path / "a.mat"  # version 4: type, rows, columns, imaginary, length of the name
    mat.write_bytes(struct.pack("<5i", 0, 1 << 16, huge >> 16, 0, 2) + b"q\0")
    assert "not a readable .mat file" in refusal(mat)
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        head, {"descr": "<f8", "fortran_order": False, "shape": (huge,)}
    )
    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("q.npy", head.getvalue())
    assert "takes more than 4 GB" in refusal(tmp_path / "a.npz")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("q", (huge,), "f8", chunks=(1 << 20,), compression="gzip")
    assert "takes more than 4 GB" in refusal(tmp_path / "a.h5")


@pytest.mark.parametrize("suffix", ["mat", "npz"])
def test_flipped_bits_of_a_compressed_file_are_one_line(tmp_path, suffix):
    """`zlib.error` and a crash inside the reader were among them."""
    path = tmp_path / f"a.{suffix}"
    values = {"q": np.random.default_rng(1).normal(size=300)}
    if suffix == "mat":
        savemat(path, values, do_compression=True)
    else:
        np.savez_compressed(path, **values)
    data = path.read_bytes()
    for at in (len(data) // 3, len(data) // 2):
        flipped = bytearray(data)
        flipped[at] ^= 4
        path.write_bytes(flipped)
        assert "not a readable" in refusal(path)


def test_a_reader_that_crashes_is_one_line(tmp_path, monkeypatch):
    """A stand-in for h5py in the reading process only, which ends as a crash does."""
    (tmp_path / "h5py.py").write_text("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    (tmp_path / "a.h5").write_bytes(b"any")
    assert "its reader crashed" in refusal(tmp_path / "a.h5")
