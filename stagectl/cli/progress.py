"""Progress display of a run: site, what it waits for, time left, settling and friction so far.

A thread of its own draws and prints: the caller, which sends SYNC, only hands over. A terminal that
is stopped (Ctrl-S) or gone, or a full pipe, does not delay the stage.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from queue import Empty, SimpleQueue

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Column

from stagectl.recipe import Excite, MoveStep, Recipe, plan_from
from stagectl.sequencer import Event, events

REDRAW = 0.25
"""Time between two redraws [s]."""
PATIENCE = 2.0
"""Longest wait at the end for a screen that accepts no output [s]."""
_LONG = 1.0  # s; shorter waits are not worth a figure
_SCREEN_GONE = (OSError, SystemExit)
"""What rich raises when the screen is gone; a closed pipe makes it end the program."""


class RunProgress:
    """A progress bar over the moves of a run, and warnings.

    Args:
        console: to draw on; unless it is a terminal, only warnings are printed.
        recipe: to be run.
        axes: their names.
        done: completed segments of the recipe, which are not run again.
        clock: seconds, for the time left.
    """

    def __init__(
        self,
        console: Console,
        recipe: Recipe,
        axes: tuple[str, ...],
        done: int = 0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._console, self._clock = console, clock
        self._sites = len(recipe.sites)
        self._settling = ""
        self._friction: dict[str, str] = dict.fromkeys(axes, "")
        self._progress = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(bar_width=16),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("{task.fields[left]}", table_column=Column(min_width=10, no_wrap=True)),
            TextColumn("{task.fields[known]}", style="dim", markup=False),
            console=console,
            auto_refresh=False,
            transient=True,
            disable=not console.is_terminal,
            # the thread that draws must not swap streams that all others write to
            redirect_stdout=False,
            redirect_stderr=False,
        )
        steps = plan_from(recipe, done)
        self._moves = sum(isinstance(step, MoveStep | Excite) for step in steps)
        self._task = self._progress.add_task("starting", total=self._moves, left="", known="")
        self._begun = self._segment = 0
        self._first_move: float | None = None
        self._queue: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._draw_all, name="progress", daemon=True)

    def __enter__(self) -> RunProgress:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._queue.put(None)
        self._thread.join(PATIENCE)

    def phase(self, text: str) -> None:
        """Show a phase of the run before or after its moves; never waits."""
        self._queue.put(partial(self._show, text))

    def event(self, event: Event) -> None:
        """Show an event of the run; never waits."""
        self._queue.put(partial(self._take, event, self._clock()))

    def _draw_all(self) -> None:
        """Take what was handed over, and redraw, also without events: the clock shown runs on."""
        wait = REDRAW if self._console.is_terminal else None
        with suppress(*_SCREEN_GONE):
            self._progress.start()
        redraw_at = 0.0
        while True:
            with suppress(*_SCREEN_GONE, Empty):
                job = self._queue.get(timeout=wait)
                if job is None:
                    break
                job()
            with suppress(*_SCREEN_GONE):
                if wait is not None and time.monotonic() >= redraw_at:
                    redraw_at = time.monotonic() + REDRAW
                    self._progress.refresh()
        with suppress(*_SCREEN_GONE):
            self._progress.stop()

    def _take(self, event: Event, now: float) -> None:
        match event:
            case events.Limitation() | events.ObserverFound():
                self._warn(event.text)
            case events.MoveStarted():
                self._first_move = now if self._first_move is None else self._first_move
                self._begun += 1
                self._count(self._begun - 1, now)
                self._show(f"{self._where(event.site)}{event.kind}-move")
            case events.Waiting(site=site, reason=reason, most=most):
                limit = "" if most is None or most < _LONG else f", at most {most:g} s"
                self._show(f"{self._where(site)}{reason}{limit}")
            case events.Settled():
                self._count(self._begun, now)
                took = f"{event.duration * 1e3:.0f} ms"
                self._settling = f"settled in {took}" if event.settled else f"not settled in {took}"
                if not event.settled:
                    self._warn(
                        f"{self._where(event.site)}{event.kind}-move did not settle in {took}"
                    )
            case events.FrictionUpdated():
                mark = "" if event.estimate.accepted else "?"
                level = event.estimate.friction.coulomb
                self._friction[event.axis] = f"Fc {event.axis} {level:.3g} N{mark}"
            case events.SegmentDone():
                self._segment = self._begun
                self._count(self._begun, now)
            case events.MarkNotFound():
                self._moves -= 1
                self._progress.update(self._task, total=self._moves)
                self._warn(f"site {event.site}: mark not found, no micro-move")
            case events.Retrying():
                self._begun = self._segment
                what = "site" if self._sites else "move"
                self._warn(
                    f"{what} {event.segment}: {event.fault}; restarting "
                    f"(attempt {event.attempt} of {event.limit})"
                )
            case events.LevelStepped(axis=axis, place=(x, y), change=change, everywhere=everywhere):
                where = "everywhere" if everywhere else f"at ({x * 1e3:.3f}, {y * 1e3:.3f}) mm"
                self._warn(f"friction of axis {axis} stepped by {100 * change:+.0f} % {where}")
            case events.Stopping():
                self._show(f"stopping: {event.reason}")

    def _where(self, site: int | None) -> str:
        return "" if site is None else f"site {site}/{self._sites} "

    def _warn(self, text: str) -> None:
        """Print what the operator must know, on a terminal or in a log."""
        self._progress.console.print(text, style="yellow", highlight=False)

    def _show(self, words: str) -> None:
        known = ", ".join(part for part in (self._settling, *self._friction.values()) if part)
        self._progress.update(self._task, description=words, known=known)

    def _count(self, done: int, now: float) -> None:
        self._progress.update(self._task, completed=done)
        if done and self._first_move is not None:  # as long per move as so far
            left = (now - self._first_move) / done * (self._moves - done)
            self._progress.update(self._task, left=f"{clock_time(left)} left")


def clock_time(seconds: float) -> str:
    """A duration as on a clock, `1:02:03` or `2:03`."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
