"""Scans a line with a stage server's client and reports the largest following error of each step.

stagectl serve --simulate &
python examples/scan_with_client.py --from 0 --to 20 --steps 5
"""

from __future__ import annotations

import argparse

import numpy as np

from stagectl.client import Client
from stagectl.protocol import requests as ask
from stagectl.protocol.wire import SampleBlock


def largest_error(stage: Client, axis: int, target: float) -> float:
    """Moves the axis to `target` [m]; the largest following error on the way [m]."""
    name = stage.info.axes[axis].name
    demand, position = [], []
    samples = stage.watch(samples=True, timeout=2.0)
    job = stage.begin(ask.Move(axis=name, position=target, velocity=0.05))
    for seen in samples:
        if isinstance(seen, SampleBlock):
            demand.append(seen.demand[:, axis])
            position.append(seen.position[:, axis])
        elif demand and stage.look(job, 1e-3).ended:
            break
    stage.wait(job)
    # position k is where the drive was when it got demand k; it follows demand k - 1
    return float(np.abs(np.concatenate(demand)[:-1] - np.concatenate(position)[1:]).max())


def main() -> None:
    """Scan."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--server", help="its name, where there are several")
    options.add_argument("--from", dest="start", type=float, default=0.0, help="[mm]")
    options.add_argument("--to", type=float, default=20.0, help="[mm]")
    options.add_argument("--steps", type=int, default=5)
    given = options.parse_args()
    with Client(given.server, "scan") as stage:
        stage.take()
        stage.do(ask.Home())
        for target in np.linspace(given.start, given.to, given.steps + 1) * 1e-3:
            error = largest_error(stage, 0, float(target))
            print(f"{target * 1e3:7.3f} mm: {error * 1e9:6.0f} nm")
        stage.release()


if __name__ == "__main__":
    main()
