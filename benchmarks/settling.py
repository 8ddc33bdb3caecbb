"""Settling of micro-moves with estimated friction, compared with the true figures.

    python benchmarks/settling.py [--seeds 12] [--truth file|drawn|both]

Whole runs of the recipe inspection-20 on the virtual stage, through `stagectl.run.execute`: every
seed once with estimated friction, started at half of the machine file's figures, and once as
`oracle`, which knows the true figures (but not the wander of the Coulomb force). From the fourth
site on, both axes together. The true stage is the machine file's (`file`), or one whose Coulomb
force, viscous friction, stiffness and attraction deviate by -40 to +60 %, drawn for each seed and
axis (`drawn`).
"""

from __future__ import annotations

import argparse

import numpy as np
from machine_facts import machine_facts
from run_figures import RECIPE, Case, run

from stagectl.config.machine import Machine
from stagectl.config.machine_file import load_machine
from stagectl.recipe import load_recipe
from stagectl.sequencer import Mode

FIRST_SITE = 4
LEAST, MOST = 0.6, 1.6
DEMANDS = {"file": (1.15, 1e-3, 1.3), "drawn": (1.3, 2e-3, 1.5)}
"""Mean settling to 50 nm over the oracle's; median to 200 nm [s]; median peak over the oracle's."""


def drawn(machine: Machine, seed: int) -> Machine:
    """Another stage of the same build."""
    generator = np.random.default_rng([seed, 77])
    axes = {}
    for name, axis in machine.axes.items():
        friction = axis.plant.friction
        factor = dict(
            zip(
                ("coulomb", "viscous", "stiffness", "attraction"),
                generator.uniform(LEAST, MOST, 4).tolist(),
                strict=True,
            )
        )
        friction = friction.model_copy(
            update={name: getattr(friction, name) * f for name, f in factor.items()}
        )
        plant = axis.plant.model_copy(update={"friction": friction})
        axes[name] = axis.model_copy(update={"plant": plant})
    return machine.model_copy(update={"axes": axes})


def figures(mode: Mode, which: str, seeds: int) -> dict[str, np.ndarray]:
    """Peak error [m] and settling [s] of every micro-move."""
    machine = load_machine(None)
    recipe = load_recipe(RECIPE, machine)
    case = Case("", mode, 0.5 if mode is Mode.ESTIMATED else 1.0)
    rows = []
    for seed in range(1, seeds + 1):
        truth = machine if which == "file" else drawn(machine, seed)
        summary = run(case, recipe, machine, seed, truth)
        rows += [
            (move["peak_error"], move["settling"]["5e-08"], move["settling"]["2e-07"])
            for move in summary["moves"]
            if move["kind"] == "micro" and move["site"] >= FIRST_SITE
        ]
    peak, fine, coarse = np.array(rows, dtype=float).T
    return {"peak": peak, "fine": fine, "coarse": coarse}


def main() -> None:
    """Run and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=12)
    parser.add_argument("--truth", choices=("file", "drawn", "both"), default="both")
    arguments = parser.parse_args()
    print(
        f"seeds 1..{arguments.seeds}; {machine_facts()}\n\n"
        "| true stage | force offsets | micro-moves | to ±50 nm, mean, ms | over the oracle's "
        "| to ±200 nm, median, ms | peak, median, µm | over the oracle's |\n"
        "| --- | --- | --- | --- | --- | --- | --- | --- |"
    )
    for which in ("file", "drawn") if arguments.truth == "both" else (arguments.truth,):
        oracle = figures(Mode.ORACLE, which, arguments.seeds)
        for mode in (Mode.ORACLE, Mode.ESTIMATED):
            own = oracle if mode is Mode.ORACLE else figures(mode, which, arguments.seeds)
            fine, peak = own["fine"].mean(), float(np.median(own["peak"]))
            ratio, peaks = (
                fine / oracle["fine"].mean(),
                peak / float(np.median(oracle["peak"])),
            )
            print(
                f"| {which} | `{mode.value}` | {len(own['fine'])} | {fine * 1e3:.1f} | {ratio:.2f} "
                f"| {np.median(own['coarse']) * 1e3:.1f} | {peak * 1e6:.3f} | {peaks:.2f} |",
                flush=True,
            )
        most, coarse, most_peak = DEMANDS[which]
        print(
            f"| {which} | wanted | | | ≤ {most} | ≤ {coarse * 1e3:.0f} | | ≤ {most_peak} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
