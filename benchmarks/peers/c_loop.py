"""One residual-and-sensitivity evaluation: the estimator's compiled pass over a plain C loop.

The C loop is built on the spot (`gcc -O3 -march=native`). Both are called many times from compiled
code, so that neither pays for Python; their chi-squares are compared.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.peers import own_rows
from benchmarks.peers.problem import F64, START, TS, ZONE_AB, Problem
from estimation.friction import REST_BAND

SOURCE = Path(__file__).with_name("pass.c")
FLAGS = ("-O3", "-march=native", "-shared", "-fPIC", "-lm")
TIMES = 200


class Constants(ctypes.Structure):
    """As in pass.c."""

    _fields_ = [
        (name, ctypes.c_double) for name in ("alpha", "vs", "rate", "period", "band", "fast_speed")
    ]


def ratio(problem: Problem, rounds: int) -> dict[str, float]:
    """Both evaluations' times [s] (least of the rounds) and their chi-squares.

    Raises:
        OSError: no C compiler, or it failed.
    """
    p = np.array([1.97, 2.03, 1.9, 0.991])
    with tempfile.TemporaryDirectory() as folder:
        c_call = _c(problem, p, Path(folder))
        own_call = own_rows.make(problem, p)
        chi_c, chi_own = c_call(1), own_call(1)
        best_c = best_own = np.inf
        for _ in range(rounds):
            best_c = min(best_c, _timed(c_call))
            best_own = min(best_own, _timed(own_call))
    return {"c": best_c, "own": best_own, "chi_c": chi_c, "chi_own": chi_own}


def _timed(call: Callable[[int], float]) -> float:
    begin = time.perf_counter()
    call(TIMES)
    return (time.perf_counter() - begin) / TIMES


def _c(problem: Problem, p: F64, folder: Path) -> Callable[[int], float]:
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        raise OSError("no C compiler (gcc)")
    target = folder / "pass.so"
    built = subprocess.run(
        [compiler, str(SOURCE), "-o", str(target), *FLAGS],
        capture_output=True,
        text=True,
        check=False,
    )
    if built.returncode:
        raise OSError(f"{compiler}: {built.stderr.strip().splitlines()[0]}")
    library = ctypes.CDLL(str(target))
    library.repeat.restype = ctypes.c_double
    rows = problem.rows(ZONE_AB)
    factor = problem.factor(rows.stop - rows.start)
    factor[:, 2] = 1.0 / factor[:, 2]
    constants = Constants(
        alpha=START.static_ratio, vs=START.stribeck_velocity, rate=START.relaxation_rate,
        period=TS, band=REST_BAND, fast_speed=12.0 * START.stribeck_velocity,
    )  # fmt: skip
    arrays = [
        problem.position, problem.velocity, problem.acceleration, problem.force, factor, p,
        problem.scale, np.empty((4, 4)), np.empty(4),
    ]  # fmt: skip
    at = [array.ctypes.data_as(ctypes.c_void_p) for array in arrays]

    def call(times: int, _keep: object = arrays) -> float:
        return float(
            library.repeat(
                *at[:4], rows.stop, rows.start, *at[4:7], ctypes.byref(constants), *at[7:], times
            )
        )  # fmt: skip

    return call
