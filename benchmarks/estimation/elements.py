"""Scores of sigma0 on stages whose friction has another number of elements than the host's file.

    python -m benchmarks.estimation.elements [--seeds 2] [--elements 2 4 10 20] [--first 1]

Whole runs of the recipe inspection-20 on the virtual stage, without the observer. The host's
machine file is wafer-xy with N = 10, started at half of its figures; the true stage differs in N
alone. Both axes, updates accepted from the fourth site on; z is the error of sigma0 over its
reported sigma.
"""

from __future__ import annotations

import argparse

import numpy as np

from benchmarks.shared.inspection_runs import FIRST_SITE, RECIPE, Case, run
from benchmarks.shared.machine_facts import machine_facts
from stagectl.config.machine import Machine
from stagectl.config.machine.file import load_machine
from stagectl.recipe import load_recipe
from stagectl.sequencer import Mode


def with_elements(machine: Machine, elements: int) -> Machine:
    """The machine with another N on every axis."""
    axes = {}
    for name, axis in machine.axes.items():
        friction = axis.plant.friction.model_copy(update={"elements": elements})
        plant = axis.plant.model_copy(update={"friction": friction})
        axes[name] = axis.model_copy(update={"plant": plant})
    return machine.model_copy(update={"axes": axes})


def scores(machine: Machine, elements: int, seed: int) -> list[tuple[float, float]]:
    """Relative error of sigma0 and its reported relative sigma, of every accepted update."""
    case = Case("", Mode.ESTIMATED, friction_scale=0.5)
    truth = with_elements(machine, elements)
    summary = run(case, load_recipe(RECIPE, machine), machine, seed, truth)
    found = []
    for entry in summary["friction"]:
        if not entry["accepted"] or entry["site"] < FIRST_SITE:
            continue
        true = truth.axes[entry["axis"]].plant.friction.stiffness
        own = entry["parameters"]["stiffness"]
        found.append((own["value"] / true - 1.0, own["sigma"] / true))
    return found


def main() -> None:
    """Run and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=2, help="runs per N [2]")
    parser.add_argument("--first", type=int, default=1, help="first seed [1]")
    parser.add_argument("--elements", type=int, nargs="+", default=[2, 4, 10, 20])
    given = parser.parse_args()
    machine = load_machine(None)
    print(f"seeds {given.first}..{given.first + given.seeds - 1}; {machine_facts()}\n")
    print("| true N | updates | error of sigma0, mean, rms | sigma, median | |z| > 2 | |z| > 4 |")
    print("| --- | --- | --- | --- | --- | --- |")
    for elements in given.elements:
        seeds = range(given.first, given.first + given.seeds)
        found = np.array([s for seed in seeds for s in scores(machine, elements, seed)])
        error, sigma = found.T
        z = np.abs(error / sigma)
        print(
            f"| {elements} | {len(z)} | {error.mean():+.1%}, {np.sqrt(np.mean(error**2)):.1%} "
            f"| {np.median(sigma):.1%} | {np.mean(z > 2.0):.1%} | {np.mean(z > 4.0):.1%} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
