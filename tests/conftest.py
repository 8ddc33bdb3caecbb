"""Says at the end of a test session whether the SocketCAN part ran, and if not, what it takes.

With STAGECTL_REQUIRE_VCAN=1 a session in which it did not run fails.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Generator

import pytest

from stagectl.kernel_cache import drop_stale

REQUIRED = "STAGECTL_REQUIRE_VCAN"
_outcome = pytest.StashKey[list[str]]()
_ran = pytest.StashKey[bool]()


@pytest.fixture(scope="session")
def vcan_outcome(pytestconfig: pytest.Config) -> Callable[[bool, str], None]:
    """To be told whether the SocketCAN tests ran, and a line for the end of the session."""

    def tell(ran: bool, line: str) -> None:
        pytestconfig.stash[_ran] = pytestconfig.stash[_ran] or ran
        pytestconfig.stash[_outcome].append(line)

    return tell


def pytest_configure(config: pytest.Config) -> None:
    drop_stale()
    config.stash[_outcome] = []
    config.stash[_ran] = False


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item,
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Notes tests that ran on a SocketCAN bus in this very session."""
    report = yield
    if report.when == "call" and report.passed and "[socketcan" in item.nodeid:
        item.config.stash[_ran] = True
    return report


@pytest.hookimpl(tryfirst=True)
def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    config = session.config
    if (
        os.environ.get(REQUIRED)
        and not config.stash[_ran]
        and not config.option.collectonly
        and exitstatus == pytest.ExitCode.OK
    ):
        config.stash[_outcome].append(f"SocketCAN part did not run, and {REQUIRED} is set")
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(
    terminalreporter: pytest.TerminalReporter, config: pytest.Config
) -> None:
    lines = config.stash[_outcome]
    if lines:
        terminalreporter.section("SocketCAN", sep="=", yellow=not config.stash[_ran])
        for line in lines:
            terminalreporter.write_line(line, yellow=not config.stash[_ran])
