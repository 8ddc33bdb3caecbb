"""Benefit of an update in the middle of a macro-move for the settling of that move.

    python -m benchmarks.settling.in_motion [--seeds 12] [--error 0.2]

Runs of the recipe inspection-20 with estimated friction. At the start of every macro-move the
host's figures are set wrong by `--error` (Coulomb force, viscous friction and stiffness, all too
low in one half of the runs, too high in the other), with a sigma of the same size; once with the
update while the move brakes (`AxisCompensation.revise`) and once without. Evaluated are axes that
moved more than a millimetre: settling to ±200 nm.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from benchmarks.shared.inspection_runs import RECIPE, Case, run
from benchmarks.shared.machine_facts import machine_facts
from estimation.friction import F64
from estimation.trajectory import Trajectory
from stagectl.config.machine.file import load_machine
from stagectl.recipe import load_recipe
from stagectl.sequencer import TAKE_OVER, AxisCompensation, Mode
from stagectl.sequencer.compensation.axis_compensation import AtRest, AxisMotion

FAR = 1e-3
DEMAND = 0.5


@contextmanager
def wrong_by(error: float, update: bool) -> Iterator[None]:
    """Every macro-move begins with wrong figures; without `update` it ends with them too."""
    force_offsets = AxisCompensation.force_offsets
    revision_time = AxisCompensation.revision_time
    true: dict[int, dict[str, float]] = {}

    def begin(self: AxisCompensation, motion: AxisMotion, rest: AtRest) -> F64:
        friction = self.estimator.friction
        names = ("coulomb", "viscous", "stiffness")
        own = true.setdefault(id(self), {name: getattr(friction, name) for name in names})
        if motion.trajectory.duration >= TAKE_OVER:
            self.estimator.believe({n: (v * (1.0 + error), abs(error) * v) for n, v in own.items()})
        return force_offsets(self, motion, rest)

    def when(self: AxisCompensation, trajectory: Trajectory) -> float:
        return revision_time(self, trajectory) if update else math.inf

    AxisCompensation.force_offsets = begin  # type: ignore[method-assign]
    AxisCompensation.revision_time = when  # type: ignore[method-assign]
    try:
        yield
    finally:
        AxisCompensation.force_offsets = force_offsets  # type: ignore[method-assign]
        AxisCompensation.revision_time = revision_time  # type: ignore[method-assign]


def settling(error: float, update: bool, seed: int) -> F64:
    """Of every axis and macro-move that went far, to ±200 nm [s]."""
    machine = load_machine(None)
    recipe = load_recipe(RECIPE, machine)
    with wrong_by(error, update):
        summary = run(Case("", Mode.ESTIMATED), recipe, machine, seed)
    moves = [m for m in summary["moves"] if m["kind"] == "macro"]
    return np.array([m["settling"]["2e-07"] for m in moves if abs(m["distance"]) > FAR])


def main() -> None:
    """Run and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=12)
    parser.add_argument("--error", type=float, default=0.2)
    arguments = parser.parse_args()
    print(
        f"seeds 1..{arguments.seeds}; {machine_facts()}\n\n"
        "| host's figures | macro-moves | to ±200 nm without, median (mean), ms | with "
        "| with over without, median (mean) |\n| --- | --- | --- | --- | --- |"
    )
    for sign, word in ((-1.0, "too low"), (1.0, "too high")):
        without, with_it = (
            np.concatenate(
                [
                    settling(sign * arguments.error, update, seed)
                    for seed in range(1, arguments.seeds + 1)
                ]
            )
            * 1e3
            for update in (False, True)
        )
        print(
            f"| {arguments.error:.0%} {word} | {len(without)} "
            f"| {np.median(without):.1f} ({without.mean():.1f}) "
            f"| {np.median(with_it):.1f} ({with_it.mean():.1f}) "
            f"| {np.median(with_it) / np.median(without):.2f} "
            f"({with_it.mean() / without.mean():.2f}) |",
            flush=True,
        )
    print(f"| wanted | | | | ≤ {DEMAND} (median) |")


if __name__ == "__main__":
    main()
