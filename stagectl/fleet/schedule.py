"""Hands recordings to workers: processes of this machine, or of a dask.distributed cluster.

A worker that dies, killed or out of memory, costs a recording nothing but another try, up to a
number of tries, the last ones alone, that only a recording reaches that kills workers itself. A
diagnosis that fails is tried three times. When a cluster's scheduler is lost, the next one gets
what is not finished.
"""

from __future__ import annotations

import logging
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from importlib.util import find_spec
from queue import Empty, Queue
from typing import Any
from uuid import uuid4

import dask
from distributed import Client, Future, KilledWorker, LocalCluster, WorkerPlugin
from distributed.system import MEMORY_LIMIT
from distributed.utils import silence_logging_cmgr

from stagectl.errors import StagectlError, UnusableInput
from stagectl.fleet.task import Done, Job, diagnose_one
from stagectl.plain_text import one_line

RETRIES = 2
"""How often a diagnosis that failed is tried again."""
MEMORY = 0.9
"""Share of the machine's memory that all workers together may take."""
LOST = 600.0
"""How long a lost scheduler is waited for [s]."""
_POLL = 0.5
_GATHER = 10.0
"""How long an answer may take from its worker [s]."""
_CONNECT = 10.0
"""Timeout for a connection [s]."""

Connect = Callable[[], AbstractContextManager[Client]]


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a job ended.

    Attributes:
        job: it.
        done: its result; None where there is none.
        failure: why not.
    """

    job: Job
    done: Done | None
    failure: str = ""


class _SchedulerLost(Exception):  # noqa: N818
    """Nothing that was given out comes back."""


class _IgnoreInterrupts(WorkerPlugin):
    """Ctrl-C in a terminal reaches workers, too; their client ends them."""

    def setup(self, worker: Any) -> None:
        signal.signal(signal.SIGINT, signal.SIG_IGN)


class NoProfile(WorkerPlugin):
    """Workers keep no profile of what they run, as long as this plugin is there.

    Of the deep stacks of diagnoses, the call trees of the last thousand seconds are 200 MB.
    """

    name = "stagectl-no-profile"

    def __init__(self) -> None:
        self._stopped: dict[str, Any] = {}

    def setup(self, worker: Any) -> None:
        """Take the worker's callbacks: those still there are started when it has registered."""
        for name in ("profile", "profile-cycle"):
            callback = worker.periodic_callbacks.pop(name, None)
            if callback is not None:
                callback.stop()
                self._stopped[name] = callback

    def teardown(self, worker: Any) -> None:
        """Give them back."""
        for name, callback in self._stopped.items():
            worker.periodic_callbacks[name] = callback
            callback.start()


@contextmanager
def local_cluster(workers: int) -> Iterator[Client]:
    """Worker processes of one thread on this machine, ended at the end.

    Their memory together is limited to a share of the machine's. They are reached through this
    machine's loopback interface, encrypted where the package cryptography is installed.
    """
    settings = {"distributed.worker.memory.target": False, "distributed.worker.memory.spill": False}
    with (
        dask.config.set(settings),
        LocalCluster(  # type: ignore[no-untyped-call]
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            memory_limit=int(MEMORY * MEMORY_LIMIT / workers),
            dashboard_address="127.0.0.1:0",
            silence_logs=logging.CRITICAL,
            security=find_spec("cryptography") is not None,
        ) as cluster,
        Client(cluster) as client,  # type: ignore[no-untyped-call]
    ):
        client.register_plugin(_IgnoreInterrupts())
        client.register_plugin(NoProfile())
        yield client


@contextmanager
def cluster_at(address: str) -> Iterator[Client]:
    """A cluster by its scheduler's address; for `tls://` as dask's configuration has it.

    Raises:
        UnusableInput: no scheduler answers.
    """
    with silence_logging_cmgr(logging.CRITICAL):  # what a user has to know is raised
        try:
            client = Client(address, timeout=_CONNECT)  # type: ignore[no-untyped-call]
        except (OSError, ValueError, TimeoutError) as error:
            reason = one_line(error, 200)
            raise UnusableInput(f"--scheduler {address}: no scheduler answers: {reason}") from error
        with client:
            client.register_plugin(NoProfile())
            try:
                yield client
            finally:
                with suppress(OSError, ValueError, TimeoutError):  # it is gone
                    client.unregister_worker_plugin(NoProfile.name)  # type: ignore[no-untyped-call]


def outcomes(
    jobs: Sequence[Job],
    connect: Connect,
    waiting: Callable[[str], object] = lambda _: None,
    work: Callable[[Job], Done] = diagnose_one,
) -> Iterator[Outcome]:
    """Have jobs done; yields how each ended, as they end.

    Args:
        jobs: each of a recording of its own.
        connect: to the workers.
        waiting: called with what is being waited for where nothing goes on.
        work: does a job, in a worker.

    Raises:
        UnusableInput: there is no scheduler.
        StagectlError: it was lost, and none came back.
    """
    left = _Left(jobs, waiting, work)
    lost = None
    while left:
        try:
            with connect() as client:
                for outcome in left.give_out(client):
                    lost = None
                    yield outcome
        except _SchedulerLost:
            lost = time.monotonic() if lost is None else lost
        except UnusableInput as error:
            if lost is None:
                raise
            if time.monotonic() > lost + LOST:
                raise StagectlError(f"the scheduler was lost; {error}") from error
        if left:
            waiting("the scheduler was lost: waiting for one")
            time.sleep(_POLL)


class _Left:
    """Jobs that have not ended.

    Args:
        jobs: all of them.
        waiting, work: as of `outcomes`.
    """

    def __init__(
        self,
        jobs: Sequence[Job],
        waiting: Callable[[str], object],
        work: Callable[[Job], Done],
    ) -> None:
        self._jobs = {job.url: job for job in jobs}
        self._suspects: set[str] = set()
        self._waiting, self._work = waiting, work
        self._run = uuid4().hex  # the scheduler may still have tasks of another client

    def __bool__(self) -> bool:
        return bool(self._jobs)

    def give_out(self, client: Client) -> Iterator[Outcome]:
        """Keep all threads busy until there is nothing left.

        Suspects come last, one by one: a worker that dies takes down all that it was given, and
        alone it is clear which recording kills it.

        Raises:
            _SchedulerLost: the connection broke.
        """
        ended: Queue[Future[Done]] = Queue()
        # Held until the outcome is known: a future that nobody holds is cancelled.
        out: dict[Any, tuple[Job, Future[Done]]] = {}
        queue = [job for job in self._jobs.values() if job.url not in self._suspects]
        room, number = 0, 0
        while self._jobs:
            if not queue and not out:
                queue, room = [next(iter(self._jobs.values()))], 1
            elif not self._is_alone(out):
                room = _threads(client) + 1 - len(out)
            for job in queue[: max(room, 0)]:
                number += 1
                key = f"stagectl-fleet-{self._run}-{number}"
                future = client.submit(self._work, job, key=key, retries=RETRIES, pure=False)
                future.add_done_callback(ended.put)  # type: ignore[no-untyped-call]
                out[key] = job, future
            del queue[: max(room, 0)]
            try:
                first = ended.get(timeout=_POLL)
            except Empty:
                if client.status != "running":
                    raise _SchedulerLost from None
                if not _threads(client):
                    self._waiting("waiting for workers")
                continue
            job, future = out.pop(first.key)
            outcome = self._ended(job, future)
            if outcome is not None:
                del self._jobs[job.url]
                yield outcome
            elif job.url not in self._suspects:
                queue.append(job)

    def _is_alone(self, out: dict[Any, tuple[Job, Future[Done]]]) -> bool:
        return any(job.url in self._suspects for job, _ in out.values())

    def _ended(self, job: Job, future: Future[Done]) -> Outcome | None:
        """How a job ended; None where it is to be given out again.

        Raises:
            _SchedulerLost: it was cancelled, which nobody but a lost connection does, or the
                connection broke while the answer was on its way.
        """
        if future.status == "cancelled":
            raise _SchedulerLost
        try:
            if future.status == "finished":
                return Outcome(job, future.result(_GATHER))
            error = future.exception()  # type: ignore[no-untyped-call]
        except (KilledWorker, TimeoutError):
            return None  # its worker died before it could pass the answer on
        except (CancelledError, OSError) as lost:  # of the connection: the work has not failed
            raise _SchedulerLost from lost
        if isinstance(error, CancelledError):
            raise _SchedulerLost from error
        if isinstance(error, KilledWorker):
            if job.url not in self._suspects:
                self._suspects.add(job.url)
                return None
            return Outcome(job, None, "its worker dies each time: it lacks memory, or crashes")
        kind = "" if isinstance(error, StagectlError) else f"{type(error).__name__}: "
        reason = one_line(" ".join(f"{kind}{error}".split()), 400)
        return Outcome(job, None, f"failed {RETRIES + 1} times: {reason}")


def _threads(client: Client) -> int:
    """Of all workers.

    Raises:
        _SchedulerLost: the scheduler does not answer.
    """
    try:
        return sum(client.nthreads().values())  # type: ignore[no-untyped-call]
    except (OSError, TimeoutError) as error:
        raise _SchedulerLost from error
