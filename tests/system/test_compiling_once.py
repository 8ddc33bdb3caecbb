"""What a run says while kernels are compiled, and that the next one compiles nothing."""

import os
import shutil
import subprocess
import sys

import pytest

from stagedata.compiled import SHIPPED, kernel_folder
from tests.short_recipe import short_recipe

OBSERVER, PLANT = "estimation.observer.kernel.step", "hil_sim.plant.mechanics.step"
PROGRAM = """
import sys
from datetime import UTC, datetime
from pathlib import Path
from stagectl.config import load_machine
from stagectl.recipe import load_recipe
from stagectl.run import Listener, RunRequest, SimulatedStage, execute

recipe, folder = map(Path, sys.argv[1:])
machine = load_machine()
request = RunRequest(
    load_recipe(recipe, machine), machine, folder, datetime.now(UTC),
    simulated=SimulatedStage(machine),
)
result = execute(request, Listener(phase=print))
assert result.error is None, result.error
"""
BESIDE = """
import sys
import time
from pathlib import Path
from stagectl.config import load_machine
from stagectl.run.compilation import compiled_by_two
from stagedata.compiled import kernel

@kernel()
def unheard_of(value):
    return 2.0 * value

machine, plant, phases = load_machine(), Path(sys.argv[1]), []
with compiled_by_two(machine, machine, phases.append):
    unheard_of(1.0)
    unheard_of(1)
    for _ in range(1200):
        if list(plant.parent.glob(plant.name)):
            break
        time.sleep(0.1)
    else:
        sys.exit("the plant was not compiled")
assert phases == ["compiling, once"] * 2, phases
"""


def copy_kernels(folder, but):
    """All kernels that are there, but those whose names begin so."""
    folder.mkdir(parents=True)
    for place in (SHIPPED, kernel_folder().path):
        for kernel in place.glob("*.kernel"):
            if not kernel.name.startswith(but):
                shutil.copy(kernel, folder)


@pytest.mark.slow
@pytest.mark.usefixtures("typical")  # all kernels are there then
def test_a_run_says_once_that_it_compiles(tmp_path):
    recipe = tmp_path / "short.yaml"
    recipe.write_text(short_recipe((0.001, 0.001)))
    cache = tmp_path / "cache" / "stagectl"
    copy_kernels(cache, OBSERVER)

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
    assert len(list(cache.glob(f"{OBSERVER}-*.kernel"))) == 1


@pytest.mark.slow
@pytest.mark.usefixtures("typical")
def test_a_second_process_compiles_what_the_run_needs_later(tmp_path):
    cache = tmp_path / "stagectl"
    copy_kernels(cache, PLANT)
    subprocess.run(
        [sys.executable, "-c", BESIDE, cache / f"{PLANT}-*.kernel"],
        env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}, check=True,
    )  # fmt: skip
