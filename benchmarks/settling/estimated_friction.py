"""Settling of micro-moves with estimated friction, compared with the true figures.

    python -m benchmarks.settling.estimated_friction [--seeds 12] [--truth file|drawn|both]
    python -m benchmarks.settling.estimated_friction --laws [--seeds 5]

Whole runs of the recipe inspection-20 on the virtual stage, through `stagectl.run.execute`: every
seed once with estimated friction, started at half of the machine file's figures, and once as
`oracle`, which knows the true figures (but not the wander of the Coulomb force). Counted: from
site 4 on, both axes together. The true stage is the machine file's (`file`), or one whose Coulomb
force, viscous friction, stiffness and attraction deviate by -40 to +60 %, drawn for each seed and
axis (`drawn`).

With `--laws`: the file's stage under the friction laws gms and coulomb, each with a host that uses
either.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np

from benchmarks.shared.inspection_runs import FIRST_SITE, RECIPE, Case, run
from benchmarks.shared.machine_facts import machine_facts
from benchmarks.shared.other_stages import drawn, of_law
from stagectl.config.machine import Machine
from stagectl.config.machine.file import load_machine
from stagectl.recipe import load_recipe
from stagectl.sequencer import Mode
from stagedata import LAW_FIGURES

DEMANDS = {"file": (1.15, 1e-3, 1.3), "drawn": (1.3, 2e-3, 1.5)}
"""Targets: mean settling to 50 nm / oracle's; median to 200 nm [s]; median peak / oracle's."""


def micro_moves(
    mode: Mode, machine: Machine, truth: Callable[[int], Machine], seeds: int
) -> dict[str, np.ndarray]:
    """Peak error [m], settling [s] and whether it settled to 50 nm, of every micro-move.

    Args:
        mode: of compensation; an estimating host starts at half of the machine's figures.
        machine: as the host believes it.
        truth: the stage of each seed.
        seeds: runs, from seed 1 on.
    """
    recipe = load_recipe(RECIPE, machine)
    case = Case("", mode, 0.5 if mode is Mode.ESTIMATED else 1.0)
    rows = []
    for seed in range(1, seeds + 1):
        summary = run(case, recipe, machine, seed, truth(seed))
        rows += [
            (
                move["peak_error"], move["settling"]["5e-08"], move["settling"]["2e-07"],
                move["settled"],
            )
            for move in summary["moves"]
            if move["kind"] == "micro" and move["site"] >= FIRST_SITE
        ]  # fmt: skip
    peak, fine, coarse, settled = np.array(rows, dtype=float).T
    return {"peak": peak, "fine": fine, "coarse": coarse, "settled": settled}


def figures(mode: Mode, which: str, seeds: int) -> dict[str, np.ndarray]:
    """Figures of micro-moves on the machine file's stage, or on randomly drawn ones."""
    machine = load_machine(None)
    return micro_moves(
        mode, machine, lambda seed: machine if which == "file" else drawn(machine, seed), seeds
    )


def compare_laws(seeds: int) -> None:
    """Print the table of `--laws`."""
    print(
        f"seeds 1..{seeds}; {machine_facts()}\n\n"
        "| true stage | host | micro-moves | peak, median, µm | to ±50 nm, median (mean), ms "
        "| to ±200 nm, median (mean), ms | not settled |\n"
        "| --- | --- | --- | --- | --- | --- | --- |"
    )
    machine = load_machine(None)
    for law in LAW_FIGURES:
        truth = of_law(machine, law)
        for host in LAW_FIGURES:
            own = micro_moves(Mode.ESTIMATED, of_law(machine, host), lambda _, t=truth: t, seeds)
            cells = [law, host, str(len(own["peak"])), f"{np.median(own['peak']) * 1e6:.3f}"]
            for time in (own["fine"] * 1e3, own["coarse"] * 1e3):
                cells.append(f"{np.median(time):.1f} ({time.mean():.1f})")
            cells.append(f"{1.0 - own['settled'].mean():.0%}")
            print("| " + " | ".join(cells) + " |", flush=True)


def main() -> None:
    """Run and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=12)
    parser.add_argument("--truth", choices=("file", "drawn", "both"), default="both")
    parser.add_argument("--laws", action="store_true", help="compare friction laws instead")
    arguments = parser.parse_args()
    if arguments.laws:
        compare_laws(arguments.seeds)
        return
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
