"""What the force sampled at SYNC shows of the mass (docs/explanation/estimation.md).

    python -m benchmarks.estimation.apparent_mass

One noise-free simulated macro-move. Where all elements slip, the measured force is fitted by mass
times acceleration plus viscous friction plus a constant.
"""

from __future__ import annotations

import argparse
import math

import numpy as np

from estimation.trajectory import Limits, plan
from hil_sim.plant import simulate
from stagectl.config.machine.file import load_machine
from stagectl.config.settings.package_settings import stage_settings

SLIDING = 0.02
"""Slowest sample that counts: ten Stribeck velocities [m/s]."""


def main() -> None:
    """Print the fitted mass of each axis relative to the true one."""
    argparse.ArgumentParser(description=__doc__.partition("\n")[0]).parse_args()
    settings = stage_settings(load_machine(None))
    period = settings.sync_period
    motion = plan(0.0, 0.05, Limits(velocity=0.5, acceleration=3.0, jerk=200.0))
    samples = math.ceil(motion.duration / period) + 50
    time = np.asarray(np.arange(1, samples + 1) * period, dtype=np.float64)
    position, _, acceleration = motion.sample(time)
    demand = np.column_stack([np.round(position, 9) for _ in settings.axes])
    offset = np.column_stack([axis.mass * acceleration for axis in settings.axes])
    response = simulate(settings, demand, offset, seed=None)
    for a, axis in enumerate(settings.axes):
        before, at, after = (response.position[n : n + samples - 2, a] for n in range(3))
        velocity = (after - before) / (2 * period)
        slides = velocity > SLIDING
        columns = np.column_stack(
            [(after - 2 * at + before) / period**2, velocity, np.ones(samples - 2)]
        )
        mass = np.linalg.lstsq(columns[slides], response.force[1:-1, a][slides], rcond=None)[0][0]
        print(f"axis {axis.name}: {mass / axis.mass - 1.0:+.1%} of the mass")


if __name__ == "__main__":
    main()
