"""Compiled kernels for a wheel: those that a run and a diagnosis of it use.

They are compiled for the processor that `stagedata.compiled.kernels` chooses, and used where the
versions of Python and numba are those of the build; elsewhere kernels are compiled on first use.
Where NUMBA_CACHE_DIR names a folder, those that it has are taken, and the others are kept there.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

RUN = ("run", "inspection-20", "--simulate", "--out", "run")
DIAGNOSE = ("gap", "diagnose", "run/recording.h5")
PROGRAM = """
import runpy
import sys
from stagedata.compiled import on_use
with open(sys.argv.pop(1), "a") as used, on_use(lambda path: print(path, file=used)):
    runpy.run_module("stagectl", run_name="__main__")
"""
"""`stagectl`, which notes the files of the kernels that it uses."""


class WheelKernels(BuildHookInterface):
    """A build hook of hatchling."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile the kernels into a temporary folder and add that to the wheel."""
        if version == "editable":
            return
        self._folder = tempfile.TemporaryDirectory()
        folder = Path(self._folder.name)
        self._pretend_installed(folder)
        paths = os.pathsep.join((self.root, str(folder), *filter(None, sys.path)))
        used = folder / "used"
        for command in (RUN, DIAGNOSE):
            subprocess.run(
                [sys.executable, "-c", PROGRAM, used, *command],
                cwd=folder, check=True, stdout=subprocess.DEVNULL,
                env={"NUMBA_CACHE_DIR": str(folder), **os.environ, "PYTHONPATH": paths},
            )  # fmt: skip
        for path in sorted(set(map(Path, used.read_text().splitlines()))):
            build_data["force_include"][str(path)] = f"stagedata/compiled/shipped/{path.name}"
        build_data["pure_python"] = False
        build_data["infer_tag"] = True

    def _pretend_installed(self, folder: Path) -> None:
        """Write package metadata, where the program looks up its version and its bus plug-in."""
        project = self.metadata.core
        info = folder / f"{project.raw_name}-{project.version}.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Name: {project.raw_name}\nVersion: {project.version}\n")
        lines = []
        for group, points in project.entry_points.items():
            lines += [f"[{group}]", *(f"{name} = {target}" for name, target in points.items())]
        (info / "entry_points.txt").write_text("\n".join(lines))

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove the folder."""
        if version != "editable":
            self._folder.cleanup()
