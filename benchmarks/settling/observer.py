"""Settling with and without the observer, on stages that are not as modelled.

    python -m benchmarks.settling.observer [--seeds 4] [--case NAME ...] [--unlike]

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

Columns: friction estimated and the observer off; estimated and on; friction by the file (half of
it), on. `ok` says whether what is demanded of the second is reached, and that it is no worse than
the first and the third.

With `--unlike`: a bus, drive or encoder that is not what the observer believes (`unlike`), friction
estimated, the observer off and on, with peak errors. `ok`: no worse in any column.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.shared.inspection_runs import FIRST_SITE, RECIPE, measured
from benchmarks.shared.machine_facts import machine_facts
from benchmarks.shared.other_stages import drawn, of_law, with_gains
from hil_sim.effects import Effect as Known
from hil_sim.effects.library import library, possible_on
from hil_sim.settings import AxisSettings
from stagectl.config.faults import parse_faults
from stagectl.config.machine import Effect, Machine
from stagectl.config.machine.file import load_machine
from stagectl.config.settings.package_settings import stage_settings
from stagectl.recipe import load_recipe
from stagectl.run import HostSettings, Listener, RunRequest, SimulatedStage, execute
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


FAULTS = {
    "SYNC up to 20 us late": "{fault: sync_jitter, most: 20 us}",
    "1 % of SYNCs 0.1 to 0.3 ms late": (
        "{fault: delay, frame: sync, least: 100 us, most: 300 us, probability: 0.01}"
    ),
    "all SYNCs 20 us late": "{fault: delay, frame: sync, least: 20 us, most: 20 us}",
    "1 % of SYNCs do not reach x": "{fault: sync_miss, axis: x, probability: 0.01}",
    "1 % of samples lost": "{fault: drop, frame: tpdo1, probability: 0.01}",
    "1 % of samples frozen": "{fault: freeze, frame: tpdo1, probability: 0.01}",
    "1 % of setpoints lost": "{fault: drop, frame: rpdo1, probability: 0.01}",
}
GAINS = {
    "kp, ki, kd x 0.5": {"kp": 0.5, "ki": 0.5, "kd": 0.5},
    "kp, ki, kd x 1.5": {"kp": 1.5, "ki": 1.5, "kd": 1.5},
    "kp x 0.5": {"kp": 0.5},
    "kp x 1.5": {"kp": 1.5},
    "kd x 0.7": {"kd": 0.7},
    "kd x 1.5": {"kd": 1.5},
    "ki x 0.01": {"ki": 0.01},
    "ki x 3": {"ki": 3.0},
    "derivative_time x 0.1": {"derivative_time": 0.1},
    "derivative_time x 2": {"derivative_time": 2.0},
}
"""Of the drives, over those of the machine file."""
SLOWER = (2e-3, 4e-3)
"""SYNC periods [s]."""
WORSE, WORSE_PEAK = 1.05, 1.2
"""`no worse` with `--unlike`: means of settling and peak error over those without it; chance."""

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


class Stage(NamedTuple):
    """What a run meets: the host's machine file, the stage, what the bus does."""

    host: Machine
    truth: Machine
    fault: str | None = None


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
    one = next(iter(settings.values()))
    for name, effect in possible_on(one, library()).items():
        stage = with_effects(
            machine, {axis: (middle(effect, own),) for axis, own in settings.items()}
        )
        found[name] = (lambda _, stage=stage: stage, DEMANDS.get(name, SLOW))
    return found


def unlike(machine: Machine) -> dict[str, Stage]:
    """Stages that are not what the observer believes, by name."""
    found = {"as believed": Stage(machine, machine)}
    found |= {name: Stage(machine, machine, fault) for name, fault in FAULTS.items()}
    found |= {name: Stage(machine, with_gains(machine, f)) for name, f in GAINS.items()}
    noisy = with_noise(machine, 20e-9)
    found["noise of 20 nm, unknown"] = Stage(machine, noisy)
    found["noise of 20 nm, known"] = Stage(noisy, noisy)
    for period in SLOWER:
        bus = machine.bus.model_copy(update={"sync_period": period})
        slow = machine.model_copy(update={"bus": bus})
        found[f"SYNC every {period * 1e3:.0f} ms"] = Stage(slow, slow)
    return found


class Moves(NamedTuple):
    """Settling [ms] and peak error [um] of all moves of a kind."""

    settling: list[float]
    peak: list[float]


def moves(
    stage: Callable[[int], Stage], mode: Mode, observer: bool, seeds: int
) -> dict[str, Moves]:
    """The moves of all seeds, by kind."""
    found = {kind: Moves([], []) for kind in KINDS}
    for seed in range(1, seeds + 1):
        host, truth, fault = stage(seed)
        with tempfile.TemporaryDirectory() as folder:
            request = RunRequest(
                load_recipe(RECIPE, host),
                host,
                Path(folder),
                datetime.now(UTC),
                simulated=SimulatedStage(
                    truth,
                    seed,
                    None
                    if fault is None
                    else parse_faults(f"faults: [{fault}]", "fault", host, seed),
                ),
                host=HostSettings(
                    mode=mode,
                    friction_scale=0.5,
                    observer=observer,
                    measurement=measured(host, truth) if observer else None,
                ),
            )
            result = execute(request, Listener())
        if result.error is not None:
            raise result.error
        for move in result.summary["moves"]:
            if move["kind"] in found and move["site"] >= FIRST_SITE:
                found[move["kind"]].settling.append(move["settling"]["5e-08"] * 1e3)
                found[move["kind"]].peak.append(move["peak_error"] * 1e6)
    return found


def settling(machine: Machine, truth: Truth, mode: Mode, observer: bool, seeds: int) -> Settling:
    """Settling over all seeds."""
    figures = []
    for own in moves(lambda seed: Stage(machine, truth(seed)), mode, observer, seeds).values():
        figures += [float(np.mean(own.settling)), float(np.quantile(own.settling, 0.9))]
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
    for other, name in ((off, "off"), (model, "model")):
        if on.micro_mean > other.micro_mean + MARGIN or on.macro_mean > other.macro_mean + MARGIN:
            missed.append(f"worse than {name}")
    return ", ".join(missed) or "ok"


def compare_unlike(machine: Machine, seeds: int, names: list[str] | None) -> None:
    """Print the table of `--unlike`."""
    print(
        "| not as believed | off: micro, macro | on | peak error, off: micro, macro | on | |\n"
        "| --- | --- | --- | --- | --- | --- |"
    )
    for name, stage in unlike(machine).items():
        if names and name not in names:
            continue
        off, on = (
            moves(lambda _, s=stage: s, Mode.ESTIMATED, observer, seeds)  # type: ignore[misc]
            for observer in (False, True)
        )
        times, peaks, worse = [], [], []
        for own in (off, on):
            times.append(", ".join(_mean_and_high(own[kind].settling, 1, 0) for kind in KINDS))
            peaks.append(", ".join(_mean_and_high(own[kind].peak, 2, 2) for kind in KINDS))
        for kind in KINDS:
            if np.mean(on[kind].settling) > WORSE * np.mean(off[kind].settling):
                worse.append(f"{kind} settling")
            if np.mean(on[kind].peak) > WORSE_PEAK * np.mean(off[kind].peak):
                worse.append(f"{kind} peak")
        cells = [name, *times, *peaks, ", ".join(worse) or "ok"]
        print("| " + " | ".join(cells) + " |", flush=True)


def _mean_and_high(values: list[float], digits: int, high_digits: int) -> str:
    high = float(np.quantile(values, 0.9))
    return f"{np.mean(values):.{digits}f} ({high:.{high_digits}f})"


def main() -> None:
    """Run and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=4, help="runs per case [4]")
    parser.add_argument("--case", action="append", help="only this one (repeatable)")
    parser.add_argument("--unlike", action="store_true", help="the table of `unlike` instead")
    arguments = parser.parse_args()
    machine = load_machine(None)
    print(f"seeds 1..{arguments.seeds}; {machine_facts()}\n")
    if arguments.unlike:
        compare_unlike(machine, arguments.seeds, arguments.case)
        print("\nSettling to ±50 nm in ms, peak error in µm: mean (90th percentile).")
        return
    print(
        "| true stage | estimated, observer off: micro, macro | estimated, on | model, on | |\n"
        "| --- | --- | --- | --- | --- |"
    )
    for name, (truth, demand) in cases(machine).items():
        if arguments.case and name not in arguments.case:
            continue
        off, on, model = (
            settling(machine, truth, mode, observer, arguments.seeds)
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
