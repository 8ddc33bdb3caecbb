"""`stagectl replay`: the host, rerun on a recorded bus log."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.files import InputFolder
from stagectl.cli.options import JSON_OUT
from stagectl.cli.terminal import make_console, show_result

if TYPE_CHECKING:
    from stagectl.run.replay import ReplayResult
    from stagectl.store import LoggedFrame


@click.command
@click.argument("run", type=InputFolder())
@JSON_OUT
def command(run: Path, json_out: Path | None) -> None:
    """Rerun the host on the bus log in folder RUN and report the first frame that differs.

    The host receives every recorded frame and must send exactly what it sent then. After a change
    of software, library or computer this shows whether, and where, the host behaves differently.
    No bus is opened and nothing moves. Only for runs in virtual time (--simulate).

    Exit code 0 identical, 1 different or the log was modified, 2 unusable input.
    """
    from rich.text import Text

    from stagectl.run import Listener
    from stagectl.run.replay import replay
    from stagectl.sequencer import Event, events

    with make_console(stderr=True).status("reading") as status:

        def show(event: Event) -> None:
            if isinstance(event, events.MoveStarted):
                where = "" if event.site is None else f" of site {event.site}"
                status.update(Text(f"{event.kind}-move{where}"))

        result = replay(run, Listener(event=show))
    show_result(_as_dict(result), json_out, *_lines(result, run))
    if result.difference is not None or result.sealed is False:
        raise click.exceptions.Exit(1)


def _lines(result: ReplayResult, run: Path) -> list[str]:
    lines = []
    if result.sealed is False:
        lines.append(f"{run}: the bus log was modified after the run (SHA-256 {result.digest})")
    elif result.sealed is None:
        lines.append(f"{run}: the bus log has no digest, so changes to it go unnoticed")
    known = f"{result.compared} identical frames from the host, {result.frames} in the log"
    difference = result.difference
    if difference is None:
        until = " up to where the run was killed" if result.outcome == "killed" else ""
        return [*lines, f"{run}: the host behaves identically{until} ({known})"]
    lines.append(f"{run}: the host differs at frame {difference.number} ({known})")
    then, now = result.words
    lines.append(f"  then: {_frame(difference.recorded, then) or 'the log ends'}")
    lines.append(f"  now:  {_frame(difference.sent, now) or 'nothing more is sent'}")
    return lines


def _frame(frame: LoggedFrame | None, words: str) -> str:
    if frame is None:
        return ""
    data = frame.data.hex(" ").upper() or "no data"
    return f"{frame.time_ns * 1e-9:.6f} s, 0x{frame.can_id:03X}, {data}: {words}"


def _as_dict(result: ReplayResult) -> dict[str, Any]:
    def frame(one: LoggedFrame | None, words: str) -> dict[str, Any] | None:
        if one is None:
            return None
        return {
            "time": round(one.time_ns * 1e-9, 9),
            "id": one.can_id,
            "data": one.data.hex(),
            "meaning": words,
        }

    difference = result.difference
    return {
        "format": "stagectl-replay",
        "version": 1,
        "frames": result.frames,
        "compared": result.compared,
        "digest": result.digest,
        "sealed": result.sealed,
        "outcome": result.outcome,
        "difference": None
        if difference is None
        else {
            "number": difference.number,
            "recorded": frame(difference.recorded, result.words[0]),
            "sent": frame(difference.sent, result.words[1]),
        },
    }
