"""The plain stage in closed loop as a C loop (`plant.c`), built on the spot."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.peers.problem import F64
from hil_sim.plant import Arrays
from hil_sim.settings import StageSettings

SOURCE = Path(__file__).with_name("plant.c")
FLAGS = ("-O3", "-march=native", "-shared", "-fPIC")
_DOUBLES = (
    "mass", "viscous", "coulomb", "static_ratio", "stribeck_velocity", "stribeck_shape",
    "stribeck_end", "stiffness", "relaxation_rate", "increment", "current_gain", "kp", "ki", "kd",
    "derivative_time", "peak_force", "period", "unit", "share", "mean_start", "early_start",
    "end_start",
)  # fmt: skip


class Axis(ctypes.Structure):
    """As in plant.c."""

    _fields_ = [
        *((name, ctypes.c_double) for name in _DOUBLES),
        *((name, ctypes.c_long) for name in ("elements", "ticks", "substeps")),
    ]


class CPlant:
    """The C loop.

    Args:
        folder: to build in.

    Attributes:
        built_by: compiler and flags.

    Raises:
        OSError: no C compiler, or it failed.
    """

    def __init__(self, folder: Path) -> None:
        compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
        if compiler is None:
            raise OSError("no C compiler")
        target = folder / "plant.so"
        command = [compiler, str(SOURCE), "-o", str(target), *FLAGS, "-lm"]
        built = subprocess.run(command, capture_output=True, text=True, check=False)
        if built.returncode:
            raise OSError(f"{compiler}: {built.stderr.strip().splitlines()[0]}")
        version = subprocess.run([compiler, "--version"], capture_output=True, text=True)
        self.built_by = f"{version.stdout.splitlines()[0]}, {' '.join(FLAGS[:2])}"
        self._run = ctypes.CDLL(str(target)).run
        self._run.restype = None

    def prepare(
        self, stage: StageSettings, demand: F64, offset: F64, substeps: int
    ) -> Callable[[], tuple[F64, F64]]:
        """What simulates all axes and returns position [m] and force [N], as `simulate` does."""
        axes = _axes(stage, demand, substeps)
        columns = [
            [np.ascontiguousarray(c) for c in (demand[:, a], offset[:, a])]
            + [np.empty(len(demand)), np.empty(len(demand))]
            for a in range(len(axes))
        ]
        pointers = [[c.ctypes.data_as(ctypes.c_void_p) for c in four] for four in columns]

        def run() -> tuple[F64, F64]:
            for axis, (d, o, x, f) in zip(axes, pointers, strict=True):
                self._run(ctypes.byref(axis), d, o, len(demand), x, f)
            position, force = (np.column_stack([four[k] for four in columns]) for k in (2, 3))
            return position, force

        return run


def _axes(stage: StageSettings, demand: F64, substeps: int) -> list[Axis]:
    """The figures of each axis; derived ones as the simulator's own arrays hold them."""
    arrays = Arrays(stage, demand[0].tolist(), len(demand) * stage.sync_period, substeps)
    made = []
    for axis, record in zip(stage.axes, arrays.plant, strict=True):
        control = axis.control
        values: dict[str, float] = {
            name: float(record[name])
            for name in (
                "mass", "viscous", "coulomb", "static_ratio", "stribeck_velocity",
                "stribeck_shape", "stribeck_end", "relaxation_rate", "increment", "current_gain",
            )
        }  # fmt: skip
        values |= {
            name: float(getattr(control, name))
            for name in ("kp", "ki", "kd", "derivative_time", "peak_force", "period")
        }
        if substeps == 1:
            values |= {
                "share": float(record["coarse_share"]),
                **{n: float(record[n]) for n in ("mean_start", "early_start", "end_start")},
            }
        made.append(
            Axis(
                **values,
                stiffness=float(record["element_stiffness"]),
                unit=control.rated_force / 1000.0,
                elements=int(record["elements"]),
                ticks=stage.ticks,
                substeps=substeps,
            )
        )
    return made
