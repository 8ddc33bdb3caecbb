"""The progress display of a run on a terminal: a pseudo terminal, read here."""

import os
import pty
import re
import sys
import threading
import time
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from stagectl.cli.plain_terminal import PlainConsole
from stagectl.cli.progress import RunProgress, clock_time
from stagectl.config import load_machine
from stagectl.recipe import load_recipe
from stagectl.sequencer import MoveStarted, Retrying, SegmentDone, Settled, Waiting

RECIPE = Path(__file__).parents[4] / "recipes" / "inspection-20.yaml"
DEADLINE = 600.0  # only ends a wait that would otherwise never end


class Terminal:
    """A terminal of 160 columns, whose output is read only by `wait_for`."""

    def __init__(self):
        self._screen, slave = pty.openpty()
        self._seen = ""
        self.file = os.fdopen(slave, "w")
        self.console = PlainConsole(file=self.file, force_terminal=True, width=160)

    def wait_for(self, pattern):
        """Read until the pattern has been drawn."""
        ends = time.monotonic() + DEADLINE
        while (found := re.search(pattern, self._seen)) is None:
            assert time.monotonic() < ends, self._seen[-500:]
            self._seen += os.read(self._screen, 4096).decode()
        self._seen = self._seen[found.end() :]
        return found[0]

    def drain(self):
        """Read everything from now on."""

        def read():
            try:
                while os.read(self._screen, 4096):
                    pass
            except OSError:  # closed
                return

        threading.Thread(target=read, daemon=True).start()


@pytest.fixture
def terminal():
    return Terminal()


@pytest.fixture(scope="module")
def recipe():
    return load_recipe(RECIPE, load_machine())


@contextmanager
def shown(terminal, recipe, *times):
    clock = iter(times)
    with RunProgress(
        terminal.console, recipe, ("x", "y"), clock=lambda: next(clock, times[-1] if times else 0.0)
    ) as progress:
        yield progress
        terminal.drain()


def test_the_clock_runs_while_nothing_happens_and_the_process_keeps_its_streams(terminal, recipe):
    before = sys.stdout, sys.stderr  # swapped by a thread, they may come back at any time
    with shown(terminal, recipe) as progress:
        progress.phase("homing")
        terminal.wait_for("homing.*0:00:01")
        assert (sys.stdout, sys.stderr) == before
        terminal.wait_for("homing.*0:00:02")


def test_what_the_stage_waits_for_is_shown(terminal, recipe):
    with shown(terminal, recipe) as progress:
        progress.event(Waiting(3, "dwelling", 90.0))
        terminal.wait_for(r"site 3/20 dwelling, at most 90 s")
        progress.event(Waiting(3, "settling", 0.15))
        terminal.wait_for(r"site 3/20 settling ")
        progress.event(Waiting(3, "looking for the mark", None))
        terminal.wait_for("site 3/20 looking for the mark ")


def test_the_time_left_is_that_of_the_moves_to_come(terminal, recipe):
    with shown(terminal, recipe, 0.0, 30.0, 60.0) as progress:  # 40 moves
        progress.event(MoveStarted(1, "macro", 0.0))
        progress.event(MoveStarted(1, "micro", 30.0))
        terminal.wait_for("1/40.*19:30 left")
        progress.event(MoveStarted(2, "macro", 60.0))
        terminal.wait_for("2/40.*19:00 left")


def test_a_repeated_site_is_counted_once(terminal, recipe):
    with shown(terminal, recipe, *range(100)) as progress:
        for kind in ("macro", "micro"):
            progress.event(MoveStarted(1, kind, 0.0))
        progress.event(SegmentDone(1, 1))
        for attempt in (1, 2):
            progress.event(MoveStarted(2, "macro", 0.0))
            progress.event(MoveStarted(2, "micro", 0.0))
            progress.event(Retrying(2, attempt, 2, "gone"))
        progress.event(MoveStarted(2, "macro", 0.0))
        terminal.wait_for("attempt 2 of 2")
        terminal.wait_for("2/40")


def test_the_last_move_is_counted(terminal, recipe):
    with RunProgress(terminal.console, recipe, ("x", "y"), done=19) as progress:
        for kind in ("macro", "micro"):
            progress.event(MoveStarted(20, kind, 0.0))
            progress.event(Settled(20, kind, 0.01, True))
        terminal.wait_for("2/2.*0:00 left")
        terminal.drain()


def test_a_stopped_terminal_does_not_hold_up_the_caller(terminal, recipe):
    with shown(terminal, recipe) as progress:
        for _ in range(3000):  # many times what a terminal takes that nobody reads
            progress.event(Settled(1, "macro", 0.15, False))


def test_a_full_pipe_does_not_hold_up_the_caller(recipe):
    read, write = os.pipe()
    log = os.fdopen(write, "w")
    with RunProgress(PlainConsole(file=log, width=80), recipe, ("x", "y")) as progress:
        for _ in range(3000):
            progress.event(Settled(1, "macro", 0.15, False))
    os.close(read)  # the thread, which is still writing, finds a broken pipe
    for thread in threading.enumerate():
        if thread.name == "progress":
            thread.join(DEADLINE)
    with suppress(BrokenPipeError):
        log.close()


def test_warnings_go_to_a_log_in_order(recipe, tmp_path):
    with (tmp_path / "log").open("w") as log:
        with RunProgress(PlainConsole(file=log, width=80), recipe, ("x", "y")) as progress:
            for site in range(1, 4):
                progress.event(Settled(site, "macro", 0.15, False))
    assert (tmp_path / "log").read_text().splitlines() == [
        f"site {site}/20 macro-move did not settle in 150 ms" for site in range(1, 4)
    ]


@pytest.mark.parametrize(("seconds", "text"), [(0.4, "0:00"), (59.6, "1:00"), (3661, "1:01:01")])
def test_durations_are_written_as_on_a_clock(seconds, text):
    assert clock_time(seconds) == text
