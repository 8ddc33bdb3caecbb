"""Reads binary files of other programs in a process of its own, with limits of memory and time.

A damaged file can crash its format's reader, or make it ask for any amount of memory; here that is
one line. What comes back is a line of JSON and numbers, no pickle.
"""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from stagectl.errors import UnusableInput
from stagectl.plain_text import one_line
from stagectl.store.hdf5 import MAX_SAMPLES

MEMORY = 10 * 8 * MAX_SAMPLES
"""Ten columns of the longest recording [B]."""
SECONDS = 120
"""Processor time; twice as long by the clock [s]."""


def read_foreign(
    path: Path, wanted: Collection[str] | None = None
) -> tuple[dict[str, npt.NDArray[np.float64]], list[str]]:
    """Columns of numbers of a .mat, .npz or HDF5 file, as `binary_table.read_binary`.

    Args:
        path: of the file.
        wanted: names of columns to read; None: all.

    Returns:
        Columns wanted that there are, float64[K] each, by name; the names of all columns.

    Raises:
        UnusableInput: it cannot be read.
    """
    asked = json.dumps([str(path.absolute()), None if wanted is None else sorted(wanted)])
    with subprocess.Popen(  # noqa: S603
        [sys.executable, "-P", "-m", __name__],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},  # each thread has memory of its own
    ) as process:  # fmt: skip
        try:
            output, _ = process.communicate(asked.encode(), timeout=2 * SECONDS)
        except subprocess.TimeoutExpired:
            output = b""
        finally:
            process.kill()
    kind = f"{path}: not a readable {path.suffix.lower()} file"
    end = output.find(b"\n")
    if end < 0:
        raise UnusableInput(f"{kind}: {_why_ended(process.returncode)}")
    answer: dict[str, Any] = json.loads(output[:end])
    if "problem" in answer:
        raise UnusableInput(f"{kind}: {one_line(answer['problem'], 200)}")
    columns, at = {}, end + 1
    for name, count in answer["columns"]:
        columns[name] = np.frombuffer(output, np.float64, count, at)
        at += 8 * count
    return columns, answer["names"]


def _why_ended(code: int) -> str:
    """Why the process gave no answer."""
    if code in (-signal.SIGXCPU, -signal.SIGKILL):
        return f"reading it takes longer than {SECONDS} s, or more memory than there is"
    return "it is damaged: its reader crashed"


def _answer(path: Path, wanted: Collection[str] | None) -> None:
    from stagectl.importing.binary_table import read_binary

    columns: dict[str, npt.NDArray[np.float64]] = {}
    answer: dict[str, Any]
    try:
        columns, names = read_binary(path, wanted)
        answer = {"columns": [(name, len(v)) for name, v in columns.items()], "names": names}
    except MemoryError:
        answer = {"problem": f"what it declares takes more than {MEMORY / 1e9:g} GB"}
    except UnusableInput as error:
        answer = {"problem": str(error)}
    except Exception as error:  # noqa: BLE001  (readers fail with anything on a damaged file)
        line = str(error).split("\n")[0] or "it is damaged"
        answer = {"problem": f"{type(error).__name__}: {line}"}
    sys.stdout.buffer.write(json.dumps(answer).encode() + b"\n")
    for values in columns.values() if "columns" in answer else ():
        sys.stdout.buffer.write(np.ascontiguousarray(values).data)


def _limit() -> None:
    for limit, value in (
        (resource.RLIMIT_DATA, MEMORY), (resource.RLIMIT_CPU, SECONDS), (resource.RLIMIT_CORE, 0),
    ):  # fmt: skip
        with suppress(ValueError, OSError):  # a lower limit is set already
            resource.setrlimit(limit, (value, value))


if __name__ == "__main__":
    _limit()
    file, names = json.load(sys.stdin)
    _answer(Path(file), names)
