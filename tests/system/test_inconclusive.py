"""Real-time tests during which the machine was away: kept apart from failures, and counted."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CONFTEST = """
import tests.conftest as shared
from tests.conftest import *  # noqa: F403
from tests.starvation import Absence


class Away:
    def forget(self):
        return 0.0

    def since(self, begin):
        return Absence(longest={longest}, share=0.0)

    def close(self):
        pass


shared.Watch = Away
"""
VCAN_RAN = """

def pytest_sessionstart(session):
    session.config.stash[shared._ran] = True
"""
TESTS = """
import pytest


@pytest.mark.real_time
@pytest.mark.parametrize("n", range({count}))
def test_that_fails(n):
    assert n < 0
"""


@pytest.mark.parametrize(
    ("longest", "count", "required", "code", "summary"),
    [
        (0.5, 2, False, 0, "2 skipped"),
        (0.5, 2, True, 0, "2 skipped"),
        (0.5, 6, True, 1, "6 real-time tests; too many"),
        (0.0, 1, False, 1, "1 failed"),
    ],
)
def test_a_failure_while_the_machine_was_away_is_inconclusive(
    tmp_path: Path, longest: float, count: int, required: bool, code: int, summary: str
) -> None:
    conftest = CONFTEST.format(longest=longest)
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "STAGECTL_REQUIRE_VCAN": ""}
    if required:
        conftest += VCAN_RAN
        environment["STAGECTL_REQUIRE_VCAN"] = "1"
    (tmp_path / "conftest.py").write_text(conftest)
    (tmp_path / "test_it.py").write_text(TESTS.format(count=count))
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers = real_time(judged): it\n")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "."],
        cwd=tmp_path, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == code, done.stdout + done.stderr
    assert summary in done.stdout
