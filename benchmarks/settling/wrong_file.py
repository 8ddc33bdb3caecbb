"""What the observer makes of stages that contradict their machine file, with and without it.

    python -m benchmarks.settling.wrong_file [--seed 1] [--row NAME ...] [--dwell 30] [--verbose]

The host's machine file is wafer-xy throughout; `rows` are the true stages, on both axes. Whole runs
on the virtual stage through `stagectl.run.execute`, friction estimated: inspection-20, a dwell, and
slow moves of both axes. Per row, worse axis, without the observer ("off"), with the one measured
before the stage became what it is ("file": on a stage as the file says), and with the one measured
on the true stage ("truth"):

- error and force at a constant 2, 10 and 50 mm/s, from 0.3 s after the acceleration on: rms [nm],
  and rms about the mean [N]. A position that is sampled late is compared with the demand of then;
- settling to 50 nm of micro- and macro-moves of inspection-20, mean [ms];
- at rest: rms of error [nm] and of the force about its mean [N], over the last three quarters of
  the dwell.

Below the table: what exceeds 1.3 times the error without the observer or 1.1 times its settling by
more than 3 ms; with --verbose also the forces, and when the watchdog took the observer out.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from benchmarks.settling.observer import with_effects
from benchmarks.shared.inspection_runs import FIRST_SITE, RECIPE, Case, run_whole
from benchmarks.shared.machine_facts import machine_facts
from benchmarks.shared.other_stages import with_gains
from stagectl.config.machine import Axis, Effect, Machine, Quirks
from stagectl.config.machine.file import load_machine
from stagectl.recipe import load_recipe, parse_recipe
from stagectl.run import RunResult
from stagectl.sequencer import Mode
from stagedata import AxisSignals

SPEEDS = (2e-3, 10e-3, 50e-3)
"""[m/s]"""
ERROR, SETTLING, SLACK = 1.3, 1.1, 3.0
"""Most that is allowed: times the error without the observer; times its settling, plus ms."""
_ARRIVED = 0.3
"""After so long at a constant speed the acceleration counts as forgotten [s]."""


def with_axes(machine: Machine, change: Callable[[Axis], Axis]) -> Machine:
    """The machine with every axis changed."""
    axes = {name: change(axis) for name, axis in machine.axes.items()}
    return machine.model_copy(update={"axes": axes})


def with_quirks(machine: Machine, **quirks: Any) -> Machine:
    """The machine with odd drives."""
    odd = Quirks(**quirks)
    return with_axes(
        machine,
        lambda axis: axis.model_copy(
            update={"drive": axis.drive.model_copy(update={"quirks": odd})}
        ),
    )


def with_effect(machine: Machine, name: str, **values: float) -> Machine:
    """The machine with an effect on every axis."""
    effect = Effect(name, values)
    return with_effects(machine, dict.fromkeys(machine.axes, (effect,)))


def with_mass(machine: Machine, factor: float) -> Machine:
    """The machine with another moved mass."""

    def heavier(axis: Axis) -> Axis:
        plant = axis.plant.model_copy(update={"mass": factor * axis.plant.mass})
        return axis.model_copy(update={"plant": plant})

    return with_axes(machine, heavier)


def on_load(machine: Machine) -> Machine:
    """The machine with its encoders on what swings."""
    return with_axes(
        machine,
        lambda axis: axis.model_copy(
            update={"encoder": axis.encoder.model_copy(update={"on_load": True})}
        ),
    )


def rows(machine: Machine) -> dict[str, Machine]:
    """The true stages, by name."""
    ringing = {"damping": 0.01, "mass_ratio": 0.2}
    gains = {"kp": 0.5, "ki": 0.5, "kd": 0.5}
    return {
        "as the file says": machine,
        "drive gains x 0.5": with_gains(machine, gains),
        "drive gains x 0.7": with_gains(machine, dict.fromkeys(gains, 0.7)),
        "resonance 250 Hz": with_effect(machine, "resonance", frequency=250.0, **ringing),
        "not collocated, 400 Hz": on_load(
            with_effect(machine, "resonance", frequency=400.0, **ringing)
        ),
        "dead time 1.5 ms": with_effect(machine, "dead_time", delay=1.5e-3),
        "offset 3 SYNCs late": with_quirks(machine, offset_delay=3),
        "offset 4 SYNCs late": with_quirks(machine, offset_delay=4),
        "offset 5 SYNCs late": with_quirks(machine, offset_delay=5),
        "offset of the wrong sign": with_quirks(machine, offset_sign=-1),
        "offset in steps of 1 %": with_quirks(machine, offset_step=0.01),
        "offset in steps of 2.5 %": with_quirks(machine, offset_step=0.025),
        "mass x 2": with_mass(machine, 2.0),
        "force constant x 0.5": with_effect(machine, "force_constant", ratio=0.5),
        "position 1 SYNC old": with_quirks(machine, position_delay=1),
        "position filtered, 0.3 ms": with_quirks(machine, position_filter=0.3e-3),
        "1.2 N of cogging": with_effect(machine, "cogging", amplitude=1.2, pitch=0.032, phase=0.5),
    }


class Figures(NamedTuple):
    """Of a row, the observer on or off; the worse axis.

    Attributes:
        errors, forces: at each of `SPEEDS` [nm, N].
        settling: of micro- and macro-moves [ms].
        rest: error and force [nm, N].
        out: notes on the observer in any run.
    """

    errors: tuple[float, ...]
    forces: tuple[float, ...]
    settling: tuple[float, float]
    rest: tuple[float, float]
    out: tuple[str, ...]


def measure(
    host: Machine, truth: Machine, measured: Machine | None, seed: int, dwell: float
) -> Figures:
    """The figures of a stage; `measured`: on which the observer's measurement was made, if any."""
    case = Case("", Mode.ESTIMATED, observer=measured is not None, measured=measured)
    out: list[str] = []

    def result(recipe: str, name: str) -> RunResult:
        done = run_whole(case, parse_recipe(recipe, name, host), host, seed, truth)
        out.extend(_notes(done))
        return done

    errors, forces = [], []
    for speed in SPEEDS:
        found = [
            at_constant_speed(signals, speed, axis, host.bus.sync_period)
            for signals, axis in _signals(result(slow_moves(speed), "slow"), truth)
        ]
        errors.append(max(error for error, _ in found))
        forces.append(max(force for _, force in found))
    stays = result(rest(dwell), "rest")
    still = [at_rest(signals, dwell, host.bus.sync_period) for signals, _ in _signals(stays, truth)]
    whole = run_whole(case, load_recipe(RECIPE, host), host, seed, truth)
    out.extend(_notes(whole))
    settling = tuple(
        float(np.mean([
            move["settling"]["5e-08"] * 1e3
            for move in whole.summary["moves"]
            if move["kind"] == kind and move["site"] >= FIRST_SITE
        ]))
        for kind in ("micro", "macro")
    )  # fmt: skip
    return Figures(
        tuple(errors), tuple(forces), (settling[0], settling[1]),
        (max(error for error, _ in still), max(force for _, force in still)),
        tuple(out),
    )  # fmt: skip


def slow_moves(speed: float) -> str:
    """A recipe: forth and back, 1 s each at a constant speed [m/s]."""
    way = speed + 2e-3
    return (
        f"recipe: slow\nmacro: {{velocity: {speed}, acceleration: 0.5, jerk: 50}}\n"
        "micro: {velocity: 0.01, acceleration: 0.2, jerk: 20.0}\n"
        "settle: {window: 5.0e-8, hold: 0.005, timeout: 0.15}\n"
        f"moves: [{{to: [{way}, {way}]}}, {{to: [0, 0]}}, {{to: [{way}, {way}]}}]\n"
    )


def rest(dwell: float) -> str:
    """A recipe: a short way, a micro-move, a rest of this duration [s]."""
    return (
        "recipe: rest\nmacro: {velocity: 0.5, acceleration: 3.0, jerk: 200.0}\n"
        "micro: {velocity: 0.01, acceleration: 0.2, jerk: 20.0}\n"
        "settle: {window: 5.0e-8, hold: 0.005, timeout: 0.15}\n"
        "moves: [{to: [0.01, 0.01]}, {dwell: 0.1}, {to: [0.01005, 0.01005], kind: micro}, "
        f"{{dwell: {dwell}}}]\n"
    )


def _signals(result: RunResult, truth: Machine) -> list[tuple[AxisSignals, Axis]]:
    assert result.recording is not None
    return [(own, truth.axes[name]) for name, own in result.recording.axes.items()]


def _notes(result: RunResult) -> list[str]:
    events = result.summary.get("watchdog", [])
    return [f"{e['axis']} at {e['time']:.2f} s: {e['text']}" for e in events]


def at_constant_speed(
    signals: AxisSignals, speed: float, axis: Axis, period: float
) -> tuple[float, float]:
    """Rms error [nm] and rms force about its mean [N]."""
    quirks = axis.drive.quirks
    late = axis.drive.control_period
    if quirks is not None:
        late -= quirks.position_delay * period + quirks.position_filter
    demand = np.concatenate((signals.position_demand[:1], signals.position_demand[:-1]))
    step = np.diff(signals.position_demand, prepend=signals.position_demand[0])
    error = signals.position_actual - demand - step / period * late
    constant = np.abs(np.abs(step) - speed * period) < 1.5e-9
    squares, variances = [], []
    for begin, end in _stretches(constant):
        begin += round(_ARRIVED / period)
        if end - begin > round(0.2 / period):
            squares.append(np.mean(error[begin:end] ** 2))
            variances.append(np.var(signals.force_actual[begin:end]))
    return math.sqrt(np.mean(squares)) * 1e9, math.sqrt(np.mean(variances))


def _stretches(flags: np.ndarray) -> list[tuple[int, int]]:
    edges = np.diff(np.concatenate(([0], flags.astype(np.int8), [0])))
    return list(
        zip(np.nonzero(edges > 0)[0].tolist(), np.nonzero(edges < 0)[0].tolist(), strict=True)
    )


def at_rest(signals: AxisSignals, dwell: float, period: float) -> tuple[float, float]:
    """Rms error [nm] and force about its mean [N] over the last three quarters of a dwell [s]."""
    last = slice(-round(0.75 * dwell / period), None)
    error = signals.position_actual[last] - signals.position_demand[last]
    return math.sqrt(np.mean(error**2)) * 1e9, float(np.std(signals.force_actual[last]))


def missed(off: Figures, on: Figures) -> str:
    """What is worse with the observer than allowed; empty where nothing is."""
    found = [
        f"{speed * 1e3:g} mm/s"
        for speed, without, having in zip(SPEEDS, off.errors, on.errors, strict=True)
        if having > ERROR * without
    ]
    for kind, without, having in zip(("micro", "macro"), off.settling, on.settling, strict=True):
        if having > SETTLING * without + SLACK:
            found.append(kind)
    return ", ".join(found)


def line(figures: Figures) -> str:
    """As columns of the table."""
    moving = ", ".join(f"{error:.0f}" for error in figures.errors)
    micro, macro = figures.settling
    return f"{moving} | {micro:.1f}, {macro:.1f} | {figures.rest[0]:.0f}"


def forces(figures: Figures) -> str:
    """In words."""
    moving = ", ".join(f"{force:.2f}" for force in figures.forces)
    return f"force {moving} N at 2, 10, 50 mm/s, {figures.rest[1]:.2f} N at rest"


def main() -> None:
    """Run and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seed", type=int, default=1, help="of noise and start [1]")
    parser.add_argument("--row", action="append", help="only this one (repeatable)")
    parser.add_argument("--dwell", type=float, default=30.0, help="rest [s] [30]")
    parser.add_argument("--verbose", action="store_true", help="forces, and what the watchdog said")
    arguments = parser.parse_args()
    machine = load_machine(None)
    print(f"seed {arguments.seed}; {machine_facts()}\n")
    print(
        "| true stage | | error at 2, 10, 50 mm/s, nm | micro, macro to ±50 nm, ms "
        "| at rest, nm |\n| --- | --- | --- | --- | --- |"
    )
    said = []
    for name, truth in rows(machine).items():
        if arguments.row and name not in arguments.row:
            continue
        off = measure(machine, truth, None, arguments.seed, arguments.dwell)
        print(f"| {name} | off | {line(off)} |", flush=True)
        if arguments.verbose:
            said.append(f"{name}, off: {forces(off)}")
        for label, measured in (("file", machine), ("truth", truth)):
            on = measure(machine, truth, measured, arguments.seed, arguments.dwell)
            print(f"| | {label} | {line(on)} |", flush=True)
            more = missed(off, on)
            if arguments.verbose:
                said.append(f"{name}, {label}: {forces(on)}")
                said += [f"  {note}" for note in on.out]
            if more:
                said.append(f"{name}, {label}: exceeds what is allowed: {more}")
    print("", *said, sep="\n")


if __name__ == "__main__":
    main()
