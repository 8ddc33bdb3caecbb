"""Errors of `stagectl identify` in units of its own sigma, and the benefit of its ripple terms.

Simulated stages (hil_sim: wander, encoder noise, force in steps) with the machine file's figures or
others, 12 macro-moves with two micro-moves each, axis x; per figure: mean and rms of (estimate -
truth)/sigma over the seeds. Then, without noise, the residual of the sampled force under the true
model after regression on the mass, or on the setpoints' second differences.

    python -m benchmarks.estimation.identify_spread [--seeds 8] [--steps 5]

The true force has a lag, too (see `lateness`), which shrinks with more plant steps per control tick
(`--steps`); nothing else may change with them.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.shared.machine_facts import machine_facts
from estimation.friction import FrictionState, follow
from estimation.offline import Identification, Samples
from estimation.trajectory import Limits, plan
from hil_sim.effects.library import own_effects
from hil_sim.plant import simulate
from hil_sim.settings import SUBSTEPS, AxisSettings
from stagectl.calibration import identify_pieces
from stagectl.config import load_machine, stage_settings

F64 = NDArray[np.float64]
BELIEVED_MASS = 8.0
"""Of axis x, by the host [kg]."""
MACRO, MICRO = Limits(0.5, 3.0, 200.0), Limits(0.01, 0.2, 20.0)
FIGURES = (
    "coulomb", "viscous", "stiffness", "relaxation_rate", "static_ratio", "stribeck_velocity",
    "stribeck_shape", "asymmetry", "force_offset", "mass", "lag", "k_1", "k_5", "k_10", "nu_1",
    "nu_5", "nu_10",
)  # fmt: skip


def drive(
    axis: AxisSettings, seed: int | None, steps: int = SUBSTEPS, moves: int = 12
) -> tuple[Samples, F64]:
    """Closed loop, force offset believed mass times acceleration; the moves on the seed too.

    Returns:
        Samples, and the offset sent for each [N].
    """
    stage = stage_settings(load_machine())
    rng = np.random.default_rng(seed)
    at, demand, offset = 0.0, [np.zeros(100)], [np.zeros(100)]
    for number in range(3 * moves):
        macro = number % 3 == 0
        target = (
            rng.uniform(-0.04, 0.04)
            if macro
            else at + rng.choice([-1, 1]) * rng.uniform(1e-5, 8e-5)
        )
        motion = plan(at, target, MACRO if macro else MICRO)
        time = np.arange(1, int(motion.duration * 1e3) + 151) * 1e-3
        position, _, acceleration = motion.sample(time)
        demand.append(position)
        offset.append(BELIEVED_MASS * acceleration)
        at = target
    sent, force = np.concatenate(demand), np.concatenate(offset)
    response = simulate(
        replace(stage, axes=(axis,)), sent[:, None], force[:, None], seed, substeps=steps
    )
    ones = np.ones(len(sent), dtype=np.bool_)
    return Samples(response.position[:, 0], response.force[:, 0], ones, 0.0, sent), force


def lateness(axis: AxisSettings, steps: int) -> float:
    """By how much the simulated force is late [s].

    It acts one plant step before it is read. And it is read where the drive's control tick ends: of
    a command in stairs, behind the current loop's first-order lag, that is the lowest point, off
    the straight line through them.
    """
    tick, loop = axis.control.period, 0.5 / (math.pi * axis.control.current_bandwidth)
    stairs = tick / -math.expm1(-tick / loop) - tick / 2.0 - loop
    return stairs + tick / steps


def truths(axis: AxisSettings, asymmetry: float, steps: int = SUBSTEPS) -> dict[str, float]:
    """What `identify` should find on such an axis."""
    f = axis.friction
    known = {
        "coulomb": f.coulomb, "viscous": f.viscous, "stiffness": f.stiffness,
        "relaxation_rate": f.relaxation_rate, "static_ratio": f.static_ratio,
        "stribeck_velocity": f.stribeck_velocity, "stribeck_shape": f.stribeck_shape,
        "asymmetry": asymmetry, "force_offset": 0.0, "mass": axis.mass,
        "lag": lateness(axis, steps),
    }  # fmt: skip
    count = f.elements
    for i in range(1, count + 1):
        known[f"k_{i}"], known[f"nu_{i}"] = 1.0 / count, 2.0 * i / (count * (count + 1))
    return known


def away(found: Identification, truth: dict[str, float]) -> list[float]:
    """(Estimate - truth)/sigma of `FIGURES`; nan where there is no estimate."""
    if found.reason is not None:
        return [np.nan] * len(FIGURES)
    figures = [found[name] for name in FIGURES]
    return [
        (f.value - truth[f.name]) / f.sigma if f.verdict == "estimated" else np.nan for f in figures
    ]


def spread(seeds: int, steps: int) -> None:
    """The table of errors in sigma."""
    machine = load_machine()
    believed = machine.axes["x"].plant.friction.figures
    nominal = stage_settings(machine).axes[0]
    lopsided = own_effects()["friction_asymmetry"].at(ratio=0.1)
    other = replace(
        nominal,
        mass=1.07 * nominal.mass,
        effects=(lopsided,),
        friction=replace(
            nominal.friction, coulomb=7.5, viscous=28.0, stiffness=4.5e5,
            static_ratio=0.7, stribeck_velocity=3e-3,
        ),
    )  # fmt: skip
    columns = []
    for axis, asymmetry in ((nominal, 0.0), (other, 0.1)):
        truth = truths(axis, asymmetry, steps)
        rows = []
        for seed in range(1, seeds + 1):
            piece = drive(axis, seed, steps)
            found = identify_pieces([piece], machine.axes["x"], believed, machine.bus.sync_period)
            rows.append(away(found, truth))
        errors = np.array(rows)
        columns.append((np.nanmean(errors, axis=0), np.sqrt(np.nanmean(errors**2, axis=0))))
    print(
        "| (estimate - truth)/sigma | as the machine file: mean | rms | another stage: mean | rms |"
    )
    print("|" + " --- |" * 5)
    for i, name in enumerate(FIGURES):
        cells = " | ".join(f"{mean[i]:+.1f} | {rms[i]:.1f}" for mean, rms in columns)
        print(f"| {name} | {cells} |")


def ripple() -> None:
    """Rms of the force that the true model leaves, moving, without noise and wander."""
    nominal = stage_settings(load_machine()).axes[0]
    quiet = replace(nominal, noise=0.0, increment=1e-12, wander=0.0)
    samples, _ = drive(quiet, None)
    x, sent = samples.position, samples.demand
    assert sent is not None
    friction = load_machine().axes["x"].plant.friction.figures
    velocity, acceleration = (x[2:] - x[:-2]) / 2e-3, np.diff(x, 2) / 1e-6
    elements, _ = follow(friction, FrictionState.relaxed(10), x[1:-1], velocity, 1e-3, 8, 0.0)
    left = samples.force[1:-1] - elements - 20.0 * velocity - 8.0 * acceleration
    moving = np.abs(velocity) > 1e-5
    now = np.diff(sent, 2) / 1e-6
    taps = [8.0 * np.roll(now, back) for back in range(3)]
    print("\n| regressed on | residual, mN rms |\n| --- | --- |")
    for name, regressors in (
        ("nothing", []), ("acceleration (apparent mass)", [8.0 * acceleration]),
        ("acceleration and its change", [8.0 * acceleration, 8.0 * np.gradient(acceleration)]),
        ("setpoints' second difference, three taps", taps),
    ):  # fmt: skip
        rest = left[moving]
        if regressors:
            matrix = np.column_stack(regressors)[moving]
            rest = rest - matrix @ np.linalg.lstsq(matrix, rest)[0]
        print(f"| {name} | {1e3 * np.sqrt(np.mean(rest**2)):.1f} |")
    print("\nRounding of the force: 11.5 mN.")


def main() -> None:
    """Both tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--steps", type=int, default=SUBSTEPS, help="plant steps per tick [5]")
    arguments = parser.parse_args()
    print(f"{arguments.seeds} seeds; {machine_facts()}\n")
    spread(arguments.seeds, arguments.steps)
    ripple()


if __name__ == "__main__":
    main()
