"""What a fleet of workers reaches, costs and survives, on one machine.

Recordings are pieces of a second of the tests' recordings, each with a time of its own, so that no
two are alike. Measured, on a scheduler and workers of their own processes:

- throughput of two workers over that of one;
- processor time of a fleet over that of `gap diagnose`'s functions called in a loop;
- bytes of a result, and memory of one worker after some and after all recordings;
- with `--chaos`: a worker killed at the first result and every five durations of a diagnosis, the
  scheduler killed once and started again, the client killed once and started again, five files
  damaged: whether the results are those of an undisturbed fleet, and none was written twice.

    python -m benchmarks.fleet.campaign [--recordings 60] [--memory 300] [--chaos]
"""

from __future__ import annotations

import argparse
import os
import random
import resource
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import NamedTuple

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import h5py
from distributed import Client

from stagectl.diagnosis import diagnose_recordings, machine_of
from stagectl.fleet import Folder, Job, Ledger, cluster_at, find_recordings, outcomes
from stagectl.fleet.rows import REFUSED, RESULT, from_parquet
from stagectl.run import software_version
from stagectl.store import RecordingBlocks, read_recording, write_recording

DATA = Path(__file__).parents[2] / "tests" / "data"
PIECE = 1250
DAMAGED = 5
EVERY = 5
"""Durations of a diagnosis between two killed workers."""
FIRST = 20
"""Recordings after which memory is compared."""


def make_recordings(folder: Path, count: int, damaged: int = 0, samples: int = PIECE) -> None:
    """Recordings of no two alike contents, some of them cut; of some `samples` each."""
    folder.mkdir(parents=True, exist_ok=True)
    pieces = [b for path in sorted(DATA.glob("*.h5")) for b in RecordingBlocks(path, samples)]
    begin = datetime(2026, 1, 1, tzinfo=UTC)
    for number in range(count):
        path = folder / f"{number:04}.h5"
        write_recording(pieces[number % len(pieces)], path)
        with h5py.File(path, "r+") as file:
            file.attrs["started"] = (begin + timedelta(hours=number)).isoformat()
    for path in sorted(folder.iterdir())[:damaged]:
        path.write_bytes(path.read_bytes()[:20_000])


class Cluster:
    """A scheduler and workers, each a process, as `dask scheduler` and `dask worker` start them.

    Args:
        workers: of one thread each; a nanny restarts those that die.
        folder: for logs.
    """

    def __init__(self, workers: int, folder: Path) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self._port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{self._port}"
        self._log = (folder / "cluster.log").open("ab")
        self._folder, self._count = folder, workers
        self._start_all()
        with Client(self.address, timeout=120) as client:
            client.wait_for_workers(workers, timeout=120)

    def _start_all(self) -> None:
        self._scheduler = self._start(
            "scheduler", "--host", "127.0.0.1", "--port", str(self._port),
            "--dashboard-address", "127.0.0.1:0",
        )  # fmt: skip
        self._workers = [
            self._start(
                "worker", self.address, "--nworkers", "1", "--nthreads", "1", "--no-dashboard",
                "--death-timeout", "600", "--local-directory", str(self._folder),
            )
            for _ in range(self._count)
        ]  # fmt: skip

    def _start(self, *arguments: str) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [sys.executable, "-m", "dask", *arguments], stdout=self._log, stderr=self._log
        )

    def kill_scheduler(self) -> None:
        """Kill it, and start the cluster again at its address: workers end without a scheduler."""
        self._scheduler.kill()
        self._end()
        self._start_all()

    def worker_processes(self) -> list[int]:
        """Those in which diagnoses run: the nannies' children that hold most memory."""
        return [max(_children(w.pid), key=_resident) for w in self._workers if _children(w.pid)]

    def processor_time(self) -> float:
        """Of the workers and what they have started [s]."""
        pids = [p for w in self._workers for p in (w.pid, *_children(w.pid))]
        return sum(map(_processor_time, pids))

    def _end(self) -> None:
        for process in (*self._workers, self._scheduler):
            process.terminate()
        for process in (*self._workers, self._scheduler):
            try:
                process.wait(20)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def close(self) -> None:
        """End all."""
        self._end()
        self._log.close()


@contextmanager
def cluster(workers: int, folder: Path) -> Iterator[Cluster]:
    """A cluster, ended at the end."""
    started = Cluster(workers, folder)
    try:
        yield started
    finally:
        started.close()


def _children(pid: int) -> list[int]:
    found: list[int] = []
    for task in Path("/proc").glob(f"{pid}/task/*/children"):  # any thread may have started one
        try:
            found += map(int, task.read_text().split())
        except OSError:
            continue
    return [child for one in found for child in (one, *_children(one))]


def _resident(pid: int) -> int:
    """Private memory of a process [B]."""
    try:
        fields = Path(f"/proc/{pid}/statm").read_text().split()
    except OSError:
        return 0
    return (int(fields[1]) - int(fields[2])) * resource.getpagesize()


def _processor_time(pid: int) -> float:
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def jobs_of(recordings: Path, out: Path) -> list[Job]:
    """As `fleet diagnose` makes them."""
    return [
        Job(of.url, of.stamp, Folder(str(out)).address, None, False, software_version())
        for of in find_recordings([str(recordings)])
    ]


def run_fleet(
    recordings: Path, out: Path, on: Cluster, each: Callable[[int], None] = lambda _: None
) -> float:
    """Diagnose all; the time that it took [s]."""
    ledger = Ledger(Folder(str(out)))
    begun = time.monotonic()
    for number, outcome in enumerate(
        outcomes(jobs_of(recordings, out), lambda: cluster_at(on.address)), 1
    ):
        if outcome.done is None:
            raise SystemExit(f"{outcome.job.url}: {outcome.failure}")
        ledger.note(outcome.done)
        each(number)
    ledger.save()
    return time.monotonic() - begun


def results(out: Path) -> dict[str, bytes]:
    """Name of each row's file -> content."""
    return {str(p.relative_to(out)): p.read_bytes() for p in out.rglob("results/*/*.parquet")}


def measure_throughput(recordings: Path, folder: Path) -> None:
    """One worker, two workers, a loop."""
    count = len(list(recordings.iterdir()))
    took, used = {}, {}
    for workers in (1, 2):
        with cluster(workers, folder) as on:
            run_fleet_of_one(recordings, folder / f"warm-{workers}", on)
            before = on.processor_time()
            took[workers] = run_fleet(recordings, folder / f"out-{workers}", on)
            used[workers] = on.processor_time() - before
    begun = time.process_time()
    for path in sorted(recordings.iterdir()):
        recording = read_recording(path)
        diagnose_recordings([recording], machine_of(None, recording, fitted=True))
    loop = time.process_time() - begun
    print(f"{count} recordings: 1 worker {took[1]:.1f} s, 2 workers {took[2]:.1f} s: "
          f"{took[1] / took[2]:.2f} times the throughput")  # fmt: skip
    print(f"processor time: loop {loop:.1f} s, 1 worker {used[1]:.1f} s ({used[1] / loop:.2f}), "
          f"2 workers {used[2]:.1f} s ({used[2] / loop:.2f})")  # fmt: skip
    sizes = list(map(len, results(folder / "out-1").values()))
    print(f"a result has {sum(sizes) / len(sizes) / 1e3:.1f} kB")


def run_fleet_of_one(recordings: Path, out: Path, on: Cluster) -> None:
    """Imports and kernels are there afterwards, in every worker."""
    warm = out.with_name(out.name + "-recordings")
    warm.mkdir()
    for path in sorted(recordings.iterdir())[-4:]:
        shutil.copy(path, warm / path.name)
    run_fleet(warm, out, on)


def measure_memory(folder: Path, count: int) -> None:
    """Of one worker, after FIRST recordings and after all."""
    recordings = folder / "many"
    make_recordings(recordings, count)
    seen: list[float] = []
    with cluster(1, folder) as on:

        def look(number: int) -> None:
            if number >= FIRST:
                seen.append(_resident(on.worker_processes()[0]) / 1e6)

        run_fleet(recordings, folder / "out-many", on, look)
    first, last = (sorted(part)[len(part) // 2] for part in (seen[:10], seen[-10:]))
    print(f"memory of a worker, medians of 10: {first:.0f} MB from recording {FIRST}, "
          f"{last:.0f} MB up to {count}: {100 * (last / first - 1):+.1f} %")  # fmt: skip


class Chaos(NamedTuple):
    """What became of a disturbed fleet.

    Attributes:
        duration: of a diagnosis, undisturbed [s].
        killed: workers.
        exit_code: of the client.
        diagnosed, refused: recordings.
        rewritten: results that were written again.
        same: whether the rows are those of an undisturbed fleet.
    """

    duration: float
    killed: int
    exit_code: int
    diagnosed: int
    refused: int
    rewritten: int
    same: bool


def run_chaos(recordings: Path, folder: Path, seed: int) -> Chaos:
    """Kill and compare with the fleet that was not disturbed."""
    draw = random.Random(seed)  # noqa: S311
    out, count = folder / "out-chaos", len(list(recordings.iterdir()))
    command = [
        sys.executable, "-m", "stagectl", "fleet", "diagnose", str(recordings), "--out", str(out),
    ]  # fmt: skip
    killed, written, rewritten = 0, dict[str, int](), 0
    with cluster(2, folder) as on:
        begun = time.monotonic()
        run_fleet(recordings, folder / "out-calm", on)
        duration = 2 * (time.monotonic() - begun) / count
        client = subprocess.Popen([*command, "--scheduler", on.address])
        next_kill = time.monotonic() + EVERY * duration
        scheduler = restarted = False
        while client.poll() is None:
            time.sleep(0.05)
            for path in out.rglob("results/*/*.parquet"):
                stamp = path.stat().st_mtime_ns
                rewritten += written.setdefault(path.name, stamp) != stamp
                written[path.name] = stamp
            due = time.monotonic() > next_kill or (written and not killed)
            if due and (processes := on.worker_processes()):
                os.kill(draw.choice(processes), signal.SIGKILL)
                killed += 1
                next_kill = time.monotonic() + EVERY * duration
            if len(written) > count / 3 and not scheduler:
                on.kill_scheduler()
                scheduler = True
            if len(written) > 2 * count / 3 and not restarted:
                client.kill()
                client.wait()
                client = subprocess.Popen([*command, "--scheduler", on.address])
                restarted = True
    calm, chaos = results(folder / "out-calm"), results(out)
    rows = [from_parquet(content, RESULT)[0] for content in chaos.values()]
    refused = sum(row["verdict"] == REFUSED for row in rows)
    return Chaos(
        duration, killed, client.returncode, len(rows) - refused, refused, rewritten, calm == chaos
    )


def main() -> None:
    """Run what is asked for."""
    parser = argparse.ArgumentParser(
        "benchmarks.fleet.campaign", description="Throughput, cost and robustness of a fleet."
    )
    parser.add_argument("--recordings", type=int, default=60)
    parser.add_argument("--memory", type=int, default=0, help="recordings for the memory; 0: none")
    parser.add_argument("--chaos", action="store_true", help="kill, and nothing else")
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="fleet-") as name:
        folder = Path(name)
        recordings = folder / "recordings"
        make_recordings(recordings, asked.recordings, DAMAGED if asked.chaos else 0)
        if asked.chaos:
            found = run_chaos(recordings, folder, asked.seed)
            print(", ".join(f"{name} {value}" for name, value in found._asdict().items()))
        else:
            measure_throughput(recordings, folder)
        if asked.memory:
            measure_memory(folder, asked.memory)


if __name__ == "__main__":
    main()
