"""`stagectl fleet`: diagnoses of many recordings, and what they say together."""

from __future__ import annotations

import os
import shlex
import time
import warnings
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.files import HistoryFile
from stagectl.cli.lazy import LazyGroup
from stagectl.cli.options import FILE, JSON_OUT, option, takes
from stagectl.cli.progress import clock_time
from stagectl.cli.signals import interruptible
from stagectl.cli.terminal import console_for, progress_bar, show_result
from stagectl.errors import StagectlError, missing_extra

if TYPE_CHECKING:
    from stagectl.fleet import Done, Folder, Job, Ledger, Outcome, Source

COMMANDS = {
    "diagnose": ("stagectl.cli.fleet:diagnose", "Diagnose many recordings, each by itself."),
    "summary": ("stagectl.cli.fleet:summary", "Which stages are worst, by what, and what is due."),
}
FORMAT, VERSION = "stagectl-fleet", 1


@click.group(cls=LazyGroup, lazy=COMMANDS)
def command() -> None:
    """Diagnose recordings of many stages on all processors, or on a cluster.

    \b
    What has changed since yesterday?
      stagectl fleet diagnose runs --out fleet
      stagectl fleet summary fleet
    From an object store, on a cluster:
      stagectl fleet diagnose 's3://fab/2026-*/*.h5' --out s3://fab/fleet \\
        --scheduler tcp://HOST:8786
    """  # noqa: D301  (\b keeps click from wrapping what follows)


@dataclass(frozen=True)
class _Where:
    """Who does it."""

    scheduler: str | None = option(
        "Scheduler of a dask cluster.  [default: processes of this machine]", metavar="ADDRESS"
    )
    workers: int | None = option(
        "Processes to start.  [default: one for each processor]", click.IntRange(1)
    )


@dataclass(frozen=True)
class _How:
    """How each is diagnosed."""

    machine: Path | None = option("Machine file to examine.  [default: each recording's own]", FILE)
    correct: bool = option(
        "Correct faulty channels and continue with them.  [default: no]",
        default=False,
        flags="--correct/--no-correct",
        show_default=False,
    )


@click.command("diagnose")
@click.argument("recordings", nargs=-1, required=True, metavar="RECORDINGS...")
@click.option("--out", required=True, metavar="FOLDER|URL", help="Where results are kept.")
@takes(_Where)
@takes(_How)
@click.option(
    "--history", type=HistoryFile(), help="Also keep the friction of all runs in this history."
)
@JSON_OUT
def diagnose(
    where: _Where,
    how: _How,
    recordings: tuple[str, ...],
    out: str,
    history: str | None,
    json_out: Path | None,
) -> None:
    """Diagnose every recording by itself, as `gap diagnose` does, and keep the results.

    RECORDINGS are files, folders, globs, or URLs of any file system that fsspec knows, such as
    s3://BUCKET/FOLDER. A recording that has been diagnosed by this version, with the same machine
    file, is not diagnosed again: an interrupted command goes on where it was, and the same command
    every night adds what is new. With --scheduler all workers have to reach RECORDINGS and --out.

    Recordings that cannot be used, and those whose diagnosis fails, are listed with the reason.
    """
    fleet = _fleet()
    if where.scheduler is not None and where.workers is not None:
        raise click.UsageError("--workers: a cluster has workers of its own (--scheduler)")
    sources = fleet.find_recordings(recordings)
    folder = fleet.Folder(out)
    ledger = fleet.Ledger(folder)
    if history is not None:
        fleet.keep_friction(history, folder)
    todo, done = ledger.split(_jobs(sources, folder, how))
    ran = _Ran(ledger, folder, len(todo))
    for each in done:
        ran.note(each)
    ledger.save()  # before a long computation, to see that it can be written
    try:
        if todo:
            ran.run(todo, _connect(where, len(todo)), json_out)
    finally:
        ledger.adopt(todo)
        ledger.save()
    report = ran.report(len(sources))
    show_result(report, json_out, *_lines(report))
    if ran.stopped:
        click.echo("stopped; the same command continues", err=True)
        click.get_current_context().exit(130)


def _fleet() -> Any:
    """The room, or a line that says what it needs."""
    try:
        import dask
        import distributed
        import fsspec
        import pyarrow
    except ImportError as error:
        raise missing_extra("fleets need", str(error.name), "fleet") from error
    del dask, distributed, fsspec, pyarrow
    from stagectl import fleet

    return fleet


def _jobs(sources: list[Source], folder: Folder, how: _How) -> list[Job]:
    from stagectl.config import load_machine
    from stagectl.fleet import Job
    from stagectl.run import software_version

    machine = None
    if how.machine is not None:
        named = load_machine(how.machine, fitted=True)
        machine = named.text, str(how.machine)
    version = software_version()
    return [Job(of.url, of.stamp, folder.address, machine, how.correct, version) for of in sources]


def _connect(where: _Where, jobs: int) -> Callable[[], AbstractContextManager[Any]]:
    from stagectl.fleet import cluster_at, local_cluster

    if where.scheduler is not None:
        return partial(cluster_at, where.scheduler)
    workers = where.workers or len(os.sched_getaffinity(0))
    return partial(local_cluster, min(workers, jobs))


class _Ran:
    """Has jobs done, keeps the ledger, and counts.

    Args:
        ledger: of the folder.
        folder: for results.
        total: number of jobs.

    Attributes:
        stopped: by the operator.
    """

    def __init__(self, ledger: Ledger, folder: Folder, total: int) -> None:
        self.stopped = False
        self._ended = 0
        self._ledger, self._folder, self._total = ledger, folder, total
        self._diagnosed = self._reused = 0
        self._failures: dict[str, str] = {}
        self._refused: dict[str, str] = {}

    def run(
        self,
        jobs: list[Job],
        connect: Callable[[], AbstractContextManager[Any]],
        json_out: Path | None,
    ) -> None:
        """Until all jobs have ended, or the operator stops it."""
        from stagectl.fleet import outcomes

        # Ctrl-C may come between a request of dask's and the loop that would send it.
        warnings.filterwarnings("ignore", "coroutine .* was never awaited", RuntimeWarning)
        begun = time.monotonic()
        try:
            with (
                interruptible(),
                progress_bar(console_for(json_out), "starting workers") as update,
            ):
                for outcome in outcomes(
                    jobs, connect, lambda what: update(what, self._ended, self._total)
                ):
                    self._take(outcome)
                    left = (time.monotonic() - begun) * (self._total / self._ended - 1.0)
                    what = f"{self._ended} of {self._total} recordings, {clock_time(left)} left"
                    update(what, self._ended, self._total)
        except click.exceptions.Abort:
            self.stopped = True

    def _take(self, outcome: Outcome) -> None:
        self._ended += 1
        if outcome.done is None:
            self._failures[outcome.job.url] = outcome.failure
            self._ledger.note_failure(outcome.job.url, outcome.failure)
            return
        name = outcome.done.result
        if self._ended == 1 and not self._folder.has(name):
            raise StagectlError(
                f"{self._folder.address}/{name}: a worker has written it where this computer does "
                "not see it; name a shared folder or a URL with --out"
            )
        self.note(outcome.done)

    def note(self, done: Done) -> None:
        """Count a recording that has a result."""
        if done.refusal is not None:
            self._refused[done.url] = done.refusal
        elif done.reused:
            self._reused += 1
        else:
            self._diagnosed += 1
        self._ledger.note(done)

    def report(self, recordings: int) -> dict[str, Any]:
        """For JSON; of so many recordings."""
        return {
            "format": FORMAT,
            "version": VERSION,
            "out": self._folder.address,
            "complete": not self.stopped,
            "recordings": recordings,
            "diagnosed": self._diagnosed,
            "reused": self._reused,
            "refused": self._refused,
            "failures": self._failures,
        }


def _lines(report: dict[str, Any]) -> list[str]:
    lines = [
        f"{report['recordings']} recordings: {report['diagnosed']} diagnosed, "
        f"{report['reused']} had been before, {len(report['refused'])} cannot be used, "
        f"{len(report['failures'])} failed"
    ]
    for what in ("refused", "failures"):
        lines += [f"  {recording}: {reason}" for recording, reason in report[what].items()]
    return [*lines, f"what they say: stagectl fleet summary {shlex.quote(report['out'])}"]


@click.command("summary")
@click.argument("folder", metavar="FOLDER|URL")
@JSON_OUT
def summary(folder: str, json_out: Path | None) -> None:
    """Say what the results in FOLDER, made by `fleet diagnose`, say together.

    Which stages are worst and by which effect, what stages with an effect have in common, what
    drifts, what is due. The last five recordings of a stage say what it is like now. Beside the
    results are written: summary.html, and diagnoses, causes and friction as .parquet tables.
    """
    fleet = _fleet()
    from stagectl.fleet.page import fleet_outline, write_summary
    from stagectl.report import print_outline

    where = fleet.Folder(folder)
    found, rows, friction = fleet.summarise(where)
    names = write_summary(where, found, rows, friction)
    written = f"written to {where.address}: {', '.join(names)}"
    show_result(found.to_json(), json_out, print_outline(fleet_outline(found)), written)
