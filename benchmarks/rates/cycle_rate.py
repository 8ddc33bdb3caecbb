"""Cost of a SYNC cycle on the lock-step bus, compared with simulating the same motion.

    python -m benchmarks.rates.cycle_rate [--rounds 7]

One cycle: two RPDOs, SYNC, one step of the two-axis plant, two TPDOs, decoded. The reference is
`hil_sim.plant.simulate`, the same plant without CAN, measured in the same rounds. What the
watchdog costs is the difference to observers that are out, which it no longer watches. It is
processor time: on a busy machine the ratios hold, the microseconds do not. Exit code 1 where a
ratio or the watchdog's cost is above its limit.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.shared.machine_facts import machine_facts
from drivers.stage import Stage
from estimation.observer import StageObserver
from estimation.observer.watch import OUT
from hil_sim.bus import World
from hil_sim.plant import simulate
from hil_sim.stage import VirtualStage
from stagectl.config.machine import Machine
from stagectl.config.machine.file import load_machine
from stagectl.config.settings.observer import design_observers, make_observer
from stagectl.config.settings.package_settings import driver_settings, stage_settings
from stagectl.sequencer import ObservedOffsets
from stagectl.store import AxisScaling, BusLog, Journal, JournalHeader

CYCLES = 4000
STROKE = 0.01
"""Both axes go out by this much and come back [m]."""

STREAM, WITH_LOG = "`Stage.stream`, lock-step bus", "the same with bus log"
OBSERVED, UNWATCHED = "the same with the observer", "the same, without its watchdog"
LIMITS = {STREAM: 6.0, WITH_LOG: 7.0}
"""Times the plant alone."""
WATCHDOG = 5e-6
"""Most that the watchdog may cost per SYNC [s]."""

F64 = NDArray[np.float64]


def there_and_back(start: tuple[float, ...], period: float) -> F64:
    """Demand [m] that ends where it began, shape (CYCLES, axes)."""
    phase = 2.0 * np.pi * np.arange(1, CYCLES + 1) / CYCLES
    motion: F64 = np.asarray(start) + STROKE / 2.0 * (1.0 - np.cos(phase))[:, None]
    return np.round(motion, 9)


def open_stage(stack: ExitStack, machine: Machine, name: str, log: BusLog | None) -> Stage:
    """A virtual stage of its own, homed and enabled."""
    world = World(name)
    VirtualStage(stage_settings(machine), seed=1).attach(world)
    bus, axes = driver_settings(machine)
    bus = replace(bus, interface="lockstep", channel=name)
    stage = stack.enter_context(Stage.open(bus, axes, tap=log))
    stage.boot()
    stage.home()
    stage.enable()
    return stage


def journal_of(stage: Stage, folder: Path) -> Journal:
    """A journal for the samples of this stage."""
    settings = [axis.settings for axis in stage.axes]
    scaling = tuple(AxisScaling(s.name, s.increment, s.rated_force / 1000) for s in settings)
    return Journal(folder, JournalHeader("", "", "", scaling))


def streaming(stage: Stage, period: float) -> Callable[[], object]:
    """What streams the motion once."""
    demand = there_and_back(stage.targets, period)
    offset = np.tile(stage.offsets, (CYCLES, 1))
    return lambda: stage.stream(demand, offset)


def observed_stage(stack: ExitStack, machine: Machine, name: str, watched: bool) -> Stage:
    """A stage whose offsets are corrected."""
    stage = open_stage(stack, machine, name, None)
    peaks = [axis.settings.peak_force for axis in stage.axes]
    observer: StageObserver = make_observer(machine, design_observers(machine), peaks)
    if not watched:
        observer._state.watched["mode"] = OUT  # noqa: SLF001  nothing else leaves the watchdog out
    stage.correct_offsets(ObservedOffsets(observer))
    return stage


def main() -> None:
    """Measure in turn, print medians and ratios."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=7, help="measurements of each [7]")
    rounds = parser.parse_args().rounds
    machine = load_machine(None)
    settings = stage_settings(machine)
    period = machine.bus.sync_period
    demand = there_and_back((0.0, 0.0), period)
    offset = np.zeros_like(demand)
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        log = stack.enter_context(BusLog(folder / "bus.asc", datetime.now(UTC)))
        journaled = open_stage(stack, machine, "rate-journal", None)
        journaled.sink = stack.enter_context(journal_of(journaled, folder)).sink
        observed = observed_stage(stack, machine, "rate-observed", watched=True)
        unwatched = observed_stage(stack, machine, "rate-unwatched", watched=False)
        subjects = {
            "plant alone (`simulate`)": lambda: simulate(settings, demand, offset, 1),
            STREAM: streaming(open_stage(stack, machine, "rate", None), period),
            OBSERVED: streaming(observed, period),
            UNWATCHED: streaming(unwatched, period),
            WITH_LOG: streaming(open_stage(stack, machine, "rate-log", log), period),
            "the same with journal": streaming(journaled, period),
        }
        for subject in subjects.values():
            subject()  # compiles
        spent: dict[str, list[float]] = {name: [] for name in subjects}
        for _ in range(rounds):
            for name, subject in subjects.items():
                begin = time.process_time()
                subject()
                spent[name].append((time.process_time() - begin) / CYCLES)
    first = np.array(next(iter(spent.values())))
    print(f"{CYCLES} cycles of {period * 1e3:g} ms, {rounds} rounds; {machine_facts()}\n")
    print("| per SYNC cycle, two axes | µs, median | times the plant alone | times real time |")
    print("| --- | --- | --- | --- |")
    missed = []
    for name, values in spent.items():
        cost = float(np.median(values))
        ratio = float(np.median(np.array(values) / first))
        print(f"| {name} | {cost * 1e6:.1f} | {ratio:.1f} | {period / cost:.0f} |")
        if ratio > LIMITS.get(name, np.inf):
            missed.append(f"missed: {name}: {ratio:.2f}, must be at most {LIMITS[name]}")
    watchdog = float(np.median(np.subtract(spent[OBSERVED], spent[UNWATCHED])))
    print(f"\nThe watchdog costs {watchdog * 1e6:.1f} µs per SYNC.")
    if watchdog > WATCHDOG:
        missed.append(f"missed: watchdog, must cost at most {WATCHDOG * 1e6:g} µs")
    print(*missed, sep="\n")
    sys.exit(bool(missed))


if __name__ == "__main__":
    main()
