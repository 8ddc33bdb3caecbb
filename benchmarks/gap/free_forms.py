"""How well friction over position is recognised in any shape.

Stages are drawn as in the blind check. A friction profile of any shape is fitted to the residual
force in motion (`sim2real.attribution.friction_profile`); the share that it predicts on held-out
strokes should be near 1 where there is one, and far below a half elsewhere.

    python -m benchmarks.gap.free_forms [--trials 110] [--seed 4100]
"""

from __future__ import annotations

import argparse
import os
from collections import defaultdict

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from hil_sim.effects.library import library
from sim2real.attribution.friction_profile import fit_friction_profile
from sim2real.blind import Setup, draw_trial
from sim2real.diagnosis import examine
from stagectl.config.machine.file import load_machine
from stagectl.config.settings.package_settings import stage_settings


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
    found: dict[bool, list[tuple[float, str]]] = defaultdict(list)
    for number in range(options.trials):
        trial = draw_trial(setup, number)
        if not trial.key.effects:
            continue
        measured = examine([trial.first], settings).measured
        for axis in {drawn.axis for drawn in trial.key.effects}:
            there = [drawn for drawn in trial.key.effects if drawn.axis == axis]
            share = fit_friction_profile(axis, {}, measured, settings).share
            names = " and ".join(drawn.effect for drawn in there)
            found[any(drawn.kin == "friction_position" for drawn in there)].append((share, names))
    print(f"{options.trials} stages, seed {options.seed}: predicted share, and whose\n")
    print("| friction over position | axes | lowest | highest |")
    print("| --- | --- | --- | --- |")
    for is_there, shares in sorted(found.items(), reverse=True):
        ends = [f"{share:.2f} ({names})" for share, names in (min(shares), max(shares))]
        print(f"| {'yes' if is_there else 'no'} | {len(shares)} | {' | '.join(ends)} |")


if __name__ == "__main__":
    main()
