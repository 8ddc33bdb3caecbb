"""What `stagectl observer --measure` finds of drawn stages that contradict their machine file.

    python -m benchmarks.settling.measurement [--stages 20] [--first 1]

The host's machine file is wafer-xy. Drawn for each stage, the same for both axes: drive gains,
mass, force constant, friction; an offset that acts late or the other way; a position that is old;
dead time; a resonance, the encoder on the carriage or on the load. In brackets: what is true. Gain
margins of one observer: by the measurement that it was designed by, and by that of another seed.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

from benchmarks.settling.observer import with_effects
from benchmarks.settling.wrong_file import on_load, with_axes, with_quirks
from benchmarks.shared.machine_facts import machine_facts
from benchmarks.shared.other_stages import with_gains
from estimation.observer import Design, MeasuredLoop
from stagectl.config.machine import Axis, Effect, Machine
from stagectl.config.machine.file import load_machine
from stagectl.config.settings.observer import clocking, design_observers
from stagectl.errors import RunFault
from stagectl.measurement import Measurement, find_contradictions, measure_simulated


def drawn(machine: Machine, number: int) -> tuple[Machine, dict[str, float]]:
    """A stage, and what is true of it."""
    rng = np.random.default_rng(number)
    gains, mass = rng.uniform(0.6, 1.4), rng.uniform(0.6, 1.8)
    friction = 2.0 ** rng.uniform(-1.0, 1.0)
    constant = rng.choice([1.0, rng.uniform(0.7, 1.3)])
    late, old = int(rng.choice([0, 0, 1, 2, 3])), int(rng.choice([0, 0, 0, 1]))
    sign = int(rng.choice([1, 1, 1, 1, -1]))
    dead = float(rng.choice([0.0, 0.0, rng.uniform(1e-4, 5e-4)]))
    frequency = float(rng.choice([0.0, rng.uniform(60.0, 390.0)]))
    ratio, damping = rng.uniform(0.03, 0.3), rng.uniform(0.003, 0.03)
    effects = []
    if constant != 1.0:
        effects.append(Effect("force_constant", {"ratio": constant}))
    if dead:
        effects.append(Effect("dead_time", {"delay": dead}))
    if frequency:
        shape = {"frequency": frequency, "damping": damping, "mass_ratio": ratio}
        effects.append(Effect("resonance", shape))
    stage = with_gains(machine, dict.fromkeys(("kp", "ki", "kd"), gains))

    def changed(axis: Axis) -> Axis:
        own = axis.plant.friction
        more = own.model_copy(
            update={
                name: getattr(own, name) * friction
                for name in ("coulomb", "stiffness", "attraction", "viscous")
            }
        )
        plant = axis.plant.model_copy(update={"mass": axis.plant.mass * mass, "friction": more})
        return axis.model_copy(update={"plant": plant})

    stage = with_axes(stage, changed)
    stage = with_quirks(stage, offset_delay=late, position_delay=old, offset_sign=sign)
    stage = with_effects(stage, dict.fromkeys(machine.axes, tuple(effects)))
    if frequency and rng.random() < 0.3:
        stage = on_load(stage)
    true = {
        "late": late * 1e-3, "old": old * 1e-3, "sign": sign, "dead": dead,
        "force": mass / constant, "gains": gains, "frequency": frequency,
    }  # fmt: skip
    return stage, true


def margins(
    machine: Machine, measured: Measurement, again: Measurement
) -> dict[str, tuple[float, float] | None]:
    """Gain margin of each axis' observer by the measurement that designed it, and by another.

    None without an observer.
    """
    designs = design_observers(
        machine, None, {name: axis.response for name, axis in measured.axes.items()}
    )
    found: dict[str, tuple[float, float] | None] = dict.fromkeys(designs)
    for name, axis in machine.axes.items():
        own = designs[name]
        if not isinstance(own, Design) or own.margins is None:
            continue
        loop = MeasuredLoop(
            again.axes[name].response, clocking(axis.drive, machine.bus.sync_period)
        )
        other = replace(own, figures=replace(own.figures, measured=loop)).margins
        assert other is not None
        found[name] = own.margins.gain, other.gain
    return found


def main() -> None:
    """Run and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--stages", type=int, default=20, help="[20]")
    parser.add_argument("--first", type=int, default=1, help="number of the first [1]")
    arguments = parser.parse_args()
    machine = load_machine(None)
    period = machine.bus.sync_period
    print(f"{machine_facts()}\n")
    print(
        "| stage | axis | late, ms | position age, ms | sign | dead time, ms | force per "
        "acceleration | kp | resonance, Hz | gain margin, two measurements |\n"
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |"
    )
    for number in range(arguments.first, arguments.first + arguments.stages):
        stage, true = drawn(machine, number)
        try:
            measured = measure_simulated(machine, stage, 1)
            margin = margins(machine, measured, measure_simulated(machine, stage, 2))
        except RunFault as fault:
            print(f"| {number} | not measured: {fault} |", flush=True)
            continue
        for name, axis in machine.axes.items():
            found = find_contradictions(
                axis, axis.plant.friction.figures, period, measured.axes[name].response
            )
            own = found.fitted.figures
            modes = ", ".join(f"{mode.frequency:.1f}" for mode in own.resonances)
            both = ["none"] if margin[name] is None else [f"{m:.2f}" for m in margin[name] or ()]
            age = own.age + own.smoothing
            print(
                f"| {number} | {name} | {own.lateness * 1e3:.2f} ({true['late'] * 1e3:.0f}) "
                f"| {age * 1e3:.2f} ({true['old'] * 1e3:.0f}) "
                f"| {own.sign:.0f} ({true['sign']:.0f}) "
                f"| {own.dead_time * 1e3:.2f} ({true['dead'] * 1e3:.2f}) "
                f"| {own.mass / axis.plant.mass / true['force'] - 1.0:+.1%} "
                f"| {own.kp / believed_kp(axis) / true['gains'] - 1.0:+.1%} "
                f"| {modes or 'none'} ({true['frequency']:.1f}) | {', '.join(both)} |",
                flush=True,
            )


def believed_kp(axis: Axis) -> float:
    """Kp of the machine file [N/m]."""
    assert axis.drive.pid is not None
    return axis.drive.pid.kp


if __name__ == "__main__":
    main()
