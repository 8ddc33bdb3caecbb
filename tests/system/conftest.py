"""Whole runs: in this process through the session, and as users start them."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path

import pytest

from hil_sim.bus import FaultPlan
from stagectl.config.machine import Machine
from stagectl.config.machine.file import load_machine, parse_machine
from stagectl.measurement import measure_virtual_stage
from stagectl.recipe import load_recipe
from stagectl.run import HostSettings, Listener, RunRequest, RunResult, SimulatedStage, execute
from stagectl.sequencer import Mode
from tests.command import stagectl
from tests.postgres import Server, serve

ROOT = Path(__file__).parents[2]
RECIPE = ROOT / "recipes" / "inspection-20.yaml"

Run = Callable[..., RunResult]
Stagectl = Callable[..., "subprocess.CompletedProcess[str]"]


@pytest.fixture(scope="session")
def machine() -> Machine:
    return load_machine()


@pytest.fixture(scope="session")
def altered() -> Callable[..., Machine]:
    """The machine with both axes' friction figures times these; `rate` is that of C/Fc."""
    return _altered


def _altered(
    machine: Machine, coulomb: float, viscous: float, stiffness: float, rate: float
) -> Machine:
    lines = []
    for line in machine.text.splitlines():
        key, _, value = line.strip().partition(":")
        scale = {
            "coulomb": coulomb, "viscous": viscous, "stiffness": stiffness,
            "attraction": coulomb * rate,
        }.get(key)  # fmt: skip
        if scale is not None and value.strip():
            number = float(value.split("#")[0])
            line = f"{line.split(':')[0]}: {number * scale!r}"
        lines.append(line)
    return parse_machine("\n".join(lines), "altered")


@pytest.fixture(scope="session")
def run(machine: Machine, tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Run a recipe on the virtual stage, over the lock-step CAN bus."""

    def go(
        mode: str = "estimated",
        seed: int = 1,
        scale: float = 1.0,
        truth: Machine | None = None,
        recipe: Path = RECIPE,
        folder: Path | None = None,
        listener: Listener | None = None,
        observer: bool = True,
        host: Machine | None = None,
        faults: FaultPlan | None = None,
        measured: Machine | None = None,
    ) -> RunResult:
        """Run a recipe: many arguments, for each of them is what some test is about."""
        host = host or machine
        request = RunRequest(
            load_recipe(recipe, host),
            host,
            folder or tmp_path_factory.mktemp("run"),
            datetime.now(UTC),
            simulated=SimulatedStage(truth or host, seed, faults),
            host=HostSettings(
                mode=Mode(mode),
                friction_scale=scale,
                observer=observer,
                measurement=measure_virtual_stage(host, measured or truth or host)
                if observer
                else None,
            ),
        )
        return execute(request, listener or Listener())

    return go


@pytest.fixture(scope="session")
def typical(run: Run, tmp_path_factory: pytest.TempPathFactory) -> tuple[RunResult, Path]:
    """A run from half of all friction figures on the stage as modelled, and its folder."""
    folder = tmp_path_factory.mktemp("typical") / "run"
    return run("estimated", 1, 0.5, folder=folder), folder


@pytest.fixture(scope="session")
def server() -> Iterator[Server]:
    """A PostgreSQL server of our own."""
    with serve() as server:
        yield server


@pytest.fixture(scope="session", name="stagectl")
def _stagectl() -> Stagectl:
    """The command in this process."""
    return stagectl


@pytest.fixture(scope="session")
def process() -> Stagectl:
    """The command as a process of its own: what it costs is seconds of imports."""

    def call(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "stagectl", *map(str, arguments)],
            capture_output=True, text=True, timeout=500, check=False,
        )  # fmt: skip

    return call
