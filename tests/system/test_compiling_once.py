"""What a run says while kernels are compiled, and that the next one compiles nothing."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys

from stagedata.compiled import SHIPPED, kernel_folder
from tests.short_recipe import short_recipe

MISSING = "estimation.observer.kernel.step"
PROGRAM = """
import sys
from datetime import UTC, datetime
from pathlib import Path
from stagectl.config import load_machine
from stagectl.recipe import load_recipe
from stagectl.run import Listener, RunRequest, execute
from stagectl.sequencer import Mode

recipe, folder = map(Path, sys.argv[1:])
machine = load_machine()
request = RunRequest(
    load_recipe(recipe, machine), machine, machine, None, Mode.ESTIMATED, 1.0, 1, folder,
    datetime.now(UTC),
)
result = execute(request, Listener(phase=print))
assert result.error is None, result.error
"""


def test_a_run_says_once_that_it_compiles(tmp_path, run):
    run()  # all kernels are there now
    recipe = tmp_path / "short.yaml"
    recipe.write_text(short_recipe((0.001, 0.001)))
    cache = tmp_path / "cache" / "stagectl"
    cache.mkdir(parents=True)
    for folder in (SHIPPED, kernel_folder()):
        for kernel in folder.glob("*.kernel"):
            if not kernel.name.startswith(MISSING):
                shutil.copy(kernel, cache)

    def phases(name):
        done = subprocess.run(
            [sys.executable, "-c", PROGRAM, recipe, tmp_path / name],
            env=os.environ | {"NUMBA_CACHE_DIR": str(cache.parent)},
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        return done.stdout.splitlines()

    first, second = phases("first"), phases("second")
    assert first.count("compiling, once") == 1
    assert "compiling, once" not in second
    assert len(list(cache.glob(f"{MISSING}-*.kernel"))) == 1
