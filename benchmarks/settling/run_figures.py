"""Figures of the recipe inspection-20 on the virtual stage, as a markdown table.

    python -m benchmarks.settling.run_figures [--seeds 5]

Every row is a set of whole runs through `stagectl.run.execute`: CAN frames, two axes, journal, bus
log and report included. Peak error and settling are those of `summary.json` (docs/formats/run.md),
both axes together; all but one row are without the observer. Settling, peak error and friction
depend only on recipe and seed; the last column depends on the machine.
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

from benchmarks.shared.inspection_runs import RECIPE, Case, run
from benchmarks.shared.machine_facts import machine_facts
from stagectl.config.machine.file import load_machine
from stagectl.recipe import load_recipe
from stagectl.sequencer import Mode

WINDOWS = ("5e-08", "2e-07")


CASES = (
    Case("mass only (`none`)", Mode.NONE),
    Case("friction figures halved, never updated (`model`)", Mode.MODEL, 0.5, 4),
    Case("friction figures halved, estimated, from site 4 on", Mode.ESTIMATED, 0.5, 4),
    Case("the same, with the observer", Mode.ESTIMATED, 0.5, 4, True),
    Case("friction figures right at the start, estimated", Mode.ESTIMATED),
    Case("true friction figures (`oracle`)", Mode.ORACLE),
)


def row(case: Case, kind: str, summaries: list[dict[str, Any]]) -> str:
    """Markdown of one kind of move."""
    moves = [
        move
        for summary in summaries
        for move in summary["moves"]
        if move["kind"] == kind and move["site"] >= case.first_site
    ]
    peak = float(np.median([move["peak_error"] for move in moves])) * 1e6
    cells = [case.label, kind, str(len(moves)), f"{peak:.2f}"]
    for window in WINDOWS:
        settling = np.array([move["settling"][window] for move in moves]) * 1e3
        cells.append(f"{np.median(settling):.1f} ({settling.mean():.1f})")
    speed = np.median([summary["duration"] / summary["wall_time"] for summary in summaries])
    cells.append(f"{speed:.0f}")
    return "| " + " | ".join(cells) + " |"


def main() -> None:
    """Run all cases and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=5, help="runs per case [5]")
    seeds = range(1, parser.parse_args().seeds + 1)
    machine = load_machine(None)
    recipe = load_recipe(RECIPE, machine)
    run(CASES[0], recipe, machine, 1)  # compiles
    print(
        f"recipe {recipe.name}, machine {machine.name}, seeds 1..{seeds[-1]}; {machine_facts()}\n"
    )
    print(
        "| force offsets | move | count | peak error, µm | to ±50 nm, ms | to ±200 nm, ms "
        "| stage time / wall time |\n| --- | --- | --- | --- | --- | --- | --- |"
    )
    for case in CASES:
        summaries = [run(case, recipe, machine, seed) for seed in seeds]
        for kind in ("macro", "micro"):
            print(row(case, kind, summaries), flush=True)
    print(
        "\nPeak error: median. Settling: median (mean). Stage time / wall time: median over runs."
    )


if __name__ == "__main__":
    main()
