"""What a stage server costs and how fast it stops, on virtual drives paced by the wall clock.

    python -m benchmarks.server.served_stage            # all of it, an hour
    python -m benchmarks.server.served_stage --kills    # or --watchers, --stops, --memory

Ratios and differences within one run of it; nothing else should run on the computer.
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import yaml

from stagectl.cli.options import DATA
from stagectl.client import Client, JobFailed
from stagectl.config import load_machine
from stagectl.protocol import requests as ask
from stagectl.store import read_recording

RECIPE = (DATA / "recipes" / "inspection-20.yaml").read_text(encoding="utf-8")
WATCH = (
    "import sys; from stagectl.client import Client\n"
    "for seen in Client(sys.argv[1], 'watcher').watch(samples=True): pass\n"
)


def in_real_time(folder: Path, priority: int) -> list[str]:
    """Options for a machine file with this priority of SCHED_FIFO; none for 0."""
    if not priority:
        return []
    machine = yaml.safe_load(load_machine().text)
    machine["bus"]["realtime"] = {"priority": priority}
    path = folder / "machine.yaml"
    path.write_text(yaml.safe_dump(machine, sort_keys=False), encoding="utf-8")
    return ["--machine", str(path)]


@contextmanager
def serving(folder: Path, *more: str) -> Iterator[subprocess.Popen[str]]:
    """A server on virtual drives, as a process."""
    command = [sys.executable, "-m", "stagectl", "serve", "--simulate", "--data", str(folder)]
    with subprocess.Popen([*command, "--name", "bench", *more], stdout=subprocess.PIPE,
                          text=True) as process:  # fmt: skip
        assert process.stdout is not None
        while "serving" not in (line := process.stdout.readline()):
            assert line, "the server has ended"
        try:
            yield process
        finally:
            if process.poll() is None:
                process.terminate()
                process.wait()


def watchers(folder: Path, pairs: int, seconds: float, count: int, priority: int) -> None:
    """Lateness of the stage's thread with and without watchers, in alternating pairs."""
    statistics = folder / "pace.npz"
    how = f"SCHED_FIFO, priority {priority}" if priority else "normal priority"
    print(f"{pairs} pairs of {seconds:g} s in motion, without and with {count} watchers; {how}")
    machine = in_real_time(folder, priority)
    rows: dict[bool, list[tuple[float, ...]]] = {False: [], True: []}
    for _ in range(pairs):
        for watched in (False, True):
            with serving(folder, "--pace-statistics", str(statistics), *machine) as process:
                with Client("bench") as client:
                    client.do(ask.Home())
                    others = [_watcher() for _ in range(count if watched else 0)]
                    time.sleep(2.0 + len(others))  # until they have started, on few cores
                    before = client.state().late
                    _keep_moving(client, seconds)
                    late = client.state().late - before
                    for other in others:
                        other.kill()
                        other.wait()
                process.terminate()
                process.wait()
            found = np.load(statistics)
            delay, turn = np.percentile(found["delays"], 99.9), found["turnarounds"]
            rows[watched].append((late, delay / 1e3, float(np.percentile(turn, 99.9)) / 1e3))
            print(f"  {count if watched else 0} watchers: {late} late, 99.9th percentile of "
                  f"lateness {delay / 1e3:.0f} us, of TPDO to next setpoint "
                  f"{rows[watched][-1][2]:.0f} us", flush=True)  # fmt: skip
    for number, what in enumerate(("late", "lateness [us]", "TPDO to setpoint [us]")):
        with_, without = (np.array([r[number] for r in rows[w]]) for w in (True, False))
        print(f"{what}: {without.mean():.1f} (spread {np.ptp(without):.1f}) without, "
              f"{with_.mean():.1f} (spread {np.ptp(with_):.1f}) with")  # fmt: skip


def _keep_moving(client: Client, seconds: float) -> None:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        for target in (0.02, -0.02):
            client.do(ask.Move(axis="x", position=target, velocity=0.05))


def stops(folder: Path, presses: int) -> None:
    """From pressing stop to the quick stop on the bus: when the axes leave OPERATION ENABLED."""
    taken = []
    with serving(folder), Client("bench") as client, Client("bench", "stop") as other:
        client.do(ask.Home())
        for number in range(presses):
            client.do(ask.Enable())
            target = 0.05 if number % 2 else -0.05
            job = client.begin(ask.Move(axis="x", position=target, velocity=0.1))
            time.sleep(0.05 + 0.001 * (number % 37))
            watching = other.watch(samples=True, timeout=2.0)
            pressed: list[float] = []

            def press(pressed: list[float] = pressed) -> None:
                time.sleep(0.05)
                pressed.append(time.time())
                client.stop()

            hand = threading.Thread(target=press)
            hand.start()
            for seen in watching:
                axes = getattr(seen, "axes", ())
                if pressed and axes and not seen.enabled:  # type: ignore[union-attr]
                    taken.append(seen.time - pressed[0])  # type: ignore[union-attr]
                    break
            hand.join()
            try:
                client.wait(job)
            except JobFailed:
                pass
    found = np.array(taken) * 1e3
    print(f"{len(found)} presses, until the axes are seen without power: median "
          f"{np.median(found):.0f} ms, 99th percentile {np.percentile(found, 99):.0f} ms "
          "(the published state comes every 100 ms at most)")  # fmt: skip


def kills(folder: Path, count: int) -> None:
    """A server killed in mid-queue: the queue and the recording are there, and nothing starts."""
    lost = 0
    for number in range(count):
        run = folder / f"run-{number}"
        with serving(folder) as process, Client("bench") as client:
            before = client.state()
            lost += before.run is not None or before.queue_runs or before.enabled
            asked = ask.QueueAdd(recipe=RECIPE, source="r.yaml", folder=str(run), start=True)
            entry = client.ask(asked)["id"]
            while not ((s := client.state()).run is not None and s.run.moves > number % 5):
                time.sleep(0.02)
            os.kill(process.pid, signal.SIGKILL)
            process.wait()
        with serving(folder), Client("bench") as client:
            deadline = time.monotonic() + 30
            while not (run / "summary.json").exists() and time.monotonic() < deadline:
                time.sleep(0.05)
            state = client.state()
            status = next(e.status for e in state.queue if e.id == entry)
            kept = (run / "recording.h5").exists() and len(read_recording(run / "recording.h5"))
            lost += status != "interrupted" or not kept or state.run is not None
    print(f"{count} kills in mid-run: {lost} with something lost or started by itself")


def memory(folder: Path, minutes: int, count: int = 8) -> None:
    """Memory of a server that moves its stage while watchers come and go."""
    found, draw = [], np.random.default_rng(1)
    with serving(folder) as process, Client("bench") as client:
        client.do(ask.Home())
        others = [_watcher() for _ in range(count)]
        end = time.monotonic() + 60 * minutes
        while time.monotonic() < end:
            _keep_moving(client, 10.0)
            gone = int(draw.integers(count))
            others[gone].kill()
            others[gone].wait()
            others[gone] = _watcher()
            text = Path(f"/proc/{process.pid}/status").read_text()
            found.append(int(text.partition("VmRSS:")[2].split()[0]) / 1024)
        for other in others:
            other.kill()
            other.wait()
    settled = np.array(found[len(found) // 10 :])
    least, most = settled.min(), settled.max()
    print(f"{minutes} min, {count} watchers, one of them new every 10 s: {least:.1f} to "
          f"{most:.1f} MB after the first tenth, {100 * (settled[-1] / settled[0] - 1):+.1f} % "
          "from its begin to its end")  # fmt: skip


def _watcher() -> subprocess.Popen[bytes]:
    return subprocess.Popen([sys.executable, "-c", WATCH, "bench"])


def main() -> None:
    """Run what is asked for."""
    options = argparse.ArgumentParser(description=__doc__)
    for name, text in (("watchers", "8"), ("stops", "200"), ("kills", "20"), ("memory", "30")):
        options.add_argument(f"--{name}", nargs="?", type=int, const=int(text))
    options.add_argument("--pairs", type=int, default=5)
    options.add_argument("--seconds", type=float, default=60.0)
    options.add_argument("--priority", type=int, default=0, help="of SCHED_FIFO, where permitted")
    given = options.parse_args()
    asked = (given.watchers, given.stops, given.kills, given.memory)
    all_of_it = asked == (None,) * 4
    with tempfile.TemporaryDirectory() as name:
        if all_of_it or given.watchers:
            watchers(Path(name), given.pairs, given.seconds, given.watchers or 8, given.priority)
        if all_of_it or given.stops:
            stops(Path(name), given.stops or 200)
        if all_of_it or given.kills:
            kills(Path(name), given.kills or 20)
        if all_of_it or given.memory:
            memory(Path(name), given.memory or 30)


if __name__ == "__main__":
    main()
