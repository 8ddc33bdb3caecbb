"""How many moves the estimator accepts, and how many of those accepted are wrong.

    python -m benchmarks.estimation.acceptance [--truths 10] [--effects cogging,base_motion]
        [--jobs 1]

Whole runs of the recipe inspection-20 on the virtual stage, the host at half of the machine file's
friction. Every truth draws another stage (Coulomb force, viscous friction, stiffness and attraction
off by -40 to +60 %, as in `settling.py`), and is run without effects and with each effect of the
library, its parameters drawn from their plausible ranges, on both axes. The host knows of none.

The truth that an estimate is compared with is that of the place and the time of its move's end, in
newtons as the drive measures them: Fc times what coulomb_level, friction_position, friction_spot,
friction_map and thermal_drift make of it there, sigma_v and sigma0 times theirs, and all three over
the ratio of the motor's force to the measured one (force_constant, force_ripple, torque_ripple).
With friction_asymmetry Fc is the mean of both directions: one figure serves both. Forces that are
not friction leave the figures as they are. The estimate of Fc is that in force at the move's end,
its level included; the wander of the true one (1 % rms) is unknown and counts in sigma.

The rows `mismatch_Nms` are stages without effects, but of 16 elements under a host of 10, with
another mass (5 to 15 % off, either way), 20 nm of encoder noise, SYNC every N ms, and micro-moves
of up to 10 um.

An accepted estimate is wrong if any figure that the move has changed is more than 4 sigma and more
than 3 % off. A figure that the move has not changed was judged where it was changed last.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from benchmarks.shared.inspection_runs import RECIPE
from benchmarks.shared.machine_facts import machine_facts
from benchmarks.shared.other_stages import drawn
from hil_sim.effects.effect import Effect
from hil_sim.effects.friction_map import field_factor
from hil_sim.effects.library import own_effects, possible_on
from stagectl.config.machine import Machine
from stagectl.config.machine.file import load_machine, parse_machine
from stagectl.config.machine.twin import render_twin
from stagectl.config.settings.package_settings import stage_settings
from stagectl.recipe import load_recipe
from stagectl.recipe.schema import SimulatedMark
from stagectl.run import HostSettings, Listener, RunRequest, SimulatedStage, execute
from stagectl.sequencer import FrictionUpdated

NAMES = ("coulomb", "viscous", "stiffness", "relaxation_rate")
SIGMAS, SHARE = 4.0, 0.03
"""A figure farther off than both is wrong."""
WANDER = 0.01
"""Of the true Coulomb force, rms, relative: counted in its sigma."""
SITES = (-0.05, 0.05)
"""Where effects with a place are put: where the recipe's sites are [m]."""
HIDING = {
    "cogging", "cable_stiffness", "cable_hysteresis", "floor_vibration", "base_motion", "resonance",
    "force_saturation", "force_ripple",
}  # fmt: skip
"""Effects that add a force of the size of friction, over place, time or acceleration."""
WANTED = {"none": 0.9, "visible": 0.6}
MOST_WRONG = 0.005

MISMATCHED = {f"mismatch_{period}ms": period * 1e-3 for period in (1, 2, 4)}
"""Name of a case and its SYNC period [s]."""
SMALL = 10e-6
"""Range of micro-moves there [m]."""

Effects = Mapping[str, tuple[tuple[str, dict[str, float]], ...]]
"""Axis -> name and parameters of its effects."""


@dataclass(frozen=True, slots=True)
class Judged:
    """One estimate.

    Attributes:
        axis, kind: of the move.
        accepted: by the estimator.
        errors: figure -> (relative error, error in sigma), of those that the move has changed.
    """

    axis: str
    kind: str
    accepted: bool
    errors: dict[str, tuple[float, float]]

    @property
    def is_wrong(self) -> bool:
        """Accepted, and a figure is off by more than its sigma can explain."""
        return self.accepted and any(
            abs(share) > SHARE and abs(z) > SIGMAS for share, z in self.errors.values()
        )


def draw_parameters(effect: Effect, machine: Machine, axis: str, seed: int) -> dict[str, float]:
    """Parameters of an effect within their plausible ranges, those of a place at the sites."""
    settings = next(a for a in stage_settings(machine).axes if a.name == axis)
    generator = np.random.default_rng([seed, axis == "y", 31])
    drawn_values = {}
    for parameter in effect.parameters:
        ranges = parameter.ranges(settings)
        low, high = ranges[int(generator.integers(len(ranges)))]
        if parameter.role == "place":
            low, high = SITES
        if parameter.log:
            value = math.exp(generator.uniform(math.log(low), math.log(high)))
        else:
            value = generator.uniform(low, high)
        drawn_values[parameter.key] = float(value)
    return drawn_values


def make_stage(machine: Machine, name: str | None, seed: int) -> tuple[Machine, Effects]:
    """A drawn stage with one effect on each axis, or none, and what it has."""
    stage = drawn(machine, seed)
    if name is None:
        return stage, {}
    effect = own_effects()[name]
    effects = {axis: ((name, draw_parameters(effect, stage, axis, seed)),) for axis in machine.axes}
    figures = {
        axis: {
            key: getattr(stage.axes[axis].plant.friction, key)
            for key in ("coulomb", "viscous", "stiffness", "attraction")
        }
        for axis in machine.axes
    }
    return parse_machine(render_twin(machine, effects, figures), name), effects


def mismatch(machine: Machine, period: float, seed: int) -> tuple[Machine, Machine]:
    """A host's machine with noisy encoders, and the stage that it does not describe."""
    generator = np.random.default_rng([seed, 41])
    bus = machine.bus.model_copy(update={"sync_period": period})
    host, truth = {}, {}
    for name, axis in drawn(machine, seed).axes.items():
        encoder = axis.encoder.model_copy(update={"noise": 20e-9})
        off = float(generator.choice([-1.0, 1.0]) * generator.uniform(0.05, 0.15))
        friction = axis.plant.friction.model_copy(update={"elements": 16})
        plant = axis.plant.model_copy(
            update={"friction": friction, "mass": axis.plant.mass * (1.0 + off)}
        )
        truth[name] = axis.model_copy(update={"plant": plant, "encoder": encoder})
        host[name] = machine.axes[name].model_copy(update={"encoder": encoder})
    return (
        machine.model_copy(update={"axes": host, "bus": bus}),
        machine.model_copy(update={"axes": truth, "bus": bus}),
    )


def truth_at(
    stage: Machine, effects: Effects, axis: str, place: tuple[float, float], time: float
) -> dict[str, float]:
    """True figures of an axis at a place [m], its own position first, and a time [s]."""
    figures = stage.axes[axis].plant.friction.figures
    coulomb, viscous, stiffness, measured = 1.0, 1.0, 1.0, 1.0
    x, other = place
    for name, p in effects.get(axis, ()):
        if name == "coulomb_level":
            coulomb *= p["ratio"]
        elif name == "viscous_damping":
            viscous *= p["ratio"]
        elif name == "presliding_stiffness":
            stiffness *= p["ratio"]
        elif name == "thermal_drift":
            coulomb *= 1.0 + p["amplitude"] * math.exp(-time / p["time_constant"])
        elif name == "friction_position":
            coulomb *= 1.0 + p["amplitude"] * math.exp(-0.5 * ((x - p["center"]) / p["width"]) ** 2)
        elif name == "friction_spot":
            square = (x - p["center"]) ** 2 + (other - p["other"]) ** 2
            coulomb *= 1.0 + p["amplitude"] * math.exp(-0.5 * square / p["width"] ** 2)
        elif name == "friction_map":
            field = field_factor(
                p["amplitude"], p["length"], p["seed"], np.array([x]), np.array([other])
            )
            coulomb *= float(field[0])
        elif name == "force_constant":
            measured *= p["ratio"]
        elif name in ("force_ripple", "torque_ripple"):
            measured *= 1.0 + p["ratio"] * math.sin(2.0 * math.pi * x / p["pitch"] + p["phase"])
    return {
        "coulomb": figures.coulomb * coulomb / measured,
        "viscous": figures.viscous * viscous / measured,
        "stiffness": figures.stiffness * stiffness / measured,
        "relaxation_rate": figures.relaxation_rate,
    }


def judge(
    event: FrictionUpdated, stage: Machine, effects: Effects, before: tuple[float, ...]
) -> Judged:
    """An estimate against the truth; `before`: where the move began [m]."""
    # An axis with the shorter way has slid, and stopped, before the other one has left its place.
    place = event.place if abs(event.distance) > 0.1 * event.reach else before
    own, other = place if event.axis == "x" else place[::-1]
    truth = truth_at(stage, effects, event.axis, (own, other), event.time)
    estimate = event.estimate
    errors = {}
    for name in NAMES:
        if estimate.gain[name] > 1.0 and name not in estimate.held:
            value, sigma = getattr(estimate.friction, name), estimate.sigma[name]
            if name == "coulomb":
                value, sigma = estimate.sliding
                sigma = math.hypot(sigma, WANDER * truth[name])
            away = value - truth[name]
            errors[name] = (away / truth[name], away / sigma)
    return Judged(event.axis, event.kind, estimate.accepted, errors)


def run_stage(name: str | None, seed: int) -> list[Judged]:
    """All estimates of one run."""
    machine = load_machine(None)
    recipe = load_recipe(RECIPE, machine)
    if name in MISMATCHED:
        machine, stage = mismatch(machine, MISMATCHED[name], seed)
        effects: Effects = {}
        recipe = replace(recipe, fiducial=SimulatedMark(SMALL, seed))
    else:
        stage, effects = make_stage(machine, name, seed)
    events: list[FrictionUpdated] = []

    def note(event: object) -> None:
        if isinstance(event, FrictionUpdated):
            events.append(event)

    with tempfile.TemporaryDirectory() as folder:
        request = RunRequest(
            recipe,
            machine,
            Path(folder),
            datetime.now(UTC),
            simulated=SimulatedStage(stage, seed),
            host=HostSettings(friction_scale=0.5),
        )
        result = execute(request, Listener(event=note))
    if result.error is not None:
        raise result.error
    judged, before = [], (0.0, 0.0)
    for event, following in zip(events, [*events[1:], None], strict=True):
        judged.append(judge(event, stage, effects, before))
        if following is None or following.time != event.time:
            before = event.place
    return judged


def row(name: str, judged: list[Judged]) -> str:
    """Markdown of all estimates under one effect."""
    accepted = [estimate for estimate in judged if estimate.accepted]
    wrong = [estimate for estimate in accepted if estimate.is_wrong]
    figures = [
        name
        for name in NAMES
        if any(
            name in estimate.errors
            and abs(estimate.errors[name][0]) > SHARE
            and abs(estimate.errors[name][1]) > SIGMAS
            for estimate in wrong
        )
    ]
    share = len(wrong) / max(len(accepted), 1)
    return (
        f"| {name} | {len(accepted) / len(judged):.0%} | {len(wrong)} | {share:.1%} "
        f"| {', '.join(figures)} |"
    )


def main() -> None:
    """Run all and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--truths", type=int, default=10, help="drawn stages [10]")
    parser.add_argument("--effects", help="names, comma-separated; none: without [all]")
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args()
    possible = possible_on(stage_settings(load_machine()).axes[0], own_effects())
    names = given.effects.split(",") if given.effects else ["none", *possible, *MISMATCHED]
    cases = [(name, seed) for name in names for seed in range(1, given.truths + 1)]
    print(
        f"{given.truths} truths; {machine_facts()}\n\n"
        "| effect | accepted | wrong | of those accepted | figures |\n"
        "| --- | --- | --- | --- | --- |"
    )
    found: dict[str, list[Judged]] = {name: [] for name in names}
    with ProcessPoolExecutor(given.jobs) as pool:
        results = pool.map(run_case, cases) if given.jobs > 1 else map(run_case, cases)
        for (name, seed), judged in zip(cases, results, strict=True):
            found[name] += judged
            if seed == given.truths:
                print(row(name, found[name]), flush=True)
    effects = [name for name in names if name not in MISMATCHED]
    groups = {
        "no effect": [name for name in names if name == "none"],
        "friction visible": [name for name in effects if name not in HIDING | {"none"}],
        "friction hidden": [name for name in names if name in HIDING],
        "all": effects,
        "mismatch": [name for name in names if name in MISMATCHED],
    }
    for label, members in groups.items():
        if members:
            print(row(f"**{label}**", [j for name in members for j in found[name]]), flush=True)
    print(
        f"\nWanted: accepted >= {WANTED['none']:.0%} without effects, >= {WANTED['visible']:.0%} "
        f"where friction is visible; wrong <= {MOST_WRONG:.1%} of all accepted."
    )


def run_case(case: tuple[str, int]) -> list[Judged]:
    """`run_stage` for an effect's name, or none, and a seed."""
    name, seed = case
    return run_stage(None if name == "none" else name, seed)


if __name__ == "__main__":
    main()
