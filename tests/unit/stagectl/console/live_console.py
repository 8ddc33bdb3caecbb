"""The console on a free port, in a thread of the test, before a fake stage server."""

import http.client
import json
import socket
import threading
from contextlib import contextmanager

import uvicorn
from websockets.sync.client import connect

from stagectl.console.access import Access
from stagectl.console.app import make_app
from stagectl.console.context import Context
from stagectl.console.gate import Addresses
from stagectl.console.jobs import Jobs
from stagectl.console.link import StageLink
from stagectl.console.process import settings
from stagectl.console.recipes import Recipes

TOKEN = "a-token-of-some-length"  # noqa: S105


class LiveConsole:
    """A console that listens.

    Attributes:
        port: of the page.
        console: its parts.
    """

    def __init__(self, port, console):
        self.port, self.console = port, console
        self.origin = f"http://127.0.0.1:{port}"
        self.cookie = ""

    def log_in(self):
        status, headers, _ = self.post("/api/login", {"token": TOKEN})
        assert status == 200
        self.cookie = headers["set-cookie"].split(";")[0]
        return self

    def ticket(self, name="Anna"):
        status, _, body = self.post("/api/ticket", {"name": name})
        assert status == 200, body
        return json.loads(body)["ticket"]

    def get(self, path, **headers):
        return self.request("GET", path, None, headers)

    def post(self, path, values, **headers):
        body = json.dumps(values).encode()
        own = {"Content-Type": "application/json", "Origin": self.origin}
        return self.request("POST", path, body, own | headers)

    def request(self, method, path, body=None, headers=None):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=60)
        try:
            cookie = {"Cookie": self.cookie} if self.cookie else {}
            connection.request(method, path, body, cookie | (headers or {}))
            answer = connection.getresponse()
            found = {name.lower(): value for name, value in answer.getheaders()}
            return answer.status, found, answer.read()
        finally:
            connection.close()

    def raw(self, data):
        """Status that bytes are answered with; 0 where the connection is closed without any."""
        with socket.create_connection(("127.0.0.1", self.port), timeout=60) as connection:
            connection.sendall(data)
            line = connection.makefile("rb").readline()
        return int(line.split()[1]) if line else 0


@contextmanager
def live_console(where, data, recipes=None):
    """Serves until the block ends.

    Args:
        where: sockets of the stage server.
        data: folder of runs.
        recipes: folder, or None.
    """
    listening = socket.create_server(("127.0.0.1", 0))
    port = listening.getsockname()[1]
    console = Context(
        Access(TOKEN), Addresses.of("127.0.0.1", port, ()), "stagectl-test", StageLink(where), None,
        Recipes(recipes), Jobs(), data,
    )  # fmt: skip
    server = uvicorn.Server(uvicorn.Config(make_app(console), **settings()))
    thread = threading.Thread(target=server.run, args=([listening],))
    thread.start()
    try:
        yield LiveConsole(port, console)
    finally:
        server.should_exit = True
        thread.join()
        listening.close()


def page(live, name="Anna"):
    """A websocket as a page opens it."""
    return connect(
        f"ws://127.0.0.1:{live.port}/ws?ticket={live.ticket(name)}", origin=live.origin,
        additional_headers={"Cookie": live.cookie}, open_timeout=60, proxy=None,
    )  # fmt: skip


def answer(opened, number):
    """The answer to a request."""
    while True:
        message = json.loads(opened.recv(60))
        if message.get("id") == number:
            return message


class Page:
    """A page that asks.

    Attributes:
        state: its parts as last sent.
    """

    def __init__(self, opened):
        self.opened, self.state, self._number = opened, {}, 0

    def ask(self, begin=False, **command):
        """Its answer."""
        self._number += 1
        self.opened.send(json.dumps({"id": self._number, "ask": command, "begin": begin}))
        while True:
            message = self.receive()
            if message.get("id") == self._number:
                return message

    def receive(self):
        message = json.loads(self.opened.recv(60))
        self.state |= message.get("changed", {})
        return message

    def until(self, wanted):
        """Receive until the state is as wanted."""
        while not wanted(self.state):
            self.receive()
