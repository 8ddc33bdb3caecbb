"""`stagectl sim` and `stagectl run` as two processes on a SocketCAN bus, as users start them.

In real time and on whatever machine: the SYNC is slow. That the run completes is what counts. Runs
where STAGECTL_HIL_SOCKETCAN names an interface (test_vcan.py).
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

from stagectl.config.machine.file import load_machine
from stagectl.store import read_recording
from tests.short_recipe import short_recipe
from tests.signals import listening

INTERFACE = os.environ.get("STAGECTL_HIL_SOCKETCAN")
ELSEWHERE = pytest.mark.skipif(not INTERFACE, reason="run by test_vcan.py on a bus of its own")
BUS = pytest.param(f"socketcan:{INTERFACE}", id="socketcan", marks=ELSEWHERE)

RECIPE = short_recipe((0.001, 0.001), (0.003, 0.002), slow=True)


@pytest.fixture
def machine(tmp_path: Path) -> Path:
    """The packaged machine with a slow SYNC."""
    text = yaml.safe_load(load_machine().text)
    text["bus"] |= {"sync_period": 0.01, "max_missed": 20}
    path = tmp_path / "slow.yaml"
    path.write_text(yaml.safe_dump(text))
    return path


pytestmark = pytest.mark.real_time


@pytest.fixture(params=[BUS])
def bus(request: pytest.FixtureRequest, machine: Path) -> Iterator[str]:
    """A bus with `stagectl sim` on it."""
    command = [
        sys.executable,
        "-m",
        "stagectl",
        "sim",
        "--machine",
        machine,
        "--bus",
        request.param,
    ]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, preexec_fn=listening) as sim:
        assert sim.stdout is not None
        assert "node 1" in sim.stdout.readline()
        yield request.param
        sim.send_signal(signal.SIGINT)
        assert sim.wait(60.0) == 0


def test_a_run_completes(bus: str, machine: Path, tmp_path: Path) -> None:
    recipe = tmp_path / "recipe.yaml"
    recipe.write_text(RECIPE)
    done = subprocess.run(
        [
            sys.executable, "-m", "stagectl", "run", recipe, "--machine", machine, "--bus", bus,
            "--out", tmp_path / "out",
        ],
        capture_output=True, text=True, timeout=500, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    recording = read_recording(tmp_path / "out" / "recording.h5")
    assert len(recording.moves) == 4
