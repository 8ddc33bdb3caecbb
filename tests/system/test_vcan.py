"""The SocketCAN tests in every session: in this one where there is a bus, else by tools/with-vcan.

What it runs are the tests of tests/hil and tests/system that have `socketcan` in their names.
"""

import contextlib
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from tests.short_recipe import short_recipe
from tests.starvation import SHARE, Watch

ROOT = Path(__file__).parents[2]
WITH_VCAN = ROOT / "tools" / "with-vcan"
TIME_LIMIT = 900
"""Several times what it takes, for a machine that others use too [s]."""
SELECTED = "socketcan and not family and (not nosuchcan9 or scan)"
"""Each start of a process takes the guest seconds: one command on an interface that is not there is
enough, and what a family's drives do differently is on other buses what it is on this one."""
FILES = [
    path
    for room in ("hil", "system")
    for path in sorted((ROOT / "tests" / room).glob("test_*.py"))
    if re.search("every_bus|socketcan", path.read_text(encoding="utf-8"))
]
"""Those that hold any: to collect all of them takes the guest long."""
pytestmark = pytest.mark.real_time(judged=False)


@pytest.fixture
def way(vcan_outcome):
    """How with-vcan would make a bus; skips where it cannot, or need not."""
    if os.environ.get("STAGECTL_HIL_SOCKETCAN"):
        pytest.skip("the SocketCAN tests run in this session, on STAGECTL_HIL_SOCKETCAN")
    asked = subprocess.run(
        [sys.executable, WITH_VCAN, "--which"], capture_output=True, text=True, check=False
    )
    if asked.returncode == 0:
        return asked.stdout.strip()
    problem = asked.stderr.strip().removeprefix("with-vcan: ")
    vcan_outcome(False, f"NOT TESTED: {problem}")
    if os.environ.get("STAGECTL_REQUIRE_VCAN"):
        pytest.fail(problem)
    pytest.skip(problem)


def with_vcan(*command, **environment):
    """Runs the tool as a process, without the settings of this session."""
    kept = {k: v for k, v in os.environ.items() if k != "STAGECTL_REQUIRE_VCAN"}
    return subprocess.run(
        [sys.executable, WITH_VCAN, "--time-limit", str(TIME_LIMIT), *map(str, command)],
        capture_output=True, text=True, check=False, env=kept | environment,
    )  # fmt: skip


SHORT = short_recipe((0.001, 0.001), slow=True)


@pytest.fixture
def compiled(stagectl, tmp_path):
    """Lets numba compile here what the guest, several times slower, would compile else."""
    recipe = tmp_path / "short.yaml"
    recipe.write_text(SHORT)
    done = stagectl("run", recipe, "--simulate", "--out", tmp_path / "compiled")
    assert done.returncode == 0, done.stderr


@pytest.mark.timeout(3 * TIME_LIMIT + 60)
@pytest.mark.usefixtures("compiled")
def test_bus_suite_and_commands_on_a_vcan(way, vcan_outcome, tmp_path):
    report = tmp_path / "report.xml"
    command = [
        sys.executable, "-m", "pytest", "-q", "-o", f"cache_dir={tmp_path / 'cache'}",
        "-k", SELECTED, *FILES, f"--junitxml={report}",
    ]  # fmt: skip
    attempt = ""
    for _ in range(2):
        with contextlib.closing(Watch()) as watch:
            begin = watch.forget()
            done = with_vcan(*command, PYTEST_ADDOPTS="")
            absence = watch.since(begin)
        passed = done.returncode == 0 and "inconclusive" not in done.stdout
        if passed or absence.share <= SHARE:  # the guest's own watch has not seen all of it
            break
        attempt = ", at the second attempt"
    assert done.returncode == 0, f"with {way}, {absence}: {done.stdout}{done.stderr}"
    suite = next(ET.parse(report).getroot().iter("testsuite"))  # noqa: S314  our own pytest's
    assert int(suite.get("tests", "0")) >= 13, done.stdout
    skipped = 0 if os.geteuid() == 0 else 1  # test_bus_away.py takes root
    assert suite.get("skipped") == str(skipped), done.stdout
    again = re.search(r"(\d+) rerun", done.stdout)
    repeated = f", {again[1]} of them run again while the guest stood still" if again else ""
    line = f"{suite.get('tests')} tests passed on SocketCAN ({way})"
    vcan_outcome(True, f"{line}{repeated}{attempt}")


def test_what_the_command_gets_and_gives_back(way, tmp_path):
    """Environment, folder, output, status and files, as if it had run here."""
    folder = tmp_path / "a folder's"
    folder.mkdir()
    script = (
        'printf "%s|%s|" "$TEXT" "$1"; pwd; echo "$STAGECTL_HIL_SOCKETCAN" >&2; '
        'cat "/sys/class/net/$STAGECTL_HIL_SOCKETCAN/type" > made; exit 7'
    )
    done = subprocess.run(
        [sys.executable, WITH_VCAN, "--time-limit", "100", "sh", "-c", script, "sh", 'q "x" \'y'],
        capture_output=True, text=True, check=False, cwd=folder,
        env=os.environ | {"TEXT": "two\nlines, $HOME"},
    )  # fmt: skip
    assert done.returncode == 7
    assert done.stdout == f'two\nlines, $HOME|q "x" \'y|{folder}\n'
    interface = done.stderr.strip()
    assert interface.startswith("vcan")
    assert (folder / "made").read_text() == "280\n"  # ARPHRD_CAN
    assert (folder / "made").stat().st_uid == os.getuid()
