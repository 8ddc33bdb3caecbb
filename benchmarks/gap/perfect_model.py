"""What a perfect model leaves of a gap, over seeds.

Runs inspection-20 on the virtual stage that the machine file describes exactly, once per seed of
noise and friction scatter, and prints gap over floor: the smallest, the median and the largest.

    python -m benchmarks.gap.perfect_model [--seeds 20]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from benchmarks.shared.inspection_runs import Case, run_whole
from sim2real.gap import combined_floors, measure_gap
from stagectl.config import load_machine, stage_settings
from stagectl.recipe import load_recipe
from stagectl.sequencer import Mode

RECIPE = Path(__file__).parents[2] / "recipes" / "inspection-20.yaml"
CASE = Case("estimated", Mode.ESTIMATED, observer=True)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=20)
    machine = load_machine()
    settings = stage_settings(machine)
    recipe = load_recipe(RECIPE, machine)
    single: list[float] = []
    combined: list[float] = []
    for seed in range(1, parser.parse_args().seeds + 1):
        recording = run_whole(CASE, recipe, machine, seed).recording
        assert recording is not None
        gap = measure_gap(recording, settings)
        single += [f.nominal / f.floor for signals in gap.values() for f in signals.values()]
        combined.append(combined_floors(gap))
    print("| gap over floor | smallest | median | largest |")
    print("| --- | --- | --- | --- |")
    for name, found in (("one signal of one axis", single), ("combined", combined)):
        low, middle, high = np.quantile(found, (0.0, 0.5, 1.0))
        print(f"| {name} | {low:.1f} | {middle:.1f} | {high:.1f} |")


if __name__ == "__main__":
    main()
