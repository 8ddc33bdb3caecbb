"""A stage server of a few lines: answers by the protocol, publishes what a test says.

What the console is tested against where the stage does not matter; tests/system has the real one.
"""

import fcntl
import itertools
import threading
import time

import msgpack
import numpy as np
import zmq

from stagectl.errors import UnusableInput
from stagectl.protocol import requests, state
from stagectl.protocol.endpoint import Endpoint
from stagectl.protocol.wire import NOTICE, SAMPLES, STATE, SampleBlock, decode_request, encode


def axis(name):
    return state.AxisState(
        name=name, position=0.001, demand=0.001, error=3e-9, force=1.5, offset=1.4,
        status="operation enabled", statusword=0x1637, homed=True,
    )  # fmt: skip


def a_state(**changes):
    plain = {
        "version": 1, "time": time.time(), "doing": "held", "what": "held",
        "axes": (axis("x"), axis("y")),
        "enabled": True, "homed": True, "hold_left": 600.0, "run": None, "job": None, "queue": (),
        "queue_runs": False, "lease": None, "alarms": (), "late": 0, "missed": 0, "event": 0,
    }  # fmt: skip
    return state.State(**(plain | changes))


def block(first, count=20, axes=2):
    t = first + np.arange(count)
    ones = np.ones((count, axes))
    return SampleBlock(
        first=first, time=t * 1e-3, late=np.zeros(count, np.uint8), demand=1e-3 * ones,
        position=1e-3 * ones, force=ones, offset=ones,
        statusword=np.full((count, axes), 0x1637, np.uint16),
        valid=np.ones((count, axes), np.uint8),
    )  # fmt: skip


class FakeServer:
    """Serves in a thread.

    Attributes:
        heard: (client, command) of every request that was not refused and does more than look.
        changes: of the state, published at 20 Hz.
    """

    def __init__(self, folder, data, name="fake"):
        self.where = Endpoint(folder, name)
        self.changes, self.heard, self.refusal = {}, [], None
        self._data, self._tokens = data, itertools.count()
        self._lease = None
        self._notices = []
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._serve)

    def __enter__(self):
        self._lock = self.where.lock.open("w")  # as a server does that runs
        fcntl.flock(self._lock, fcntl.LOCK_EX)
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._end.set()
        self._thread.join()
        self._lock.close()

    def notice(self, kind, text, **data):
        number = len(self._notices) + 1
        self._notices.append(
            state.Notice(number=number, time=time.time(), kind=kind, text=text, data=data)
        )

    def asked(self, op):
        return [command for _, command in self.heard if command.op == op]

    def _info(self):
        axes = tuple(
            state.AxisInfo(name=n, node=k, travel=(-0.15, 0.15), velocity=0.3, acceleration=5.0)
            for k, n in enumerate("xy", 1)
        )
        return state.ServerInfo(
            version=1, program="0", machine="wafer-xy", machine_file="wafer-xy", machine_digest="0",
            bus="lockstep", simulated=True, pid=1, started="", period=1e-3, control_period=1e-4,
            hold_limit=600.0,
            pause_limit=600.0, data=str(self._data), axes=axes,
        )  # fmt: skip

    def _serve(self):
        context = zmq.Context()
        router, pub = context.socket(zmq.ROUTER), context.socket(zmq.PUB)
        router.bind(Endpoint.url(self.where.commands))
        pub.bind(Endpoint.url(self.where.events))
        sent, first, due = 0, 0, 0.0
        while not self._end.is_set():
            if router.poll(10):
                peer, data = router.recv_multipart()
                router.send_multipart([peer, self._answer(data)])
            for notice in self._notices[sent:]:
                pub.send_multipart([NOTICE, encode(notice)])
                sent += 1
            if time.monotonic() >= due:
                due = time.monotonic() + 0.05
                pub.send_multipart([STATE, encode(self._state())])
                pub.send_multipart([SAMPLES, block(first).encode()])
                first += 20
        context.destroy(linger=0)

    def _state(self):
        lease = self._lease and state.Lease(holder=self._lease[1], since=0.0)
        return a_state(**{"lease": lease, **self.changes})

    def _answer(self, data):
        try:
            request = decode_request(data)
        except UnusableInput as why:
            refusal = state.Refusal(kind="invalid", text=str(why))
            number = msgpack.unpackb(data).get("id", 0)
            return encode(state.Answer(version=1, id=number, refusal=refusal))
        command = request.command
        result = refusal = None
        free = isinstance(command, requests.FREE)
        if self.refusal and not free:
            refusal = self.refusal
        elif not free and self._lease and request.lease != self._lease[0]:
            refusal = state.Refusal(kind="not_in_command", text=f"{self._lease[1]} commands")
        else:
            result, refusal = self._do(request)
            looking = requests.Info, requests.GetState, requests.GetEvents
            if not isinstance(command, looking):
                self.heard.append((request.client, command))
        if hasattr(result, "model_dump"):
            result = result.model_dump(mode="python")
        return encode(state.Answer(version=1, id=request.id, result=result, refusal=refusal))

    def _do(self, request):
        command = request.command
        match command:
            case requests.Info():
                return self._info(), None
            case requests.GetState():
                return self._state(), None
            case requests.GetEvents():
                return [n.model_dump() for n in self._notices[command.since :]], None
            case requests.Take():
                if self._lease and not command.force and request.lease != self._lease[0]:
                    busy = state.Refusal(kind="not_in_command", text=f"{self._lease[1]} commands")
                    return None, busy
                self._lease = (f"token{next(self._tokens)}", request.client)
                return {"lease": self._lease[0]}, None
            case requests.Release():
                if self._lease and request.lease == self._lease[0]:
                    self._lease = None
                return None, None
            case requests.QueueAdd():
                return {"id": 1}, None
            case requests.CheckRecipe():
                return {"positions": []}, None
        return state.Job(id=1, what=command.op, ended=False), None
