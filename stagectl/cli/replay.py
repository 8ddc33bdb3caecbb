"""`stagectl replay`: a recorded bus log drives the host again."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.options import JSON_FILE, quietly, write_json

if TYPE_CHECKING:
    from stagectl.run.replay.rerun import Replayed
    from stagectl.store import LoggedFrame


@click.command(short_help="A recorded bus log drives the host again.")
@click.argument("run", type=click.Path(path_type=Path, file_okay=False))
@click.option(
    "--json", "json_out", type=JSON_FILE, help="Also write the outcome here; - is stdout."
)
def command(run: Path, json_out: Path | None) -> None:
    """Run the host again on the bus log in folder RUN, and tell the first frame that differs.

    The host gets every frame that it got then and has to send what it sent then: after a change
    of the software, of a library or of the computer this shows whether, and where, it behaves
    differently. No bus is touched and nothing moves. Runs in virtual time (--simulate) only.

    Exit code 0 the same, 1 different or a log that was changed, 2 unusable input.
    """
    from rich.console import Console

    from stagectl.run import Listener
    from stagectl.run.replay.rerun import replay
    from stagectl.sequencer import Event, MoveStarted

    with Console(stderr=True).status("reading") as status:

        def told(event: Event) -> None:
            if isinstance(event, MoveStarted):
                where = "" if event.site is None else f" of site {event.site}"
                status.update(f"{event.kind}-move{where}")

        result = replay(run, Listener(event=told))
    if json_out is not None:
        write_json(_as_dict(result), json_out)
    if not quietly(json_out):
        for line in _lines(result, run):
            click.echo(line)
    if result.difference is not None or result.sealed is False:
        raise click.exceptions.Exit(1)


def _lines(result: Replayed, run: Path) -> list[str]:
    lines = []
    if result.sealed is False:
        lines.append(f"{run}: the bus log is not as the run wrote it (SHA-256 {result.digest})")
    elif result.sealed is None:
        lines.append(f"{run}: the bus log carries no digest")
    known = f"{result.compared} frames of the host are the same, {result.frames} in the log"
    difference = result.difference
    if difference is None:
        until = " up to where it was killed" if result.outcome == "killed" else ""
        return [*lines, f"{run}: the host does the same again{until} ({known})"]
    lines.append(f"{run}: the host differs at frame {difference.number} ({known})")
    lines.append(f"  then: {_frame(difference.recorded, result, 'the log ends')}")
    lines.append(f"  now:  {_frame(difference.sent, result, 'nothing more is sent')}")
    return lines


def _frame(frame: LoggedFrame | None, result: Replayed, nothing: str) -> str:
    from stagectl.run.replay.meaning import meaning

    if frame is None:
        return nothing
    data = frame.data.hex(" ").upper() or "no data"
    text = meaning(frame.can_id, frame.data, result.machine)
    return f"{frame.time_ns * 1e-9:.6f} s, 0x{frame.can_id:03X}, {data}: {text}"


def _as_dict(result: Replayed) -> dict[str, Any]:
    from stagectl.run.replay.meaning import meaning

    def frame(one: LoggedFrame | None) -> dict[str, Any] | None:
        if one is None:
            return None
        return {
            "time": round(one.time_ns * 1e-9, 9),
            "id": one.can_id,
            "data": one.data.hex(),
            "meaning": meaning(one.can_id, one.data, result.machine),
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
            "recorded": frame(difference.recorded),
            "sent": frame(difference.sent),
        },
    }
