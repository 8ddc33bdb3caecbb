"""Settling with and without the observer, on stages that are not as modelled.

    python benchmarks/observer.py [--seeds 4] [--case NAME ...]

Whole runs of the recipe inspection-20 on the virtual stage, through `stagectl.run.execute`, from
half of the machine file's friction figures; moves from the fourth site on, both axes together,
settling to 50 nm. The host's machine file is wafer-xy; the true stage is

- `as modelled`: the same;
- `figures off`: Coulomb force, viscous friction, stiffness and attraction deviate by -40 to +60 %,
  drawn for each seed and axis;
- `two effects`: 1.2 N cogging on x, 1 N cable hysteresis on y;
- `noisy encoder`: 20 nm rms instead of 1 nm;
- `no presliding`: friction law `coulomb`;
- an effect of the library (`stagectl effects`) on both axes, in the middle of its usual range
  (of what is above, where it includes no effect at all).

Columns: friction estimated and the observer off; estimated and on; friction by the file, on. `ok`
says whether what is demanded of the second is reached, and that it is no worse than the third.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np
from machine_facts import machine_facts
from run_figures import RECIPE
from settling import FIRST_SITE, drawn, of_law

from hil_sim.effects import Effect as Known
from hil_sim.effects.library import library
from hil_sim.settings import AxisSettings
from stagectl.config.machine import Effect, Machine
from stagectl.config.machine_file import load_machine
from stagectl.config.package_settings import stage_settings
from stagectl.recipe import Recipe, load_recipe
from stagectl.run import Listener, RunRequest, execute
from stagectl.sequencer import Mode

KINDS = ("micro", "macro")
Truth = Callable[[int], Machine]
"""The stage of a seed."""


class Demand(NamedTuple):
    """Settling to 50 nm [ms]; None: no worse than without the observer."""

    micro_mean: float | None
    micro_p90: float | None = None
    macro_mean: float | None = None
    macro_p90: float | None = None


AS_MODELLED, FIGURES_OFF = Demand(2, 10, 8, 16), Demand(3, 12, 9, 16)
TWO_EFFECTS, SLOW, FAST = Demand(15, 25, 22, 40), Demand(18, 30, 25, 60), Demand(16, 20, 30, 40)
NO_WORSE = Demand(None)
DEMANDS = {
    "current_bandwidth": FAST,
    "dead_time": FAST,
    "resonance": FAST,
    "base_motion": NO_WORSE,
    "floor_vibration": NO_WORSE,
    "force_saturation": NO_WORSE,
    "cross_coupling": NO_WORSE,  # acts until the other axis has arrived
}
"""Of effects; `SLOW` of all others."""
MARGIN = 1.0
"""`no worse`: by more than this [ms]."""


class Settling(NamedTuple):
    """Mean and 90th percentile [ms] of both kinds of moves."""

    micro_mean: float
    micro_p90: float
    macro_mean: float
    macro_p90: float


def with_effects(machine: Machine, effects: Mapping[str, tuple[Effect, ...]]) -> Machine:
    """The machine with these effects on its axes."""
    axes = {
        name: axis.model_copy(update={"effects": effects.get(name, ())})
        for name, axis in machine.axes.items()
    }
    return machine.model_copy(update={"axes": axes})


def with_noise(machine: Machine, noise: float) -> Machine:
    """The machine with this noise of its encoders [m rms]."""
    axes = {}
    for name, axis in machine.axes.items():
        encoder = axis.encoder.model_copy(update={"noise": noise})
        axes[name] = axis.model_copy(update={"encoder": encoder})
    return machine.model_copy(update={"axes": axes})


def middle(effect: Known, axis: AxisSettings) -> Effect:
    """An effect in the middle of its usual range on this axis.

    With positive sign; where no effect at all is within the range, in the middle of what is above.
    """
    values = {}
    for parameter in effect.parameters:
        low, high = parameter.ranges(axis)[-1]
        neutral = parameter.neutral_on(axis)
        if neutral is not None and low < neutral < high:
            low = neutral
        value = (low * high) ** 0.5 if parameter.log and low > 0.0 else 0.5 * (low + high)
        values[parameter.key] = value
    return Effect(effect.name, values)


def cases(machine: Machine) -> dict[str, tuple[Truth, Demand]]:
    """The true stage and what is demanded on it, by name."""
    two = with_effects(
        machine,
        {
            "x": (Effect("cogging", {"amplitude": 1.2, "pitch": 0.032, "phase": 0.5}),),
            "y": (Effect("cable_hysteresis", {"force": 1.0, "stiffness": 2500.0}),),
        },
    )
    found: dict[str, tuple[Truth, Demand]] = {
        "as modelled": (lambda _: machine, AS_MODELLED),
        "figures off": (lambda seed: drawn(machine, seed), FIGURES_OFF),
        "two effects": (lambda _: two, TWO_EFFECTS),
        "noisy encoder": (lambda _: with_noise(machine, 20e-9), NO_WORSE),
        "no presliding": (lambda _: of_law(machine, "coulomb"), NO_WORSE),
    }
    settings = dict(zip(machine.axes, stage_settings(machine).axes, strict=True))
    for name, effect in library().items():
        stage = with_effects(
            machine, {axis: (middle(effect, own),) for axis, own in settings.items()}
        )
        found[name] = (lambda _, stage=stage: stage, DEMANDS.get(name, SLOW))
    return found


def settling(
    recipe: Recipe, machine: Machine, truth: Truth, mode: Mode, observer: bool, seeds: int
) -> Settling:
    """Settling over all seeds."""
    times: dict[str, list[float]] = {kind: [] for kind in KINDS}
    for seed in range(1, seeds + 1):
        with tempfile.TemporaryDirectory() as folder:
            request = RunRequest(
                recipe=recipe,
                machine=machine,
                truth=truth(seed),
                bus=None,
                mode=mode,
                friction_scale=0.5,
                seed=seed,
                folder=Path(folder),
                started=datetime.now(UTC),
                observer=observer,
            )
            result = execute(request, Listener())
        if result.error is not None:
            raise result.error
        for move in result.summary["moves"]:
            if move["kind"] in times and move["site"] >= FIRST_SITE:
                times[move["kind"]].append(move["settling"]["5e-08"] * 1e3)
    figures = []
    for kind in KINDS:
        figures += [float(np.mean(times[kind])), float(np.quantile(times[kind], 0.9))]
    return Settling(*figures)


def verdict(demand: Demand, off: Settling, on: Settling, model: Settling) -> str:
    """`ok`, or what is not reached."""
    most = tuple(off) if demand.micro_mean is None else tuple(demand)
    slack = MARGIN if demand.micro_mean is None else 0.0
    missed = [
        name.replace("_", " ")
        for name, value, limit in zip(Settling._fields, on, most, strict=True)
        if limit is not None and value > limit + slack
    ]
    if on.micro_mean > model.micro_mean + MARGIN or on.macro_mean > model.macro_mean + MARGIN:
        missed.append("worse than model")
    return ", ".join(missed) or "ok"


def main() -> None:
    """Run and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=4, help="runs per case [4]")
    parser.add_argument("--case", action="append", help="only this one (repeatable)")
    arguments = parser.parse_args()
    machine = load_machine(None)
    recipe = load_recipe(RECIPE, machine)
    print(
        f"seeds 1..{arguments.seeds}; {machine_facts()}\n\n"
        "| true stage | estimated, observer off: micro, macro | estimated, on | model, on | |\n"
        "| --- | --- | --- | --- | --- |"
    )
    for name, (truth, demand) in cases(machine).items():
        if arguments.case and name not in arguments.case:
            continue
        off, on, model = (
            settling(recipe, machine, truth, mode, observer, arguments.seeds)
            for mode, observer in (
                (Mode.ESTIMATED, False),
                (Mode.ESTIMATED, True),
                (Mode.MODEL, True),
            )
        )
        cells = [
            f"{s.micro_mean:.1f} ({s.micro_p90:.0f}), {s.macro_mean:.1f} ({s.macro_p90:.0f})"
            for s in (off, on, model)
        ]
        print(f"| {name} | " + " | ".join([*cells, verdict(demand, off, on, model)]) + " |",
              flush=True)  # fmt: skip
    print("\nSettling to ±50 nm in ms: mean (90th percentile).")


if __name__ == "__main__":
    main()
