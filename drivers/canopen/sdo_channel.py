"""SDO access to one node: one transfer at a time, requested from any thread.

The thread that has the bus runs the transfers: the caller itself, or the thread that is receiving,
which takes them up with the network's regular services, also between the SYNCs of a stream and
without waiting there. After a timeout an answer may still come late. So before the next transfer a
mandatory object other than those just requested is read (a fence): the server answers in order, and
after this answer no late one can follow.
"""

from __future__ import annotations

import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass

from canopen import SdoAbortedError, SdoCommunicationError

from drivers.canopen import sdo
from drivers.canopen.bus import Network
from drivers.canopen.sdo import Transfer
from drivers.errors import BusError, DriverError

TIMEOUT = 0.4
"""For each answer [s]."""
_FENCES = ((0x1000, 0), (0x1001, 0), (0x1018, 0), (0x1018, 1))
_RELEASED = "the node was released"
_POLL, _POLLS = 0.005, 1000
"""Interval at which a thread checks whether the bus has become free [s], and how often it does
before it gives up on a thread that has the bus for itself."""


@dataclass(slots=True, eq=False)
class _Job:
    """A transfer and its result; `closing`: a frame sent at its end, which is not answered."""

    object: tuple[int, int]
    begin: Callable[[], Transfer]
    closing: bytes | None = None
    done: bool = False
    result: bytes = b""
    error: Exception | None = None

    def end(self, result: bytes = b"", error: Exception | None = None) -> None:
        self.result, self.error = result, error
        self.done = True  # last: another thread polls it


class SdoChannel:
    """Reads and writes the objects of one node.

    Args:
        network: to send on; its `watchers` and subscription of 0x580 + node are used.
        node_id: 1..127.
        timeout: for each answer [s of the network's clock].

    Attributes:
        asked: how often each object was asked for.
    """

    def __init__(self, network: Network, node_id: int, timeout: float = TIMEOUT) -> None:
        self.node_id = node_id
        self.timeout = timeout
        self._network = network
        self._lock = threading.Lock()
        self._waiting: deque[_Job] = deque()
        self._job: _Job | None = None
        self._transfer: Transfer | None = None
        self._fence: tuple[int, int] | None = None
        self._unanswered: list[tuple[int, int]] = []  # objects, since the last fence
        self._deadline = 0
        self._detached = False
        self.asked: Counter[tuple[int, int]] = Counter()
        network.subscribe(0x580 + node_id, self._on_answer)
        network.watchers.append(self._service)

    def detach(self) -> None:
        """Stops listening; waiting transfers fail, and so does what is asked for later."""
        self._detached = True
        self._network.unsubscribe(0x580 + self.node_id, self._on_answer)
        if self._service in self._network.watchers:
            self._network.watchers.remove(self._service)
        for job in (self._job, *self._waiting):
            if job is not None and not job.done:
                job.end(error=SdoCommunicationError(_RELEASED))
        self._job = self._transfer = None
        self._waiting.clear()

    def upload(self, index: int, sub: int) -> bytes:
        """The bytes of an object.

        Raises:
            SdoAbortedError: the node refuses.
            SdoCommunicationError: it does not answer.
            BusError: the bus fails.
        """
        return self._run(_Job((index, sub), lambda: sdo.upload(index, sub)))

    def download(self, index: int, sub: int, data: bytes) -> None:
        """Writes an object; raises as `upload`."""
        self._run(_Job((index, sub), lambda: sdo.download(index, sub, data)))

    def write_unanswered(self, index: int, sub: int, data: bytes) -> None:
        """Writes up to four bytes without waiting for the answer; the transfer under way fails.

        Raises:
            BusError: the bus fails.
        """
        with self._network.lock:
            if self._job is not None:
                self._drop(self._job, SdoCommunicationError("abandoned for an urgent write"))
            self._unanswered.append((index, sub))
            self._send(next(sdo.download(index, sub, data)))

    def block_upload(self, index: int, sub: int) -> bytes:
        """As `upload`, in blocks where the node supports them."""
        try:
            return self._run(
                _Job((index, sub), lambda: sdo.block_upload(index, sub), sdo.BLOCK_UPLOAD_END)
            )
        except SdoAbortedError as refused:
            if refused.code != sdo.UNKNOWN_COMMAND:
                raise
            return self.upload(index, sub)

    # -- in the thread that requests --------------------------------------------------------

    def _run(self, job: _Job) -> bytes:
        network = self._network
        if network.dispatching == threading.get_ident():
            raise DriverError(
                f"node {self.node_id}: SDO access inside a callback of the receive path"
            )
        if self._detached:
            raise SdoCommunicationError(_RELEASED)
        with self._lock:
            self._waiting.append(job)
        if network.owner not in (None, threading.get_ident()):
            self._wait_for_owner(job)
        while not job.done:
            # another thread that has the bus takes the job up, or releases the bus
            if not network.lock.acquire(timeout=_POLL):
                continue
            try:
                self._drive(job)
            except BusError as failed:
                self._drop(job, failed)
            finally:
                network.lock.release()
        if job.error is not None:
            raise job.error
        return job.result

    def _wait_for_owner(self, job: _Job) -> None:
        for _ in range(_POLLS):
            if job.done:
                return
            time.sleep(_POLL)
        with self._lock:
            if job in self._waiting:
                self._waiting.remove(job)
        if not job.done:
            raise SdoCommunicationError("the thread that has the bus does not use it")

    def _drive(self, job: _Job) -> None:
        network = self._network
        while not job.done:
            self._next()
            left = max(0, self._deadline - network.clock.now_ns()) * 1e-9
            if not network.pump_until(lambda: job.done, left):
                self._service(network.clock.now_ns())

    def _drop(self, job: _Job, failed: Exception) -> None:
        if job is self._job:
            self._unanswered.append(self._fence or job.object)
            self._job = self._transfer = self._fence = None
        with self._lock:
            if job in self._waiting:
                self._waiting.remove(job)
        job.end(error=failed)

    # -- in the thread that has the bus -------------------------------------------------------

    def _service(self, now: int) -> None:
        """Ends a transfer that has timed out, begins the next."""
        job = self._job
        if job is not None and now >= self._deadline:
            if self._transfer is not None:
                self._transfer.close()
            self._job = self._transfer = None
            at, self._fence = self._fence or job.object, None
            self._unanswered.append(at)
            try:
                self._send(sdo.abort_frame(*at, sdo.TIMED_OUT))
            finally:
                job.end(error=SdoCommunicationError("no SDO answer"))
        self._next()

    def _next(self) -> None:
        if self._job is not None or not self._waiting:
            return
        with self._lock:
            if not self._waiting:
                return
            job = self._job = self._waiting.popleft()
        if not self._unanswered:
            self._begin(job.begin(), job.object)
            return
        del self._unanswered[: -len(_FENCES) + 1]  # older answers are several timeouts late
        self._fence = next(f for f in _FENCES if f not in self._unanswered)
        self._begin(sdo.upload(*self._fence), self._fence)

    def _begin(self, transfer: Transfer, obj: tuple[int, int]) -> None:
        self._transfer = transfer
        self.asked[obj] += 1
        self._submit(next(transfer))

    def _submit(self, frame: bytes | None) -> None:
        self._send(frame)
        # set after sending: in virtual time the answer may be in the queue already
        self._deadline = self._network.clock.now_ns() + round(self.timeout * 1e9)

    def _send(self, frame: bytes | None) -> None:
        if frame is not None:
            self._network.send_message(0x600 + self.node_id, frame)

    def _on_answer(self, can_id: int, data: bytearray, timestamp: float) -> None:
        transfer, job = self._transfer, self._job
        if transfer is None or job is None or len(data) != 8:
            return
        result, error = b"", None
        try:
            frame = transfer.send(bytes(data))
        except StopIteration as end:
            result = end.value
        except SdoAbortedError as refused:
            error = refused
        else:
            if frame is not None:
                self._submit(frame)
            return
        if self._fence is not None:  # a refusal is an answer, too
            self._fence = None
            self._unanswered.clear()
            self._begin(job.begin(), job.object)
            return
        if error is None:
            self._send(job.closing)
        elif data[0] != 0x80:  # our own decision: the server has to learn of it
            self._send(sdo.abort_frame(*job.object, error.code))
        self._job = self._transfer = None
        job.end(result, error)
        self._next()
