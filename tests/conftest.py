"""What all tests share: what is told of the SocketCAN part, and how tests in real time are judged.

The end of a session says whether the SocketCAN part ran, and if not, what it takes. With
STAGECTL_REQUIRE_VCAN=1 a session in which it did not run fails.

A test marked `real_time` that fails is run again, up to REPEATS times, where the machine itself was
away meanwhile (starvation.py): it says nothing then. Where the machine was there, it has failed.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager

import hypothesis
import pytest

from stagectl.kernel_cache import drop_stale
from tests.starvation import DisturbedError, Watch

REQUIRED = "STAGECTL_REQUIRE_VCAN"
REPEATS = 5
COMPILING = ("test_mistakes.py", "test_gap_input.py", "test_ports.py", "test_identify.py")
"""In a fresh clone these compile most kernels, no two the same ones: before all that need them, and
side by side where there are workers."""
_outcome = pytest.StashKey[list[str]]()
_ran = pytest.StashKey[bool]()
_watch = pytest.StashKey[Watch]()

# how long an example takes is this machine's business
hypothesis.settings.register_profile(
    "any-machine", deadline=None, suppress_health_check=[hypothesis.HealthCheck.too_slow]
)
hypothesis.settings.load_profile("any-machine")


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


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: COMPILING.index(n) if (n := item.path.name) in COMPILING else 99)
    for item in items:
        if _judged(item):
            item.add_marker(pytest.mark.flaky(reruns=REPEATS, only_rerun=["DisturbedError"]))


def _judged(item: pytest.Item) -> bool:
    """Whether a failure counts only where the machine was there: not so with `judged=False`."""
    marker = item.get_closest_marker("real_time")
    return marker is not None and bool(marker.kwargs.get("judged", True))


@contextmanager
def _undisturbed(item: pytest.Item) -> Iterator[None]:
    if not _judged(item):
        yield
        return
    stash = item.config.stash
    if _watch not in stash:
        stash[_watch] = Watch()
    begin = stash[_watch].forget()
    try:
        yield
    except (Exception, pytest.fail.Exception) as why:
        absence = stash[_watch].since(begin)
        if absence.matters:
            raise DisturbedError(f"{absence}: {why}") from why
        raise


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup(item: pytest.Item) -> Generator[None, None, None]:
    with _undisturbed(item):
        yield


@pytest.hookimpl(wrapper=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> Generator[None, object, object]:
    with _undisturbed(pyfuncitem):
        return (yield)


def pytest_unconfigure(config: pytest.Config) -> None:
    if _watch in config.stash:
        config.stash[_watch].close()


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
