"""How soon the console's page is usable, and whether a run notices consoles and pages that vanish.

    python -m benchmarks.console.disturbed [--times 50] [--seed 1] [--starts 3]

Starts: `stagectl console --simulate` until a page has the state of the stage, kernels warm; the
address, and a page that says what is going on, come earlier. Vanishing: while a run is under way, a
page's socket is cut without a word, a page is opened anew, or the console is killed and started
again, by a draw. Shown is how many SYNCs were late and samples missed before and meanwhile, and how
the run ended. Exit code 1 where a sample was missed, or the run ended otherwise than completed.
"""

from __future__ import annotations

import argparse
import http.client
import json
import os
import random
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from urllib.parse import urlsplit

from websockets.sync.client import ClientConnection, connect

from benchmarks.shared.machine_facts import machine_facts
from stagectl.client import Client
from stagectl.protocol.requests import QueueAdd

RECIPE = """\
recipe: long
macro: {velocity: 0.05, acceleration: 1.0, jerk: 50.0}
micro: {velocity: 0.01, acceleration: 0.2, jerk: 20.0}
settle: {window: 1.0e-6, hold: 0.01, timeout: 0.5}
expose: 0.5
sites: {grid: {origin: [-0.05, -0.05], pitch: [0.02, 0.02], count: [6, %d]}}
fiducial: {source: none}
"""


class Console:
    """A console's process, and pages of it."""

    def __init__(self, data: Path) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "stagectl", "console", "--simulate", "--no-browser",
             "--port", "0", "--data", str(data)], stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        assert self._process.stdout is not None
        self._address = urlsplit(self._process.stdout.readline().strip())
        self._cookie = ""
        token = self._address.fragment.removeprefix("token=")
        self._cookie = self._post("/api/login", {"token": token})[1].split(";")[0]

    def _post(self, path: str, values: dict[str, str]) -> tuple[dict[str, str], str]:
        host = self._address.netloc
        connection = http.client.HTTPConnection(host, timeout=60)
        headers = {"Origin": f"http://{host}", "Content-Type": "application/json"}
        connection.request("POST", path, json.dumps(values), headers | {"Cookie": self._cookie})
        answer = connection.getresponse()
        found = json.loads(answer.read()), answer.getheader("set-cookie") or ""
        connection.close()
        assert answer.status == 200, found
        return found

    def page(self) -> ClientConnection:
        """A page's websocket, which samples come over."""
        host = self._address.netloc
        ticket = self._post("/api/ticket", {"name": "benchmark"})[0]["ticket"]
        opened = connect(
            f"ws://{host}/ws?ticket={ticket}", origin=f"http://{host}", proxy=None,
            additional_headers={"Cookie": self._cookie}, max_size=None,
        ).__enter__()  # fmt: skip
        opened.send('{"samples": true}')
        return opened

    def wait_for_state(self) -> None:
        """Until a page has the state of the stage."""
        with self.page() as opened:
            while True:
                message = opened.recv(300)
                if isinstance(message, str) and "doing" in json.loads(message)["changed"]:
                    return

    def end(self, how: signal.Signals) -> None:
        """End it."""
        self._process.send_signal(how)
        self._process.wait()
        assert self._process.stdout is not None
        self._process.stdout.close()


def starts(times: int, folder: Path) -> None:
    """How long it takes until the address is there, and until the page is usable."""
    address, usable = [], []
    for _ in range(times):
        begin = time.perf_counter()
        console = Console(folder)
        address.append(time.perf_counter() - begin)
        console.wait_for_state()
        usable.append(time.perf_counter() - begin)
        console.end(signal.SIGINT)
    print(
        f"start: page answers after {statistics.median(address):.1f} s, has the state of the stage "
        f"after {statistics.median(usable):.1f} s (medians of {times})"
    )


def begin_run(client: Client, recipe: str) -> None:
    """Have a run begin, and wait until it moves."""
    client.ask(QueueAdd(recipe=recipe, source="long.yaml", start=True))
    while client.state().doing != "running":
        time.sleep(0.05)


def vanish(times: int, seed: int, folder: Path) -> bool:
    """Let pages and consoles vanish while runs are under way; whether no run noticed it."""
    draw = random.Random(seed)  # noqa: S311
    console = Console(folder)
    console.wait_for_state()
    counts = {"cut": 0, "reloaded": 0, "killed": 0}
    with Client("simulated") as client:
        recipe = RECIPE % min(max(1, times // 4), 6)
        begin_run(client, recipe)
        state = client.state()
        before = state.late, state.missed
        page = console.page()
        for _ in range(times):
            what = draw.choices(list(counts), (4, 4, 1))[0]
            if what == "killed":
                console.end(signal.SIGKILL)
                console = Console(folder)
            elif what == "cut":
                page.socket.close()
            else:
                page.close()
            counts[what] += 1
            page = console.page()
            time.sleep(draw.uniform(0.0, 0.3))
            if client.state().run is None:
                begin_run(client, recipe)
        now = client.state()
        while (ended := client.state()).run is not None:
            time.sleep(0.2)
        outcomes = [entry.outcome for entry in ended.queue]
        os.kill(client.info.pid, signal.SIGTERM)
    console.end(signal.SIGINT)
    missed = now.missed - before[1]
    words = ", ".join(f"{count} {what}" for what, count in counts.items())
    print(
        f"vanished {sum(counts.values())} times ({words}): "
        f"{now.late - before[0]} SYNCs late, {missed} samples missed meanwhile; "
        f"{outcomes.count('completed')} of {len(outcomes)} runs completed"
    )
    return missed == 0 and set(outcomes) == {"completed"}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--times", type=int, default=50, help="how often something vanishes")
    parser.add_argument("--starts", type=int, default=3, help="starts of the console")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    print(machine_facts())
    with tempfile.TemporaryDirectory() as name:
        os.environ["STAGECTL_RUNTIME"] = f"{name}/run"
        starts(given.starts, Path(name))
        sys.exit(0 if vanish(given.times, given.seed, Path(name)) else 1)


if __name__ == "__main__":
    main()
