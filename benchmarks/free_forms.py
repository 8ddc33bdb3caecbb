"""How well friction over position and hysteresis over travel are recognised in any shape.

Stages are drawn as in the blind check. A friction profile and a hysteresis of any shape are fitted
to the residual force in motion (`sim2real.attribution.residual_force`); the share that each
predicts on held-out strokes should be near 1 for its own kind, and far below a half for all others.

    python benchmarks/free_forms.py [--trials 110] [--seed 4100]
"""

from __future__ import annotations

import argparse
import os
from collections import defaultdict

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from hil_sim.effects.library import library
from sim2real.attribution import fit_friction_profile, fit_travel_hysteresis
from sim2real.blind import Setup, draw_trial
from sim2real.diagnosis import examine
from stagectl.config.machine_file import load_machine
from stagectl.config.package_settings import stage_settings

KINDS = {"friction_position": "friction over position", "cable_hysteresis": "hysteresis"}


def main() -> None:
    """Draw stages and print the shares by what there is."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--trials", type=int, default=110)
    parser.add_argument("--seed", type=int, default=4100)
    options = parser.parse_args()
    machine = load_machine()
    settings = stage_settings(machine)
    tolerance = {name: axis.plant.tolerance for name, axis in machine.axes.items()}
    setup = Setup(
        seed=options.seed, settings=settings, tolerance=tolerance, library=library(),
        machine=machine.text, jobs=1,
    )  # fmt: skip
    found: dict[str, list[tuple[float, float, str]]] = defaultdict(list)
    for number in range(options.trials):
        trial = draw_trial(setup, number)
        if not trial.key.effects:
            continue
        measured = examine([trial.first], settings).measured
        for axis in {drawn.axis for drawn in trial.key.effects}:
            there = [drawn for drawn in trial.key.effects if drawn.axis == axis]
            kinds = [KINDS[drawn.kin] for drawn in there if drawn.kin in KINDS]
            shares = (
                fit_friction_profile(axis, {}, measured, settings).share,
                fit_travel_hysteresis(axis, {}, measured, settings).share,
            )
            names = " and ".join(drawn.effect for drawn in there)
            found[" and ".join(kinds) or "neither"].append((*shares, names))
    print(f"{options.trials} stages, seed {options.seed}: predicted share, and whose\n")
    print("| the stage has | axes | friction over position | hysteresis |")
    print("| --- | --- | --- | --- |")
    for kind, shares in sorted(found.items()):
        spans = []
        for index in range(2):
            low, high = min(shares, key=lambda s: s[index]), max(shares, key=lambda s: s[index])
            spans.append(f"{low[index]:.2f} ({low[2]}) to {high[index]:.2f} ({high[2]})")
        print(f"| {kind} | {len(shares)} | {spans[0]} | {spans[1]} |")


if __name__ == "__main__":
    main()
