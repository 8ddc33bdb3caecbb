"""Commands on a stage that a server owns: found by its bus, or named with --server."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.errors import Aborted, RunFault, StagectlError, UnusableInput

if TYPE_CHECKING:
    from stagectl.cli.stage_options import StageOptions
    from stagectl.client import Client
    from stagectl.config import Machine
    from stagectl.protocol.requests import Command
    from stagectl.protocol.state import Job, Notice
    from stagectl.run import Listener, RunRequest, RunResult
    from stagectl.sequencer import Event

_LOOK = 0.2
"""Between two looks at a run under way [s]."""


def server_for(
    machine: Machine, bus: tuple[str, str] | None, named: str | None, models: bool = False
) -> Client | None:
    """The server that owns the stage: the one named, or that of the machine's bus.

    Args:
        machine: the command's machine file.
        bus: of the command, in place of the machine's.
        named: by --server.
        models: whether the server may have another machine file, since it is sent this one.

    Raises:
        NoServer: the one named does not run.
        UnusableInput: the one named serves another machine file.
    """
    from stagectl.client import Client, find_server

    if named is not None:
        client = Client(named)
        if not (models or _serves(client, machine)):
            other = client.info.machine_file
            client.close()
            raise UnusableInput(f"server {named!r} serves {other}, not {machine.source}")
        return client
    where = find_server(*(bus or (machine.bus.interface, str(machine.bus.channel))))
    if where is None:
        return None
    client = Client(where)
    if models or _serves(client, machine):
        click.echo(f"by the stage server '{where.name}'", err=True)
        return client
    click.echo(
        f"the stage server '{where.name}' serves another machine file ({client.info.machine_file})",
        err=True,
    )
    client.close()
    return None


@contextmanager
def stage_for(
    stage: StageOptions, server: str | None, moves: bool = True, models: bool = False
) -> Iterator[tuple[Machine, Machine | None, Client | None]]:
    """The machine files of a command, and the stage server that it uses, if any.

    Args:
        stage: options of the command.
        server: by --server.
        moves: whether the stage is to move.
        models: as of `server_for`.

    Yields:
        The host's machine; the simulated stage's, or None; the client of the server, or None.

    Raises:
        click.UsageError, ConfigError: as `StageOptions.load`.
        NoServer, UnusableInput: as `server_for`.
    """
    if stage.simulate is not None and server is not None:
        raise click.UsageError("--server cannot be combined with --simulate")
    believed, truth = stage.load(moves and server is None)
    client = None
    if moves and stage.simulate is None:
        client = server_for(believed, stage.bus, server, models)
    if client is None:
        yield believed, truth, None
        return
    with client:
        yield believed, believed if client.info.simulated else None, client


def require_no_server(machine: Machine, bus: tuple[str, str] | None) -> None:
    """For what needs the stage for itself.

    Raises:
        UnusableInput: a server owns the bus.
    """
    from stagectl.client import find_server

    where = find_server(*(bus or (machine.bus.interface, str(machine.bus.channel))))
    if where is not None:
        raise UnusableInput(
            f"the stage server '{where.name}' owns this bus; this needs it for itself: end the "
            "server first"
        )


def _serves(client: Client, machine: Machine) -> bool:
    return client.info.machine_digest == hashlib.sha256(machine.text.encode()).hexdigest()


@contextmanager
def by_server() -> Iterator[None]:
    """Turn refusals and failures of a server into those of a command."""
    from stagectl.client import JobFailed, Refused
    from stagectl.client.base import as_command_error

    try:
        yield
    except Refused as refused:
        raise as_command_error(refused) from refused
    except JobFailed as failed:
        raise failed.as_command_error() from failed


def do(client: Client, command: Command) -> Job:
    """Have the server do something; Ctrl-C and SIGTERM stop it.

    Raises:
        StagectlError: as the command without a server.
    """
    from stagectl.cli.signals import interruptible
    from stagectl.client import JobFailed

    with by_server(), interruptible() as stopped:
        job = client.begin(command)
        stopped()
        while True:
            found = client.look(job, _LOOK)
            if found.ended:
                if found.error is not None:
                    raise JobFailed(found)
                return found
            if stopped():
                client.stop("Ctrl-C")
                raise click.exceptions.Abort


def run_on(
    client: Client, resume: Path | None, request: RunRequest, listener: Listener
) -> RunResult:
    """Run a recipe on the server's stage, and wait for its files.

    Args:
        client: of the server.
        resume: folder of the run that is continued, or None.
        request: what to run.
        listener: is told phases and events, and how to ask for a controlled stop.

    Raises:
        StagectlError: the server refuses it, or ends.
    """
    from stagectl.protocol.requests import Abort, MachineFile, QueueAdd, RunOptions

    host, machine = request.host, None
    if not _serves(client, request.machine):
        source = str(Path(request.machine.source).absolute())
        machine = MachineFile(text=request.machine.text, source=source)
    asked = QueueAdd(
        recipe=request.recipe.text,
        source=str(Path(request.recipe.source).absolute()),
        folder=str(request.folder.absolute()),
        operator=request.remarks.operator,
        comment=request.remarks.comment,
        resume=None if resume is None else str(resume.absolute()),
        places=request.recipe.sites if request.recipe.excursions else None,
        options=RunOptions(
            compensation=host.mode.value, friction_scale=host.friction_scale,
            observer=host.observer, use_map=host.use_map, retries=request.retries,
            history=_anywhere(request.history),
        ),
        machine=machine,
        start=True,
    )  # fmt: skip
    reasons: list[str] = []
    listener.stoppable(reasons.append)
    with by_server():
        before = client.state()
        if before.run is not None or any(e.status == "waiting" for e in before.queue):
            raise UnusableInput("the stage server is running something else, or its queue waits")
        number = client.ask(asked)["id"]
        seen = before.event
        while True:
            for notice in client.notices(seen):
                seen = notice.number
                _show(notice, listener)
                if notice.kind == "end" and notice.data.get("id") == number:
                    return _result(request.folder, notice)
            if reasons and reasons[0]:
                client.ask(Abort(reason=reasons[0]))
                reasons[:] = [""]
            time.sleep(_LOOK)


def _anywhere(history: str | None) -> str:
    """A history for a process in another folder."""
    from stagectl.config import is_server

    if history is None:
        return "none"
    return history if is_server(history) else str(Path(history).absolute())


def _show(notice: Notice, listener: Listener) -> None:
    if notice.kind == "phase":
        listener.phase(notice.text)
    elif (event := _event(notice.kind, notice.text, notice.data)) is not None:
        listener.event(event)


def _event(kind: str, text: str, data: dict[str, Any]) -> Event | None:
    """The event that a notice is about, where the progress display shows it."""
    from stagectl import sequencer as s

    site = data.get("site")
    match kind:
        case "limitation" | "observer" | "stepped" | "alarm":
            return s.Limitation(text)
        case "move_started":
            return s.MoveStarted(site, str(data["kind"]), float(data["at"]))
        case "waiting":
            return s.Waiting(site, str(data["reason"]), data["most"])
        case "settled":
            return s.Settled(site, str(data["kind"]), data["duration"], data["settled"])
        case "segment_done":
            return s.SegmentDone(int(data["number"]), site)
        case "mark_not_found":
            return s.MarkNotFound(int(data["site"]))
        case "stopping":
            return s.Stopping(text)
    return None


def _result(folder: Path, end: Notice) -> RunResult:
    """The run's result, of its files."""
    from stagectl.run import RunResult
    from stagectl.run.recorded.summarise import site_verdicts
    from stagectl.store import RECORDING_NAME, read_recording

    outcome, reason = end.data["outcome"], end.data["reason"]
    errors: dict[str, Callable[[str], StagectlError]] = {"aborted": Aborted, "fault": RunFault}
    error = errors[outcome](reason) if outcome in errors else None
    path = folder / "summary.json"
    if not path.exists():
        raise error or StagectlError(reason or f"{folder}: the run has left no summary")
    summary = json.loads(path.read_text(encoding="utf-8"))
    recording = folder / RECORDING_NAME
    return RunResult(
        summary,
        read_recording(recording) if recording.exists() else None,
        error,
        {},
        site_verdicts(summary),
    )
