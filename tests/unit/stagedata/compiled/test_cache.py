"""Kernels are compiled once, whoever asks, and again only when their code has changed."""

import os
import re
import shutil
import subprocess
import sys

import pytest

CALLED = """
from stagedata.compiled import kernel

GAIN = 2.0

@kernel()
def scaled(x):
    return x * GAIN
"""
CALLING = """
import numpy as np
from called import scaled
from stagedata.compiled import kernel

@kernel()
def total(values):
    if len(values) == 0:
        raise ValueError("no values")
    kept = np.zeros_like(values)
    for k in range(len(values)):
        kept[k] = scaled(values[k])
    return kept.sum()

@kernel()
def half(x):
    return x / 2.0
"""
PROGRAM = """
import sys
import numpy as np
sys.path.insert(0, ".")
from calling import half, total
from stagedata.compiled import kernel_folder, on_compiling, on_use
heard, used = [], []
with on_use(used.append):
    with on_compiling(heard.append):
        half(3.0)
    print(total(np.array([1.0, 2.0])), half(3.0))
kernels = {"calling.half", "calling.total"} if kernel_folder().problem() is None else set()
assert {path.name.partition("-")[0] for path in used if path.is_file()} == kernels
try:
    total(np.zeros(0))
except ValueError as error:
    print(error)
assert heard == ["calling.half"] or not half.stats.cache_misses
print("compiled", *(k.__name__ for k in (total, half) if k.stats.cache_misses))
"""


def start(folder, **environment):
    """Start the program that the folder holds; its kernels are kept there."""
    return subprocess.Popen(
        [sys.executable, "program.py"], cwd=folder, text=True, stdout=subprocess.PIPE,
        env=os.environ | {"NUMBA_CACHE_DIR": str(folder / "cache")} | environment,
    )  # fmt: skip


def finish(program, result="6.0 1.5"):
    """Which kernels it says it compiled; the numbers are as on every run."""
    lines = (program.communicate()[0] or "").splitlines()
    assert program.returncode == 0
    assert lines[:2] == [result, "no values"]
    return lines[2]


@pytest.fixture(scope="module")
def empty(tmp_path_factory):
    """A folder with the program, which has not run in it."""
    folder = tmp_path_factory.mktemp("empty")
    for name, text in (("called", CALLED), ("calling", CALLING), ("program", PROGRAM)):
        (folder / f"{name}.py").write_text(text)
    return folder


@pytest.fixture(scope="module")
def compiled(empty, tmp_path_factory):
    """A folder in which it has run twice, at the same time."""
    folder = shutil.copytree(empty, tmp_path_factory.mktemp("compiled") / "once")
    lines = [finish(program) for program in [start(folder), start(folder)]]
    return folder, sorted(word for line in lines for word in line.split()[1:])


@pytest.fixture
def folder(compiled, tmp_path):
    return shutil.copytree(compiled[0], tmp_path / "copy")


@pytest.fixture
def run(folder):
    """Run the program there."""

    def ran(result="6.0 1.5", **environment):
        return finish(start(folder, **environment), result)

    return ran


def test_several_processes_compile_once(compiled):
    assert compiled[1] == ["half", "total"]


def test_only_what_has_changed_is_compiled(run, folder):
    (folder / "called.py").write_text("# A remark.\n" + CALLED)
    os.utime(folder / "calling.py", (4e9, 4e9))
    assert run() == "compiled"
    (folder / "called.py").write_text(CALLED.replace("2.0", "4.0"))
    assert run("12.0 1.5") == "compiled total"
    (folder / "called.py").write_text(CALLED)
    assert run() == "compiled"


def test_a_file_that_was_cut_short_is_compiled_again(run, folder):
    (path,) = (folder / "cache").rglob("calling.half-*.kernel")
    path.write_bytes(path.read_bytes()[:-1])
    assert run() == "compiled half"
    assert run() == "compiled"


def test_another_processor_has_its_own_kernels(run):
    assert run(NUMBA_CPU_NAME="generic") == "compiled total half"
    assert run(NUMBA_CPU_NAME="generic") == "compiled"
    assert run() == "compiled"


def test_a_folder_that_cannot_be_written_costs_only_time(empty, tmp_path):
    folder = shutil.copytree(empty, tmp_path / "copy")
    (folder / "cache").write_text("a file")
    assert finish(start(folder)) == "compiled total half"


def test_few_versions_are_kept(run, folder):
    (kept,) = (folder / "cache").rglob("calling.total-*.kernel")
    name = kept.name.rpartition("-")[0]
    for number in range(4):
        other = shutil.copy(kept, kept.with_name(f"{name}-{number:032}.kernel"))
        os.utime(other, (1.5e9, 1.5e9))
    os.utime(kept, (1e9, 1e9))  # the oldest, but in use
    assert run() == "compiled"
    (folder / "called.py").write_text(CALLED.replace("2.0", "4.0"))
    assert run("12.0 1.5") == "compiled total"
    files = [path.name for path in (folder / "cache").rglob("*.kernel")]
    assert len([name for name in files if re.match("calling.total-", name)]) == 4
    assert len([name for name in files if re.match("calling.half-", name)]) == 1
    assert run("12.0 1.5") == "compiled", "the last one is among them"
    assert kept.exists()
