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
import gc
import os
from contextlib import contextmanager
from pathlib import Path

# As for commands (stagectl/__main__.py): read when numpy is first imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import canopen
import hypothesis
import pytest

from stagectl.__main__ import BETWEEN_COLLECTIONS
from tests.starvation import DisturbedError, Watch

REQUIRED = "STAGECTL_REQUIRE_VCAN"
REPEATS, FEW = 2, 5
INCONCLUSIVE = "Skipped: inconclusive"
FIRST = (
    "test_mistakes.py", "test_gap_input.py", "test_ports.py", "test_identify.py",
    "test_vcan.py", "test_server.py", "test_console_in_browser.py", "test_procedure.py",
    "test_along_motion.py", "test_cache.py",
)  # fmt: skip
"""In a fresh clone the first four compile most kernels, no two the same ones: before all that need
them, and side by side where there are workers. The others take longest: begun late, one of them
would go on when the other workers have nothing left to do."""
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
_watch = pytest.StashKey[Watch]()

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


@pytest.fixture
def vcan_outcome(record_property):
    """To note whether the SocketCAN tests ran, and a line for the end of the session."""
    return lambda ran, line: record_property("socketcan", (ran, line))


def pytest_configure():
    gc.set_threshold(BETWEEN_COLLECTIONS)
    for name in TERMINAL:  # of this process and those that it starts
        os.environ.pop(name, None)


def pytest_collection_modifyitems(items):
    items.sort(key=lambda item: FIRST.index(n) if (n := item.path.name) in FIRST else len(FIRST))
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
    """A test that stays inconclusive counts as skipped."""
    report = yield
    disturbed = call.excinfo is not None and isinstance(call.excinfo.value, DisturbedError)
    if disturbed and getattr(item, "execution_count", 1) > REPEATS:
        assert call.excinfo is not None
        path, line, _ = item.location
        report.outcome = "skipped"
        report.longrepr = (path, line or 0, f"{INCONCLUSIVE}: {call.excinfo.value}")
    return report


class Session:
    """What the reports of a session say, those of its workers included.

    Attributes:
        lines: on SocketCAN.
        on_socketcan: tests ran there.
        inconclusive: names of tests.
    """

    def __init__(self, config):
        terminal = config.pluginmanager.get_plugin("terminalreporter")
        reports = [r for each in terminal.stats.values() for r in each if hasattr(r, "when")]
        noted = [
            value
            for report in reports
            for name, value in getattr(report, "user_properties", ())  # none of a file's collection
            if name == "socketcan"
        ]
        self.lines = list(dict.fromkeys(line for _, line in noted))
        self.on_socketcan = any(ran for ran, _ in noted) or any(
            r.when == "call" and r.passed and "[socketcan" in r.nodeid for r in reports
        )
        self.inconclusive = [
            r.nodeid for r in reports if r.skipped and INCONCLUSIVE in str(r.longrepr)
        ]


def _required(config):
    worker = hasattr(config, "workerinput")
    return bool(os.environ.get(REQUIRED)) and not worker and not config.option.collectonly


@pytest.hookimpl(tryfirst=True)
def pytest_sessionfinish(session, exitstatus):
    if _required(session.config):
        found = Session(session.config)
        lacking = exitstatus == pytest.ExitCode.OK and not found.on_socketcan
        if lacking or len(found.inconclusive) > FEW:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter, config):
    found = Session(config)
    if found.inconclusive:
        verdict = "too many" if len(found.inconclusive) > FEW else f"at most {FEW} are accepted"
        terminalreporter.section("inconclusive: the machine was away", sep="=", yellow=True)
        for name in found.inconclusive:
            terminalreporter.write_line(name)
        terminalreporter.write_line(f"{len(found.inconclusive)} real-time tests; {verdict}")
    lines = found.lines
    if _required(config) and not found.on_socketcan:
        lines = [*lines, f"SocketCAN part did not run, and {REQUIRED} is set"]
    if lines:
        terminalreporter.section("SocketCAN", sep="=", yellow=not found.on_socketcan)
        for line in lines:
            terminalreporter.write_line(line, yellow=not found.on_socketcan)
