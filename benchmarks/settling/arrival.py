"""Where long macro-moves end: deviation from the target, median and scatter, as a table.

    python -m benchmarks.settling.arrival [--seeds 4]

Whole runs of the recipe inspection-20 on the virtual stage, all figures known (`oracle`), with and
without the settling observer. A bias here is the feedforward's: friction's wander has none. Moves
in opposite directions count with opposite signs, so that too far is positive.
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from benchmarks.shared.inspection_runs import RECIPE, Case, run_whole
from benchmarks.shared.machine_facts import machine_facts
from stagectl.config.machine.file import load_machine
from stagectl.recipe import load_recipe
from stagectl.sequencer import Mode

LONG = 1e-3
"""Shortest move that counts [m]."""
LATER = (0, 2, 5)
"""Samples after the demand has arrived."""


def main() -> None:
    """Run and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=4, help="runs [4]")
    seeds = parser.parse_args().seeds
    machine = load_machine()
    recipe = load_recipe(RECIPE, machine)
    print(
        f"seeds 1..{seeds}; beyond the target, median ± half of the central 68 %, nm; "
        f"{machine_facts()}\n\n"
        f"| observer | axis | moves | {' | '.join(f'after {k} SYNCs' for k in LATER)} |\n"
        f"| --- | --- | --- |{' --- |' * len(LATER)}"
    )
    for observer in (False, True):
        case = Case("", Mode.ORACLE, observer=observer)
        beyond: dict[str, list[list[float]]] = {name: [] for name in machine.axes}
        for seed in range(1, seeds + 1):
            recording = run_whole(case, recipe, machine, seed).recording
            assert recording is not None
            for move in recording.moves:
                for name, signals in recording.axes.items():
                    length = move.target[name] - move.origin[name]
                    moving = np.flatnonzero(np.diff(signals.position_demand[: move.end]))
                    if abs(length) < LONG or move.kind != "macro" or not len(moving):
                        continue
                    at = int(moving[-1]) + 2 + np.array(LATER)  # the drive arrives a SYNC later
                    error = signals.position_actual[at] - move.target[name]
                    beyond[name].append(list(1e9 * np.sign(length) * error))
        for name, rows in beyond.items():
            low, middle, high = np.quantile(rows, (0.16, 0.5, 0.84), axis=0)
            each = [f"{m:.0f} ± {s:.0f}" for m, s in zip(middle, (high - low) / 2, strict=True)]
            print(f"| {'on' if observer else 'off'} | {name} | {len(rows)} | {' | '.join(each)} |")


if __name__ == "__main__":
    main()
