"""How long the first run takes, and the following ones; before and after a change.

    python -m benchmarks.rates.start_up [--against COMMIT] [--rounds 5] [--warm] [--install]
        [--json FILE]

The working tree is measured in a copy; with --against, a commit as well, on this machine, in turn.
Figures that changed by a factor of more than 1.3 are then marked. Times are processor time of whole
processes, so that other work on the machine counts less. Rates are those that `cycle_rate.py`,
`cycle_peers.py` and `simulation_rate.py` of each tree print. --warm leaves out the first
runs (kernels are compiled all the same, once). --install makes an environment and a wheel of each
tree, and takes packages from the registry.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from statistics import median

from benchmarks.shared.machine_facts import machine_facts

ROOT = Path(__file__).parents[2]
RUN = ("run", "recipes/inspection-20.yaml", "--simulate")
MOVED = 1.3
FIXTURE_TEST = """
import sys, time
import pytest

@pytest.mark.parametrize("k", range(5))
def test_of_the_stage(virtual_stage, k):
    sys.__stdout__.write(f"{k} of 5 at {time.process_time()} s\\n")
"""
MOVES = """
import gc, tempfile, time
from datetime import UTC, datetime
from pathlib import Path
from stagectl.__main__ import BETWEEN_COLLECTIONS
from stagectl.config import load_machine
from stagectl.recipe import load_recipe
from stagectl.run import Listener, RunRequest, SimulatedStage, execute

gc.set_threshold(BETWEEN_COLLECTIONS)  # as the program does
machine = load_machine(None)
recipe = load_recipe(Path("recipes/inspection-20.yaml"), machine)
rates = []
for _ in range(5):
    at = []
    with tempfile.TemporaryDirectory() as folder:
        request = RunRequest(
            recipe, machine, Path(folder, "run"), datetime.now(UTC),
            simulated=SimulatedStage(machine),
        )
        result = execute(request, Listener(event=lambda _: at.append(time.thread_time())))
    rates.append(result.summary["duration"] / (at[-1] - at[0]))
print(max(rates))
"""
"""Simulated seconds per CPU second of the moving thread, from a run's first to its last event."""


@dataclass(frozen=True, slots=True)
class Spent:
    """Time and output of a process that has ended."""

    cpu: float
    wall: float
    output: str


class Tree:
    """A version of the program in a folder of its own.

    Args:
        name: of it, in the table.
        folder: holds the sources.
        python: interpreter that has all packages.
    """

    def __init__(self, name: str, folder: Path, python: str = sys.executable) -> None:
        self.name, self.folder, self._python = name, folder, python

    def call(self, *arguments: str | Path) -> Spent:
        """Run Python in this tree."""
        unset = ("PYTHONDONTWRITEBYTECODE", "NUMBA_CACHE_DIR")
        clean = {name: value for name, value in os.environ.items() if name not in unset}
        own = {"PYTHONPATH": str(self.folder)}
        before, begin = os.times(), time.perf_counter()
        done = subprocess.run(
            [self._python, *arguments], cwd=self.folder, env=clean | own, text=True,
            capture_output=True, check=False,
        )  # fmt: skip
        wall, after = time.perf_counter() - begin, os.times()
        if done.returncode and "\nmissed: " not in done.stdout:  # of a figure, which is shown
            sys.exit(f"{self.name}: {' '.join(map(str, arguments))}: {done.stderr[-2000:]}")
        cpu = sum(after[2:4]) - sum(before[2:4])  # of children
        return Spent(cpu, wall, done.stdout)

    def stagectl(self, *arguments: str) -> Spent:
        """Run the program."""
        return self.call("-m", "stagectl", *arguments)

    def benchmark(self, name: str, *arguments: str | Path) -> Spent:
        """Run one of the benchmarks, in whatever folder this tree has it."""
        return self.call(next((self.folder / "benchmarks").rglob(f"{name}.py")), *arguments)

    def run(self) -> Spent:
        """The README's first run."""
        with tempfile.TemporaryDirectory() as out:
            spent = self.stagectl(*RUN, "--out", f"{out}/run")
            summary = json.loads(Path(out, "run", "summary.json").read_text())
        if summary["outcome"] != "completed":
            sys.exit(f"{self.name}: a run ended as {summary['outcome']}")
        return spent


Figures = dict[str, float]


def first_runs(tree: Tree) -> Figures:
    """With an empty kernel cache, and after touching a module without kernels."""
    tree.stagectl("--help")  # byte code
    cold = tree.run()
    tree.run()
    touched = tree.folder / "estimation" / "trajectory.py"
    touched.write_text(touched.read_text() + "# touched\n")
    return {
        "first run, CPU, s": cold.cpu, "first run, wall, s": cold.wall,
        "a run after touching a module without kernels, CPU, s": tree.run().cpu,
    }  # fmt: skip


def further_runs(tree: Tree) -> Figures:
    """One round of runs with a warm kernel cache."""
    run, plan = tree.run(), tree.stagectl(*RUN[:2], "--dry-run")
    return {
        "a warm run, CPU, s": run.cpu,
        "its moves over real time": float(tree.call("-c", MOVES).output),
        "`run --dry-run`, CPU, s": plan.cpu,
    }


def rates(tree: Tree) -> Figures:
    """Rates of the SYNC cycle, the pytest fixture and the simulation."""
    found: Figures = {}
    cycle = _rows(tree.benchmark("cycle_rate").output)
    for name, cells in cycle.items():
        if "plant alone" in name:
            found["the plant alone, µs a SYNC"] = float(cells[0])
        else:
            found[f"{name}, over the plant alone"] = float(cells[1])
    peers = tree.folder / "peers.json"
    tree.benchmark("cycle_peers", "--json", peers)
    for figure in json.loads(peers.read_text()):
        if figure["cpu_ratio"] is not None:
            found[f"{figure['what']}, over canopen's"] = figure["cpu_ratio"]
    simulation = _rows(tree.benchmark("simulation_rate").output)
    found["10 s of one axis, reference, ms"] = float(simulation["N = 10"][0])
    found["10 s of one axis, coarse, ms"] = float(simulation["N = 10"][1])
    if over := simulation.get("N = 10, over C"):
        found["the same, reference, over a C loop"] = float(over[0])
        found["the same, coarse, over a C loop"] = float(over[1])
    test = tree.folder / "test_fixture.py"
    test.write_text(FIXTURE_TEST)
    shown = tree.call("-m", "pytest", test, "-q", "-s", "-c", os.devnull).output
    at = [float(second) for second in re.findall(r" at ([\d.]+) s", shown)]
    found["a test with `virtual_stage`, after the first, CPU, s"] = median(
        end - begin for begin, end in pairwise(at)
    )
    return found


def installations(tree: Tree) -> Figures:
    """Times of an editable installation (as by `make run`) and of a wheel installation."""
    found: Figures = {}
    for what, source in (("`make run`'s environment", ["--editable", "."]), ("a wheel", ["."])):
        with tempfile.TemporaryDirectory() as folder:
            begin = time.perf_counter()
            tree.call("-m", "venv", folder)
            python = f"{folder}/bin/python"
            own = Tree(tree.name, tree.folder, python)
            group = _development_group(tree) if "editable" in source[0] else []
            if group:
                own.call("-m", "pip", "install", "-q", "--upgrade", "pip>=25.1")
            own.call("-m", "pip", "install", "-q", *source, *group)
            found[f"{what}: installed in, s"] = time.perf_counter() - begin
            size = sum(p.lstat().st_size for p in Path(folder).rglob("*") if p.is_file())
            found[f"{what}: MB"] = size / 1e6
            if "wheel" in what:
                anywhere = Path(folder, "anywhere")
                anywhere.mkdir()
                (anywhere / "recipes").symlink_to(tree.folder / "recipes")
                installed = Tree(tree.name, anywhere, python)
                runs = [installed.run().cpu for _ in range(3)]
                found["first run from a wheel, over a warm one"] = runs[0] / min(runs[1:])
    return found


def _development_group(tree: Tree) -> list[str]:
    """What `make run` installs beside the program, of a tree whose Makefile does so."""
    recipe = (tree.folder / "Makefile").read_text().partition("\nrun:")[0]
    return ["--group", "dev"] if "--editable . --group dev" in recipe else []


def _rows(printed: str) -> dict[str, list[str]]:
    """Rows of the tables that a benchmark prints: first cell -> the others."""
    rows = {}
    for line in printed.splitlines():
        if line.startswith("|"):
            name, *cells = (cell.strip() for cell in line.strip("|").split("|"))
            if cells and re.match(r"[\d.]+$", cells[0]):
                rows[name] = cells
    return rows


def trees(against: str | None, folder: Path) -> Iterator[Tree]:
    """The commit to compare with, if any, and the working tree, copied."""
    if against:
        before = folder / "before"
        before.mkdir()
        packed = subprocess.run(
            ["git", "archive", against], cwd=ROOT, check=True, capture_output=True
        )
        subprocess.run(["tar", "-x"], cwd=before, check=True, input=packed.stdout)
        yield Tree(against, before)
    after = folder / "after"
    listed = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    names = subprocess.run(listed, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    for name in filter(None, names.split("\0")):
        if (ROOT / name).exists() or (ROOT / name).is_symlink():
            (after / name).parent.mkdir(parents=True, exist_ok=True)
            subprocess.run(["cp", "-P", ROOT / name, after / name], check=True)
    yield Tree("working tree", after)


def measure(measured: list[Tree], rounds: int, warm: bool, install: bool) -> dict[str, Figures]:
    """All figures of all trees; what is compared is measured in turn."""
    found: dict[str, Figures] = {tree.name: {} for tree in measured}

    def each(ask: Callable[[Tree], Figures], times: int = 1) -> None:
        collected: dict[str, list[Figures]] = {tree.name: [] for tree in measured}
        for _ in range(times):
            for tree in measured:
                collected[tree.name].append(ask(tree))
        for name, several in collected.items():
            found[name] |= {key: median(one[key] for one in several) for key in several[0]}

    if warm:
        for tree in measured:
            tree.run()
    else:
        each(first_runs)
    each(further_runs, rounds)
    each(rates)
    if install:
        each(installations)
    return found


def table(found: Mapping[str, Figures]) -> Iterator[str]:
    """Lines of a table, with the ratio of the last column to the first one, if there are two."""
    names = list(found)
    heads = [*names, "ratio"] if len(names) > 1 else names
    yield f"| | {' | '.join(heads)} |"
    yield "| --- |" + " --- |" * len(heads)
    for key in found[names[-1]]:
        values = [found[name].get(key) for name in names]
        cells = ["" if value is None else f"{value:.3g}" for value in values]
        if len(values) > 1 and values[0] and values[-1]:
            ratio = values[-1] / values[0]
            mark = " *" if max(ratio, 1.0 / ratio) > MOVED else ""
            cells.append(f"{ratio:.2f}{mark}")
        elif len(values) > 1:
            cells.append("")
        yield f"| {key} | {' | '.join(cells)} |"


def main() -> None:
    """Measure and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--against", metavar="COMMIT", help="also measure this commit")
    parser.add_argument("--rounds", type=int, default=5, help="of warm runs [5]")
    parser.add_argument("--warm", action="store_true", help="leave out the runs that compile")
    parser.add_argument("--install", action="store_true", help="also install each tree")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures there")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        measured = list(trees(given.against, Path(folder)))
        found = measure(measured, given.rounds, given.warm, given.install)
    print(f"{machine_facts()}\n", *table(found), sep="\n")
    if len(found) > 1:
        print(f"\n*: moved by more than {MOVED}")
    if given.json:
        given.json.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
