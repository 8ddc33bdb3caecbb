"""Cost of simulating a recording's demands in closed loop, and error of the coarse step.

    python -m benchmarks.rates.simulation_rate [--rounds 7]

Both axes of a recording in `tests/data`, scaled to 10 s of it; one thread, its processor time (the
least of some rounds, so that other load on the machine counts little). "Off the reference" is rms
over the recording, worst axis; a perfect model is still 0.04 µm and 0.07 N off a real recording.
"Over C": the same equations without effects in a plain C loop, built on the spot (`peers/plant.c`).
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.peers.c_plant import CPlant
from benchmarks.shared.machine_facts import machine_facts
from hil_sim.effects import AppliedEffect
from hil_sim.effects.library import own_effects
from hil_sim.plant import simulate
from hil_sim.settings import SUBSTEPS, StageSettings
from stagectl.config import load_machine, stage_settings
from stagectl.store import read_recording

RECORDING = Path(__file__).parents[2] / "tests" / "data" / "null-2.h5"
SPAN = 10.0  # s
SAME = 1e-9
"""Rounding makes the two programs differ by less [m]."""
EFFECTS: dict[str, dict[str, float]] = {
    "cogging": {"amplitude": 1.2, "pitch": 0.03, "phase": 1.0},
    "dead_time": {"delay": 0.00045},
    "resonance": {"frequency": 110.0, "damping": 0.02, "mass_ratio": 0.2},
    "force_saturation": {"force": 50.0},
    "cross_coupling": {"mass": 0.4},
}
"""On axis x in turn; 10 elements."""


F64 = NDArray[np.float64]


def stage(elements: int, *effects: AppliedEffect) -> StageSettings:
    """The packaged machine with `elements` friction elements and these effects on axis x."""
    nominal = stage_settings(load_machine(None))
    axes = [
        replace(axis, friction=replace(axis.friction, elements=elements)) for axis in nominal.axes
    ]
    axes[0] = replace(axes[0], effects=effects)
    return replace(nominal, axes=tuple(axes))


def least_time(action: Callable[[], object], rounds: int) -> float:
    """Processor time of this thread [s]."""
    action()
    spent = []
    for _ in range(rounds):
        begin = time.thread_time()
        action()
        spent.append(time.thread_time() - begin)
    return min(spent)


def over_c(
    loop: CPlant, settings: StageSettings, demand: F64, offset: F64, rounds: int
) -> tuple[float, float]:
    """Times of the reference and of the coarse step over those of the C loop.

    Raises:
        ValueError: the C loop computes something else.
    """
    ratios = []
    for substeps in (SUBSTEPS, 1):
        run = loop.prepare(settings, demand, offset, substeps)
        theirs = least_time(run, rounds)
        ours = least_time(
            lambda n=substeps: simulate(settings, demand, offset, None, substeps=n), rounds
        )
        position, _ = run()
        response = simulate(settings, demand, offset, None, substeps=substeps)
        off = float(np.sqrt(np.mean((position - response.position) ** 2, axis=0)).max())
        if off > SAME:
            raise ValueError(f"{substeps} steps: the C loop is {off * 1e9:.1f} nm (rms) off")
        ratios.append(ours / theirs)
    return ratios[0], ratios[1]


def main() -> None:
    """Print one row per stage."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=7, help="runs of each [7]")
    rounds = parser.parse_args().rounds
    recording = read_recording(RECORDING)
    demand = np.column_stack([a.position_demand for a in recording.axes.values()])
    offset = np.column_stack([a.force_offset for a in recording.axes.values()])
    known = own_effects()
    stages = {f"N = {count}": stage(count) for count in (4, 10, 16)}
    stages |= {name: stage(10, known[name].at(**values)) for name, values in EFFECTS.items()}
    print(f"{machine_facts()}\n")
    print("| | reference, ms per axis and 10 s | coarse | off the reference, µm | N |")
    print("| --- | --- | --- | --- | --- |")
    for name, settings in stages.items():
        share = SPAN / (len(demand) * settings.sync_period) / len(settings.axes)
        cost = [
            least_time(
                lambda s=settings, n=n: simulate(s, demand, offset, None, substeps=n), rounds
            )
            for n in (SUBSTEPS, 1)
        ]
        fine, coarse = (
            simulate(settings, demand, offset, None, substeps=n, rounded=False)
            for n in (SUBSTEPS, 1)
        )
        off = [
            float(np.sqrt(np.mean((one - other) ** 2, axis=0)).max())
            for one, other in ((fine.position, coarse.position), (fine.force, coarse.force))
        ]
        print(
            f"| {name} | {cost[0] * share * 1e3:.1f} | {cost[1] * share * 1e3:.1f} "
            f"| {off[0] * 1e6:.4f} | {off[1]:.4f} |"
        )
    with tempfile.TemporaryDirectory() as folder:
        try:
            loop = CPlant(Path(folder))
        except OSError as why:
            print(f"\nNot compared with a C loop: {why}.")
            return
        print(f"\nOver a C loop of the same equations ({loop.built_by}):\n")
        print("| | reference | coarse |")
        print("| --- | --- | --- |")
        for name in [name for name in stages if name not in EFFECTS]:
            fine_ratio, coarse_ratio = over_c(loop, stages[name], demand, offset, rounds)
            print(f"| {name}, over C | {fine_ratio:.2f} | {coarse_ratio:.2f} |")


if __name__ == "__main__":
    main()
