"""What it is worth to know an effect: settling under each of the library, as a markdown table.

    python -m benchmarks.settling.remedies [--seeds 4] [--effects cogging,dead_time]
        [--observer] [--no-diagnosis]

Whole runs of the recipe inspection-20 on the virtual stage with estimated friction, which starts at
the machine file's figures. The stage has one effect on both axes, in the middle of its range. The
host does not know it; or has the twin that `gap diagnose --twin` makes of one ordinary run, of a
seed that is not counted; or has the effect as it is. From the fourth site on, both axes together.
With --observer all of them have the settling observer, as `stagectl run` has; else feedforward
alone.
"""

from __future__ import annotations

import argparse
import math
import os
from collections.abc import Mapping, Sequence

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from benchmarks.shared.inspection_runs import RECIPE, Case, run, run_whole
from benchmarks.shared.machine_facts import machine_facts
from hil_sim.effects import Effect, Parameter
from hil_sim.effects.library import own_effects, possible_on
from hil_sim.settings import AxisSettings
from sim2real.diagnosis import diagnose, examine
from stagectl.config.machine import Machine
from stagectl.config.machine.file import load_machine, parse_machine
from stagectl.config.machine.twin import render_twin
from stagectl.config.settings.package_settings import stage_settings
from stagectl.recipe import Recipe, load_recipe
from stagectl.sequencer import Mode

FIRST_SITE = 4
WINDOW = "5e-08"
Row = dict[str, tuple[float, float]]
"""Kind of move -> mean and 90th percentile of the settling time [ms]."""


def middle(parameter: Parameter, axis: AxisSettings) -> float:
    """Middle of the range; where there is no effect inside it, of its upper part."""
    low, high = parameter.ranges(axis)[-1]
    neutral = parameter.neutral_on(axis)
    if neutral is not None and low < neutral < high:
        low = neutral
    return math.sqrt(low * high) if parameter.log else 0.5 * (low + high)


def with_effect(machine: Machine, effect: Effect) -> Machine:
    """The machine with the effect on both axes."""
    added = {
        axis.name: [(effect.name, {p.key: middle(p, axis) for p in effect.parameters})]
        for axis in stage_settings(machine).axes
    }
    return parse_machine(render_twin(machine, added), f"with {effect.name}")


def settling(
    case: Case, machine: Machine, recipe: Recipe, truth: Machine, seeds: Sequence[int]
) -> Row:
    """Settling of a host with this machine file on this stage."""
    times: dict[str, list[float]] = {"micro": [], "macro": []}
    for seed in seeds:
        for move in run(case, recipe, machine, seed, truth)["moves"]:
            if move["site"] >= FIRST_SITE:
                times[move["kind"]].append(1e3 * move["settling"][WINDOW])
    return {k: (float(np.mean(t)), float(np.quantile(t, 0.9))) for k, t in times.items()}


def named(
    case: Case, machine: Machine, recipe: Recipe, truth: Machine, seed: int
) -> tuple[Machine, str]:
    """The twin that a diagnosis of one run writes, and the effects in it."""
    recording = run_whole(case, recipe, machine, seed, truth).recording
    assert recording is not None
    tolerance = {name: axis.plant.tolerance for name, axis in machine.axes.items()}
    examined = examine([recording], stage_settings(machine))
    found = diagnose(examined, tolerance, own_effects(), jobs=1)
    added: dict[str, list[tuple[str, Mapping[str, float]]]] = {}
    for cause in found.report.causes:
        values = {key: p.value for key, p in cause.parameters.items()}
        added.setdefault(cause.axis, []).append((cause.effect, values))
    text = render_twin(machine, added, found.plant)
    axes: dict[str, list[str]] = {}
    for axis, each in added.items():
        for name, _ in each:
            axes.setdefault(name, []).append(axis)
    causes = [name if len(on) == 2 else f"{name} ({', '.join(on)})" for name, on in axes.items()]
    return parse_machine(text, "twin"), ", ".join(causes) or "nothing"


def cells(row: Row | None) -> str:
    """Micro- and macro-moves: mean (90th percentile)."""
    if row is None:
        return "- | -"
    return " | ".join(f"{mean:.1f} ({p90:.0f})" for mean, p90 in (row["micro"], row["macro"]))


def main() -> None:
    """Run and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=4, help="runs per figure [4]")
    parser.add_argument("--effects", help="only these, separated by commas [all]")
    parser.add_argument("--observer", action="store_true", help="with the settling observer")
    parser.add_argument("--no-diagnosis", action="store_true", help="leave out the second host")
    arguments = parser.parse_args()
    case = Case("", Mode.ESTIMATED, observer=arguments.observer)
    machine = load_machine(None)
    effects = possible_on(stage_settings(machine).axes[0], own_effects())
    names = arguments.effects.split(",") if arguments.effects else list(effects)
    recipe, seeds = load_recipe(RECIPE, machine), range(1, arguments.seeds + 1)
    print(
        f"seeds 1..{arguments.seeds}; settling to ±50 nm, mean (90th percentile), ms; "
        f"{machine_facts()}\n\n"
        "| effect on both axes | unknown: micro | macro | named by a diagnosis: micro | macro "
        "| known: micro | macro | named |\n| --- | --- | --- | --- | --- | --- | --- | --- |"
    )
    none = settling(case, machine, recipe, machine, seeds)
    print(f"| none | {cells(none)} | {cells(None)} | {cells(None)} | |", flush=True)
    for name in names:
        truth = with_effect(machine, effects[name])
        unknown = settling(case, machine, recipe, truth, seeds)
        twin, causes, diagnosed = None, "", None
        if not arguments.no_diagnosis:
            twin, causes = named(case, machine, recipe, truth, seeds[-1] + 1)
            diagnosed = settling(case, twin, recipe, truth, seeds)
        known = settling(case, truth, recipe, truth, seeds)
        left = "" if effects[name].compensation.inverse else " (not compensated)"
        print(
            f"| {name}{left} | {cells(unknown)} | {cells(diagnosed)} | {cells(known)} | {causes} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
