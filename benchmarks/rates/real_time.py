"""Punctuality of the SYNC cycle in real time on this machine, under load.

    python -m benchmarks.rates.real_time --bus udp_multicast:239.74.163.9 [--period 0.001]
        [--load 2]
    tools/with-vcan python -m benchmarks.rates.real_time --period 0.004

The virtual drives run in a process of their own; the host holds the stage and then prints the
ledger: samples missed and late, and their arrival after SYNC. `--load N` runs N further processes
that only compute. `--fifo`, `--core` and `--lock` request real-time scheduling.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np

from drivers.settings import BusSettings, RealTimeSettings
from drivers.stage import Stage
from stagectl.config.machine.file import load_machine
from stagectl.config.settings.package_settings import driver_settings

SERVER = Path(__file__).parents[2] / "tests" / "hil" / "serve.py"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    default = f"socketcan:{os.environ.get('STAGECTL_HIL_SOCKETCAN', 'vcan0')}"
    parser.add_argument("--bus", default=default)
    parser.add_argument("--period", type=float, default=1e-3)
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--load", type=int, default=0)
    parser.add_argument("--sync", default="auto")
    parser.add_argument("--fifo", type=int, default=0)
    parser.add_argument("--core", type=int)
    parser.add_argument("--lock", action="store_true")
    given = parser.parse_args()
    interface, channel = given.bus.split(":", 1)
    _, axes = driver_settings(load_machine())
    bus = BusSettings(
        interface, channel, sync_period=given.period, max_missed=500, max_late=5000,
        sync_source=given.sync, realtime=RealTimeSettings(given.fifo, given.core, given.lock),
    )  # fmt: skip
    with ExitStack() as stack:
        server = subprocess.Popen(
            [sys.executable, SERVER, *given.bus.split(":", 1), str(given.period), "0", "0",
             str(given.fifo)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        )  # fmt: skip
        stack.callback(server.kill)
        assert server.stdout is not None
        server.stdout.readline()
        for _ in range(given.load):
            burner = subprocess.Popen([sys.executable, "-c", "while True: sum(range(10000))"])
            stack.callback(burner.kill)
        axes = tuple(replace(a, homing_method=37) for a in axes)
        with Stage.open(bus, axes) as stage:
            stage.boot()
            stage.home()
            stage.enable()
            samples = stage.hold(given.seconds)
            arrival = samples.arrival[samples.valid] * 1e6
            shares = np.percentile(arrival, [1, 50, 90, 99, 99.9, 100])
            passed = int(np.round(np.diff(samples.time) / given.period - 1).sum())
            print(
                f"{given.bus} {given.period * 1e3:g} ms, load {given.load}: {len(samples)} cycles, "
                f"valid {samples.valid.mean():.4f}, late {samples.late.sum()}, passed over {passed}"
                f", besides {int(samples.extra.sum())}; arrival [us] 1 50 90 99 99.9 100 %: "
                + " ".join(f"{x:.0f}" for x in shares)
            )
            for notice in stage.notices:
                print(notice)
        assert server.stdin is not None
        server.stdin.close()
        server.wait(10)


if __name__ == "__main__":
    main()
