"""What all tests share: no terminal, the SocketCAN part's report, how real-time tests are judged.

The end of a session says whether the SocketCAN part ran, and if not, what it needs. With
STAGECTL_REQUIRE_VCAN=1 a session in which it did not run fails.

A `real_time` test that fails while the machine itself was away (starvation.py) has shown nothing.
It is run again, up to REPEATS times, and is inconclusive if the machine was away each time: that
counts as skipped, and the end of the session lists it. With STAGECTL_REQUIRE_VCAN=1 more than FEW
inconclusive tests fail the session, so that a fault that shows now and then cannot hide there. A
test that fails while the machine was there has failed.
"""

import functools
import os
from contextlib import contextmanager
from pathlib import Path

# As for commands (stagectl/__main__.py): read when numpy is first imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import canopen
import hypothesis
import pytest

from tests.starvation import DisturbedError, Watch

REQUIRED = "STAGECTL_REQUIRE_VCAN"
REPEATS, FEW = 2, 5
COMPILING = ("test_mistakes.py", "test_gap_input.py", "test_ports.py", "test_identify.py")
"""In a fresh clone these compile most kernels, no two the same ones: before all that need them, and
side by side where there are workers."""
TERMINAL = (
    "COLUMNS",
    "LINES",
    "TERM",
    "NO_COLOR",
    "FORCE_COLOR",
    "TTY_COMPATIBLE",
    "TTY_INTERACTIVE",
)
"""What this suite was started from says nothing about what the tests show and read."""
_outcome = pytest.StashKey[list[str]]()
_ran = pytest.StashKey[bool]()
_watch = pytest.StashKey[Watch]()
_inconclusive = pytest.StashKey[list[str]]()

# how long an example takes is this machine's business
hypothesis.settings.register_profile(
    "any-machine", deadline=None, suppress_health_check=[hypothesis.HealthCheck.too_slow]
)
hypothesis.settings.load_profile("any-machine")


@pytest.fixture(scope="session", autouse=True)
def _each_eds_is_parsed_once():
    """To parse it takes canopen longer than most tests take, and each stage has two axes."""
    parse = canopen.import_od
    once = functools.cache(lambda path, node, content: parse(path, node))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            canopen,
            "import_od",
            lambda path, node_id=None: once(path, node_id, Path(path).read_bytes()),
        )
        yield


@pytest.fixture(scope="session")
def vcan_outcome(pytestconfig):
    """To know whether the SocketCAN tests ran, and a line for the end of the session."""

    def tell(ran, line):
        pytestconfig.stash[_ran] = pytestconfig.stash[_ran] or ran
        pytestconfig.stash[_outcome].append(line)

    return tell


def pytest_configure(config):
    for name in TERMINAL:  # of this process and those that it starts
        os.environ.pop(name, None)
    config.stash[_outcome] = []
    config.stash[_inconclusive] = []
    config.stash[_ran] = False


def pytest_collection_modifyitems(items):
    items.sort(key=lambda item: COMPILING.index(n) if (n := item.path.name) in COMPILING else 99)
    for item in items:
        if _judged(item):
            item.add_marker(pytest.mark.flaky(reruns=REPEATS, only_rerun=["DisturbedError"]))


def _judged(item):
    """Whether a failure counts only where the machine was there: not so with `judged=False`."""
    marker = item.get_closest_marker("real_time")
    return marker is not None and bool(marker.kwargs.get("judged", True))


@contextmanager
def _undisturbed(item):
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
def pytest_runtest_setup(item):
    with _undisturbed(item):
        yield


@pytest.hookimpl(wrapper=True)
def pytest_pyfunc_call(pyfuncitem):
    with _undisturbed(pyfuncitem):
        return (yield)


def pytest_unconfigure(config):
    if _watch in config.stash:
        config.stash[_watch].close()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    """Notes tests that ran on a SocketCAN bus in this session, and those that stay inconclusive."""
    report = yield
    disturbed = call.excinfo is not None and isinstance(call.excinfo.value, DisturbedError)
    if disturbed and getattr(item, "execution_count", 1) > REPEATS:
        assert call.excinfo is not None
        item.config.stash[_inconclusive].append(item.nodeid)
        path, line, _ = item.location
        report.outcome = "skipped"
        report.longrepr = (path, line or 0, f"Skipped: inconclusive: {call.excinfo.value}")
    if report.when == "call" and report.passed and "[socketcan" in item.nodeid:
        item.config.stash[_ran] = True
    return report


@pytest.hookimpl(tryfirst=True)
def pytest_sessionfinish(session, exitstatus):
    config = session.config
    if (
        os.environ.get(REQUIRED)
        and not config.stash[_ran]
        and not config.option.collectonly
        and exitstatus == pytest.ExitCode.OK
    ):
        config.stash[_outcome].append(f"SocketCAN part did not run, and {REQUIRED} is set")
        session.exitstatus = pytest.ExitCode.TESTS_FAILED
    if os.environ.get(REQUIRED) and len(config.stash[_inconclusive]) > FEW:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter, config):
    inconclusive = config.stash[_inconclusive]
    if inconclusive:
        verdict = "too many" if len(inconclusive) > FEW else f"at most {FEW} are accepted"
        terminalreporter.section("inconclusive: the machine was away", sep="=", yellow=True)
        for name in inconclusive:
            terminalreporter.write_line(name)
        terminalreporter.write_line(f"{len(inconclusive)} real-time tests; {verdict}")
    lines = config.stash[_outcome]
    if lines:
        terminalreporter.section("SocketCAN", sep="=", yellow=not config.stash[_ran])
        for line in lines:
            terminalreporter.write_line(line, yellow=not config.stash[_ran])
