"""The friction history under stress: killed 200 times, and with ten years of calibrations.

`python -m benchmarks.maps.history [--kills N] [--wafers N] [--url postgresql://...]`

Kills: a process writes pairs of estimates, reports each commit, and gets SIGKILL at a random
instant, which may be while the file is created. Afterwards the file must open and pass SQLite's
check, with everything that was reported, and no half pair.
Speed: 521 weekly calibrations of 49 sites and 2 axes, 51,058 rows; median and worst of 50 reads.
Production: how long a run takes to start with the map (and to find what is due) after this many
wafers of 20 sites, 80 rows each. It should not grow with their number.
"""

from __future__ import annotations

import argparse
import contextlib
import itertools
import os
import random
import signal
import sqlite3
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Literal

from benchmarks.shared.machine_facts import machine_facts
from stagectl.calibration import DueSection, due_sites
from stagectl.config.machine.file import load_machine
from stagectl.history import EstimateRecord, History, RunEntry, StageKey, open_history
from stagectl.maps import build_map, load_active, to_json

WEEK = 7 * 86400.0
STAGE = StageKey("wafer-xy", False)
SITES = [(x * 0.02 - 0.06, y * 0.02 - 0.06) for y in range(7) for x in range(7)]
FIGURES = {"coulomb": 6.0, "viscous": 20.0, "stiffness": 6e5, "relaxation_rate": 100.0}

WRITER = """
import sys
from stagectl.history.opening import open_history
from stagectl.history.records import EstimateRecord, RunEntry, StageKey
sys.stdout.write("up\\n"); sys.stdout.flush()
history = open_history(sys.argv[1], write=True)
run = history.start_run(
    RunEntry(StageKey("wafer-xy", False), ("x", "y"), 0.0, "r", None, None, "s", "f"))
i = 0
while True:
    history.add([EstimateRecord(run, axis, "macro", i, (i % 49 * 1e-3, 0.0), float(i), 0.01, True,
                                None, {"coulomb": 1.0 + i}, (0.01,)) for axis in "xy"])
    sys.stdout.write(f"{run} {i}\\n"); sys.stdout.flush()
    i += 1
"""


def kills(count: int, folder: Path) -> None:
    """Kill the writer repeatedly, half of the times while the file is new; check after each."""
    generator = random.Random(1)  # noqa: S311
    path = folder / "kill.db"
    promised: dict[int, int] = {}
    commits = fresh = 0
    for attempt in range(count):
        if attempt % 2 == 0:  # a new file: the making of its tables is hit, too
            for suffix in ("", "-wal", "-shm"):
                Path(f"{path}{suffix}").unlink(missing_ok=True)
            promised.clear()
        command = [sys.executable, "-c", WRITER, str(path)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as writer:
            assert writer.stdout is not None
            writer.stdout.readline()
            time.sleep(generator.uniform(0.0, 0.04 if attempt % 2 == 0 else 0.15))
            os.kill(writer.pid, signal.SIGKILL)
            lines = [line for line in writer.stdout.read().splitlines(True) if line.endswith("\n")]
        if lines:
            run, last = map(int, lines[-1].split())
            promised[run] = last
            commits += last + 1
        else:
            fresh += 1
        open_history(str(path), write=True).close()
        with contextlib.closing(sqlite3.connect(path)) as connection:
            assert connection.execute("PRAGMA integrity_check").fetchone() == ("ok",)
            assert connection.execute("PRAGMA foreign_key_check").fetchall() == []
            rows = dict(connection.execute("SELECT run, max(site) FROM estimate GROUP BY run"))
            half = connection.execute(
                "SELECT run, site FROM estimate GROUP BY run, site HAVING count(*) != 2"
            ).fetchall()
        assert half == [], half
        for run, last in promised.items():
            assert rows.get(run, -1) >= last, (run, last, rows)
    print(
        f"{count} kills: every file opened and passed its check, nothing of {commits} commits "
        f"was reported as saved and lost, no half pair; {fresh} kills came before the first commit"
    )


def fill(history: History) -> float:
    """Ten years of weekly calibrations; returns seconds per estimate, one calibration a commit."""
    begin = time.perf_counter()
    rows = 0
    for week in range(521):
        run = history.start_run(
            RunEntry(
                STAGE,
                ("x", "y"),
                week * WEEK,
                "calibration",
                None,
                None,
                "stagectl",
                "runs",
                "calibration",
            )
        )
        entries = [
            EstimateRecord(
                run, axis, "calibration", i + 1, site, week * WEEK + 10.0 * i, 0.02, True, None,
                FIGURES, tuple(0.01 * (j % 5 == 0) for j in range(16)), 1.0, (1.0, 0.002), 22.0,
            )
            for i, site in enumerate(SITES) for axis in "xy"
        ]  # fmt: skip
        history.add(entries)
        rows += len(entries)
    return (time.perf_counter() - begin) / rows


def speed(history: History, label: str) -> None:
    """Write ten years, then read trends and maps."""
    per_row = fill(history)
    trend, whole = [], []
    generator = random.Random(2)  # noqa: S311
    for _ in range(50):
        site = generator.choice(SITES)
        begin = time.perf_counter()
        points = history.trend(STAGE, generator.choice("xy"), site)
        trend.append(time.perf_counter() - begin)
        assert len(points) == 521
        begin = time.perf_counter()
        entries = history.at_date(STAGE, generator.uniform(WEEK, 521 * WEEK))
        whole.append(time.perf_counter() - begin)
        assert len(entries) == 98
    print(f"{label}: {sum(history.counted(STAGE)):,} rows, {per_row * 1e6:.0f} us each to write")
    for name, values, limit in (("trend of one site", trend, 5), ("map at a date", whole, 50)):
        print(
            f"  {name}: median {statistics.median(values) * 1e3:.2f} ms, worst "
            f"{max(values) * 1e3:.2f} ms (must be <= {limit} ms)"
        )


def produce(history: History, first: int, last: int) -> None:
    """Wafers of production, a minute each; the first one is a calibration."""
    generator = random.Random(first)  # noqa: S311
    covariance = tuple(0.01 * (j % 5 == 0) for j in range(16))
    for wafer in range(first, last):
        at = 60.0 * wafer
        purpose: Literal["calibration", "production"] = "production" if wafer else "calibration"
        run = history.start_run(
            RunEntry(STAGE, ("x", "y"), at, "r", "l", str(wafer), "s", "f", purpose)
        )
        rows = []
        for i, site in enumerate(SITES[:40:2]):
            for axis, kind in itertools.product("xy", ("macro", "micro")):
                level = (6.0 if axis == "x" else 9.0) * (1.0 + generator.gauss(0.0, 0.01))
                rows.append(
                    EstimateRecord(
                        run, axis, kind, i + 1, site, at + 2.0 * i, 0.02, True, None,
                        FIGURES | {"coulomb": level}, covariance, 1.0, (level, 0.03),
                    )
                )  # fmt: skip
        history.add(rows)


def beginnings(history: History, wafers: int) -> None:
    """How long a run takes to start with the map, early and late in the life of a stage."""
    machine, limits = load_machine(), DueSection()
    produce(history, 0, 1)
    number = history.save_map(STAGE, 0.0, "", to_json(build_map(history, STAGE)))
    history.activate(STAGE, number, 0.0, "activated")
    done = 1
    for count in (wafers // 10, wafers):
        produce(history, done, count)
        done, now = count, 60.0 * count
        spent: dict[str, list[float]] = {"begin": [], "due": []}
        for _ in range(3):
            begin = time.perf_counter()
            active = load_active(history, STAGE, machine, SITES, now)
            middle = time.perf_counter()
            assert active is not None
            due_sites(SITES, limits, history, STAGE, ("x", "y"), now, active.places)
            spent["begin"].append(middle - begin)
            spent["due"].append(time.perf_counter() - middle)
        print(
            f"behind {sum(history.counted(STAGE)):,} rows of production a run begins by its map "
            f"after {min(spent['begin']):.2f} s; {min(spent['due']):.2f} s more to say what is due"
        )


def main() -> None:
    """All parts."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--wafers", type=int, default=2000, help="of production; 0: none")
    parser.add_argument("--url", help="also time this (empty) PostgreSQL database")
    options = parser.parse_args()
    print(machine_facts())
    with tempfile.TemporaryDirectory() as folder:
        if options.kills:
            kills(options.kills, Path(folder))
        history = open_history(str(Path(folder) / "stage.db"), write=True)
        speed(history, "SQLite")
        history.close()
        if options.wafers:
            history = open_history(str(Path(folder) / "production.db"), write=True)
            beginnings(history, options.wafers)
            history.close()
    if options.url:
        history = open_history(options.url, write=True)
        speed(history, "PostgreSQL")
        history.close()


if __name__ == "__main__":
    main()
