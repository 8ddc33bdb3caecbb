"""Time that the host takes between two streams, from the last TPDO of one to the start of the next.

    python -m benchmarks.rates.between_streams [--seeds 3]

Runs of the recipe inspection-20 with estimated friction and the observer. Between a move and the
next one the host evaluates it for both axes, plans, and computes the force offsets; while a stage
settles it only begins the next stream. The stage holds its position meanwhile. Processor time of
the thread that drives the bus.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from benchmarks.shared.inspection_runs import RECIPE, Case, run
from benchmarks.shared.machine_facts import machine_facts
from drivers import Stage
from stagectl.config.machine.file import load_machine
from stagectl.recipe import load_recipe
from stagectl.sequencer import AxisCompensation, Mode
from stagedata import Samples


@contextmanager
def timed(gaps: list[float], with_updates: list[float]) -> Iterator[None]:
    """Note the time between streams; apart, where estimates were made in between."""
    stream, learn = Stage.stream, AxisCompensation.learn
    last, updated = None, False

    def timed_stream(self: Stage, *arguments: object) -> Samples:
        nonlocal last, updated
        if last is not None:
            (with_updates if updated else gaps).append(time.thread_time() - last)
        samples = stream(self, *arguments)  # type: ignore[arg-type]
        last, updated = time.thread_time(), False
        return samples

    def noted_learn(self: AxisCompensation, *arguments: object, **more: object) -> object:
        nonlocal updated
        updated = True
        return learn(self, *arguments, **more)  # type: ignore[arg-type]

    Stage.stream, AxisCompensation.learn = timed_stream, noted_learn  # type: ignore
    try:
        yield
    finally:
        Stage.stream, AxisCompensation.learn = stream, learn  # type: ignore


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    options = parser.parse_args()
    machine = load_machine()
    recipe = load_recipe(RECIPE, machine)
    case = Case("", Mode.ESTIMATED, observer=True)
    run(case, recipe, machine, 1)  # kernels are loaded
    gaps: list[float] = []
    with_updates: list[float] = []
    with timed(gaps, with_updates):
        for seed in range(1, options.seeds + 1):
            run(case, recipe, machine, seed)
    print(f"recipe {recipe.name}, two axes, seeds 1..{options.seeds}; {machine_facts()}\n")
    print("| between two streams | count | median, ms | 95th percentile, ms |")
    print("| --- | --- | --- | --- |")
    for label, values in (
        ("estimates of both axes, plan, force offsets", with_updates),
        ("neither", gaps),
    ):
        median, high = 1e3 * np.percentile(values, [50.0, 95.0])
        print(f"| {label} | {len(values)} | {median:.2f} | {high:.2f} |")


if __name__ == "__main__":
    main()
