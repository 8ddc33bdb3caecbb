"""Progress display of a run: site, phase, settling and friction so far.

Redrawn on events, not by a thread, so nothing here competes with the SYNC cycle. A closed pipe or a
lost terminal does not stop the stage.
"""

from __future__ import annotations

from contextlib import suppress
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from stagectl.recipe import MoveStep, Recipe, plan
from stagectl.sequencer import (
    DriveLimited,
    Event,
    Exposed,
    FrictionUpdated,
    LevelStepped,
    MarkNotFound,
    MoveStarted,
    Retrying,
    Settled,
    Stopping,
)

REDRAW = 0.1
"""Shortest time between two redraws [s]."""
_SCREEN_GONE = (OSError, SystemExit)
"""What rich raises when the screen is gone; a closed pipe makes it end the program."""


class RunProgress:
    """A progress bar over the moves of a run, and warnings.

    Args:
        console: to draw on; unless it is a terminal, only warnings are printed.
        recipe: to be run.
        axes: their names.
    """

    def __init__(self, console: Console, recipe: Recipe, axes: tuple[str, ...]) -> None:
        self._console = console
        self._sites = len(recipe.sites)
        self._settling = ""
        self._friction: dict[str, str] = dict.fromkeys(axes, "")
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(bar_width=24),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("{task.fields[known]}", style="dim"),
            console=console,
            auto_refresh=False,
            transient=True,
            disable=not console.is_terminal,
        )
        moves = sum(isinstance(step, MoveStep) for step in plan(recipe))
        self._task = self._progress.add_task("starting", total=moves, known="")
        self._begun = 0
        self._redraw_at = 0.0

    def __enter__(self) -> RunProgress:
        self._progress.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        with suppress(*_SCREEN_GONE):
            self._progress.stop()

    def phase(self, text: str) -> None:
        """Show a phase of the run before or after its moves."""
        self._draw(text)

    def event(self, event: Event) -> None:
        """Show an event of the run."""
        match event:
            case DriveLimited(text=text):
                self._warn(text)
            case MoveStarted():
                self._begun += 1
                self._draw(f"{self._where(event.site)}{event.kind}-move", self._begun - 1)
            case Settled():
                took = f"{event.duration * 1e3:.0f} ms"
                self._settling = f"settled in {took}" if event.settled else f"not settled in {took}"
                if not event.settled:
                    self._warn(
                        f"{self._where(event.site)}{event.kind}-move did not settle in {took}"
                    )
            case FrictionUpdated():
                mark = "" if event.estimate.accepted else "?"
                level = event.estimate.friction.coulomb
                self._friction[event.axis] = f"Fc {event.axis} {level:.3g} N{mark}"
            case Exposed():
                self._draw(f"{self._where(event.site)}exposed", self._begun)
            case MarkNotFound():
                self._warn(f"site {event.site}: mark not found, no micro-move")
            case Retrying():
                what = "site" if self._sites else "move"
                self._warn(
                    f"{what} {event.stretch}: {event.fault}; restarting "
                    f"(attempt {event.attempt} of {event.limit})"
                )
            case LevelStepped(axis=axis, place=(x, y), change=change, everywhere=everywhere):
                where = "everywhere" if everywhere else f"at ({x * 1e3:.3f}, {y * 1e3:.3f}) mm"
                self._warn(f"friction of axis {axis} stepped by {change:+.0%} {where}")
            case Stopping():
                self._draw(f"stopping: {event.reason}")

    def _where(self, site: int | None) -> str:
        return "" if site is None else f"site {site}/{self._sites} "

    def _warn(self, text: str) -> None:
        """Print what the operator must know, on a terminal or in a log."""
        with suppress(*_SCREEN_GONE):
            self._progress.console.print(text, style="yellow", markup=False, highlight=False)

    def _draw(self, words: str, done: int | None = None) -> None:
        known = ", ".join(part for part in (self._settling, *self._friction.values()) if part)
        self._progress.update(self._task, description=words, completed=done, known=known)
        now = self._progress.get_time()
        if now >= self._redraw_at:
            self._redraw_at = now + REDRAW
            with suppress(*_SCREEN_GONE):
                self._progress.refresh()
