"""Recordings of a second, a fleet's folder, and rows as a worker makes them."""

from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from stagectl.config import load_machine
from stagectl.fleet.rows import RESULT
from stagectl.fleet.storage import Folder
from stagectl.fleet.task import Job
from stagectl.run import software_version
from stagectl.store import RecordingBlocks, write_recording

DATA = Path(__file__).parents[3] / "data"
BEGIN = datetime(2026, 3, 1, tzinfo=UTC)


@pytest.fixture(scope="session")
def small(tmp_path_factory):
    """Four moves of a stage without a gap."""
    path = tmp_path_factory.mktemp("fleet") / "small.h5"
    write_recording(next(iter(RecordingBlocks(DATA / "null-2.h5", 1250))), path)
    return path


@pytest.fixture
def folder(tmp_path):
    return Folder(str(tmp_path / "fleet"))


@pytest.fixture
def job(folder):
    """Makes the job of a recording."""

    def make(url, **values):
        given = {"stamp": "1", "machine": None, "correct": False, "version": software_version()}
        return Job(str(url), out=folder.address, **given | values)

    return make


@pytest.fixture(scope="session")
def row():
    """Makes the row of a recording: its stage, day and what it shows."""

    def make(stage="A", day=0, effects=(), floors=1.0, coulomb=None, machine=None, **values):
        text = load_machine().text if machine is None else machine
        given = dict.fromkeys(RESULT.names) | {
            "recording": f"{stage}-{day}.h5", "stage": stage, "simulated": False,
            "started": BEGIN + timedelta(days=day), "verdict": "explained", "reason": "why",
            "floors": floors, "channels": [], "gap": [], "machine": text,
            "causes": [
                {"axis": "x", "effect": e, "probability": 0.9, "gap_closed": 0.8, "remedy": "mend"}
                for e in effects
            ],
            "friction": [] if coulomb is None else [
                {"axis": "x", "coulomb": coulomb, "sigma": 0.1}
            ],
        }  # fmt: skip
        return given | values

    return make
