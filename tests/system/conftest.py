"""Whole runs: in this process through the session, and as users start them."""

import os
import signal
import subprocess
from datetime import UTC, datetime
from multiprocessing import get_context
from pathlib import Path

import pytest

from stagectl.config.machine.file import load_machine, parse_machine
from stagectl.measurement import measure_virtual_stage
from stagectl.recipe import load_recipe
from stagectl.run import HostSettings, Listener, RunRequest, SimulatedStage, execute
from stagectl.sequencer import Mode, SegmentDone
from tests.command import stagectl
from tests.postgres import serve
from tests.processes import start

ROOT = Path(__file__).parents[2]
RECIPE = ROOT / "recipes" / "inspection-20.yaml"


@pytest.fixture(scope="session")
def machine():
    return load_machine()


@pytest.fixture(scope="session")
def altered():
    """The machine with both axes' friction figures times these; `rate` is that of C/Fc."""
    return _altered


def _altered(machine, coulomb, viscous, stiffness, rate):
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
def run(machine, tmp_path_factory):
    """Run a recipe on the virtual stage, over the lock-step CAN bus."""

    def go(
        mode="estimated",
        seed=1,
        scale=1.0,
        truth=None,
        recipe=RECIPE,
        folder=None,
        listener=None,
        observer=True,
        host=None,
        faults=None,
        measured=None,
    ):
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
def typical(run, tmp_path_factory):
    """A run from half of all friction figures on the stage as modelled, and its folder."""
    folder = tmp_path_factory.mktemp("typical") / "run"
    return run("estimated", 1, 0.5, folder=folder), folder


def _die(happened):
    if isinstance(happened, SegmentDone) and happened.number == 2:
        os.kill(os.getpid(), signal.SIGKILL)


@pytest.fixture(scope="session")
def killed_at_its_second_site():
    """Execute a request in a process that is killed there."""

    def go(request):
        listener = Listener(event=_die)
        process = get_context("fork").Process(target=execute, args=(request, listener))
        process.start()
        process.join(100)
        assert process.exitcode == -signal.SIGKILL

    return go


@pytest.fixture(scope="session")
def server():
    """A PostgreSQL server of our own."""
    with serve() as server:
        yield server


@pytest.fixture(scope="session", name="stagectl")
def _stagectl():
    """The command in this process."""
    return stagectl


@pytest.fixture(scope="session")
def process():
    """The command as a process of its own: what it costs is seconds of imports."""

    def call(*arguments):
        with start(*arguments) as process:
            out, err = process.communicate(timeout=500)
        return subprocess.CompletedProcess(process.args, process.returncode, out, err)

    return call
