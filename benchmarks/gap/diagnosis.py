"""Duration of a diagnosis, compared with fitting each candidate separately.

The peer is the obvious solution: for each effect of the library on each axis,
`scipy.optimize.least_squares` on the free closed-loop residual of the same simulator, with the
effect's own parameters and the base parameters, whose prior is the machine file's tolerance.
Places, pitches or frequencies would need many starts; here each candidate gets one, so its time is
a lower bound. Only every n-th candidate is run; the sum over all is extrapolated.

Also measured: a diagnosis where nothing explains the gap, and one where there is no gap.

    python -m benchmarks.gap.diagnosis [REC.h5] [--every 7]
"""

from __future__ import annotations

import argparse
import os
import time
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from hil_sim.effects.library import library
from hil_sim.settings import StageSettings
from sim2real.blind.draw import Drawn, Key, build_stage, draw_base
from sim2real.blind.moves import draw_demands
from sim2real.blind.stage import record_stage
from sim2real.diagnosis import Examination, diagnose, examine
from sim2real.fitting import STEP, AxisModel, Term, coordinates
from sim2real.fitting.coordinates import from_coordinates
from sim2real.gap import Measured
from stagectl.config.machine.file import load_machine, parse_machine
from stagectl.config.settings.package_settings import stage_settings
from stagectl.store import read_recording
from stagedata import Recording

F64 = NDArray[np.float64]
EFFECT = "cogging"
VALUES = {"amplitude": 1.2, "pitch": 0.031, "phase": 0.5}
STRANGERS: dict[str, dict[str, float]] = {
    "random_walk": {"rate": 0.5, "seed": 7.0},
    "root_drag": {"drag": 5.0},
}
"""Effects of no family."""


def example(*drawn: Drawn) -> Recording:
    """Ten seconds of the reference stage with effects."""
    machine = load_machine()
    settings = stage_settings(machine)
    rng = np.random.default_rng(1)
    demands = draw_demands(rng, settings)
    base = {a.name: draw_base(rng, 0.003) for a in settings.axes}
    key = Key("one", drawn, base)
    stage = build_stage(settings, key, library())
    return record_stage(stage, demands, 1, 8, machine.text, "example")


def by_scipy(
    name: str, axis: str, measured: Measured, settings: StageSettings, tolerance: float
) -> tuple[float, int]:
    """Time [s] and simulations of fitting one effect from the middle of its ranges."""
    effect = library()[name]
    own = next(a for a in settings.axes if a.name == axis)
    entries = coordinates(effect, own)
    values = tuple(0.5 * (p.ranges(own)[-1][0] + p.ranges(own)[-1][1]) for p in effect.parameters)
    start = np.array([e.inward(v) for e, v in zip(entries, values, strict=True)])
    runs = 0

    def deviations(at: F64) -> F64:
        nonlocal runs
        runs += 1
        term = from_coordinates(Term(effect, values), own, at[STEP:])
        model = AxisModel(np.append(at[:STEP], 0.0), (term,))
        stage = replace(
            settings, axes=tuple(model.settings(a) if a.name == axis else a for a in settings.axes)
        )
        simulated = measured.replay.run_axis(stage, axis)
        parts = [
            (values - simulated[signal]) / measured.floor.rms[axis][signal]
            for signal, values in measured.replay.measured()[axis].items()
        ]
        return np.nan_to_num(np.concatenate((*parts, at[:STEP] / tolerance)), nan=1e4)

    begun = time.perf_counter()
    least_squares(
        deviations, np.append(np.zeros(STEP), start), x_scale="jac", max_nfev=30, diff_step=1e-3
    )
    return time.perf_counter() - begun, runs


def main() -> None:
    """Time both on the same recording and tell the ratio."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recording", type=Path, nargs="?", help="[ten seconds with cogging]")
    parser.add_argument("--every", type=int, default=7, help="candidates that are run: each n-th")
    arguments = parser.parse_args()
    cogging = Drawn("y", EFFECT, VALUES, 0.0, EFFECT)
    recording = read_recording(arguments.recording) if arguments.recording else example(cogging)
    machine = parse_machine(recording.machine, recording.source)
    settings = stage_settings(machine)
    tolerance = {name: axis.plant.tolerance for name, axis in machine.axes.items()}
    known = {name: effect for name, effect in library().items() if effect.searched}

    def timed(what: str, recording: Recording) -> tuple[Examination, float]:
        """Examine and diagnose, and tell how long that takes [s]."""
        begun, spent = time.perf_counter(), time.process_time()
        examined = examine([recording], settings)
        report = diagnose(examined, tolerance, known).report
        took, spent = time.perf_counter() - begun, time.process_time() - spent
        print(
            f"{what}: {took:.1f} s ({spent:.1f} s of processor time), {report.verdict}", flush=True
        )
        return examined, took

    timed("with compilation", recording)
    examined, whole = timed("whole diagnosis", recording)
    if arguments.recording is None:
        timed("nothing", example())
        for name, values in STRANGERS.items():
            timed(name, example(Drawn("x", name, values, 0.0, "")))
    candidates = [(name, axis.name) for axis in settings.axes for name in known]
    each = []
    for name, axis in candidates[:: arguments.every]:
        took, runs = by_scipy(name, axis, examined.measured[0], settings, tolerance[axis])
        each.append(took)
        print(f"scipy, {name} on {axis}: {took:.1f} s, {runs} simulations", flush=True)
    everything = float(np.mean(each)) * len(candidates) / 2
    print(
        f"scipy, all {len(candidates)} candidates on two cores: {everything:.0f} s; "
        f"{everything / whole:.1f} times the whole diagnosis"
    )


if __name__ == "__main__":
    main()
