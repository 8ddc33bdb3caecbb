"""Kernels are compiled once, whoever asks, and again only when their code has changed."""

import os
import re
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
from stagedata.compiled import on_compiling
heard = []
with on_compiling(heard.append):
    half(3.0)
print(total(np.array([1.0, 2.0])), half(3.0))
try:
    total(np.zeros(0))
except ValueError as error:
    print(error)
assert heard == ["calling.half"] or not half.stats.cache_misses
print("compiled", *(k.__name__ for k in (total, half) if k.stats.cache_misses))
"""


@pytest.fixture
def folder(tmp_path):
    for name, text in (("called", CALLED), ("calling", CALLING), ("program", PROGRAM)):
        (tmp_path / f"{name}.py").write_text(text)
    return tmp_path


@pytest.fixture
def start(folder):
    def started(**environment):
        return subprocess.Popen(
            [sys.executable, "program.py"], cwd=folder, text=True, stdout=subprocess.PIPE,
            env=os.environ | {"NUMBA_CACHE_DIR": str(folder / "cache")} | environment,
        )  # fmt: skip

    return started


@pytest.fixture
def run(start):
    """Run the program; returns what it prints, the numbers as on every run."""

    def ran(result="6.0 1.5", **environment):
        program = start(**environment)
        lines = (program.communicate()[0] or "").splitlines()
        assert program.returncode == 0
        assert lines[:2] == [result, "no values"]
        return lines[2]

    return ran


def test_only_what_has_changed_is_compiled(run, folder):
    assert run() == "compiled total half"
    assert run() == "compiled"
    (folder / "called.py").write_text("# A remark.\n" + CALLED)
    os.utime(folder / "calling.py", (4e9, 4e9))
    assert run() == "compiled"
    (folder / "called.py").write_text(CALLED.replace("2.0", "4.0"))
    assert run("12.0 1.5") == "compiled total"
    (folder / "called.py").write_text(CALLED)
    assert run() == "compiled"


def test_several_processes_compile_once(start):
    programs = [start() for _ in range(2)]
    lines = [(program.communicate()[0] or "").splitlines()[2] for program in programs]
    assert sorted(word for line in lines for word in line.split()[1:]) == ["half", "total"]


def test_a_file_that_was_cut_short_is_compiled_again(run, folder):
    run()
    (path,) = (folder / "cache").rglob("calling.half-*.kernel")
    path.write_bytes(path.read_bytes()[:-1])
    assert run() == "compiled half"
    assert run() == "compiled"


def test_another_processor_has_its_own_kernels(run):
    run()
    assert run(NUMBA_CPU_NAME="generic") == "compiled total half"
    assert run(NUMBA_CPU_NAME="generic") == "compiled"
    assert run() == "compiled"


def test_a_folder_that_cannot_be_written_costs_only_time(run, folder):
    (folder / "cache").write_text("a file")
    assert run() == "compiled total half"


def test_few_versions_are_kept(run, folder):
    for gain in range(2, 7):
        (folder / "called.py").write_text(CALLED.replace("2.0", f"{gain}.0"))
        run(f"{3.0 * gain} 1.5")
    files = [path.name for path in (folder / "cache").rglob("*.kernel")]
    assert len([name for name in files if re.match("calling.total-", name)]) == 4
    assert len([name for name in files if re.match("calling.half-", name)]) == 1
