"""The gap of a published model on a real axis: writes docs/emps.md and its picture.

    STAGECTL_EMPS=FOLDER python -m benchmarks.gap.emps [--docs docs]

FOLDER holds DATA_EMPS.mat and DATA_EMPS_PULSES.mat (docs/emps.md says where they come from).
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from hil_sim.effects.library import library
from hil_sim.settings import StageSettings
from sim2real.diagnosis import Examination, diagnose, examine
from sim2real.diagnosis.examination import report_without_causes
from sim2real.fitting import BASE, AxisModel
from sim2real.free_loop import FreeLoop, FreeSearch
from sim2real.gap import gap_closed, measure_gap
from sim2real.held_out import FLOOR_LEVEL
from stagectl.config import stage_settings
from stagectl.importing import import_recording, load_map
from stagectl.report import Line, Panel, draw

MAP = Path(__file__).parents[2] / "examples" / "emps" / "map.yaml"
AXIS = "slide"
PUBLISHED = 0.0585
"""Relative force error of the authors' closed-loop simulation on DATA_EMPS."""

HEAD = """# A published model on a real axis: EMPS

Written by `python -m benchmarks.gap.emps`; every figure below is computed there.

The Electro-Mechanical Positioning System: DC motor, ball screw, carriage of 95 kg, 1 kHz, 24.8 s
each of `DATA_EMPS.mat` (strokes there and back at several speeds) and
`DATA_EMPS_PULSES.mat` (force pulses added). A. Janot, M. Gautier, M. Brunot, *Data Set and
Reference Models of EMPS*, 2019 Workshop on Nonlinear System Identification Benchmarks;
nonlinearbenchmark.org. The data are not part of this project.

<!-- not run: needs data of others -->
```console
$ stagectl gap import DATA_EMPS.mat --map examples/emps/map.yaml
$ stagectl gap measure DATA_EMPS.h5
$ stagectl gap diagnose DATA_EMPS.h5
```

[machine.yaml](../examples/emps/machine.yaml) is the model as published: mass, viscous and Coulomb
friction, an offset, and the rig's cascaded controller. What is not published is set so that it has
no influence (bus, limits, a current loop of 5 kHz); friction breaks away within 2 µm, practically
at once. Its `repeatability` of 1.5 % is the only figure taken from the data: with it, the model
scatters between draws as much as the axis does between repeated strokes. The first 0.3 s are
excluded: the axis is already moving when the data begin.
"""


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--docs", type=Path, default=Path(__file__).parents[2] / "docs")
    docs = parser.parse_args().docs
    folder = os.environ.get("STAGECTL_EMPS")
    if folder is None:
        sys.exit("set STAGECTL_EMPS to the folder that holds DATA_EMPS.mat")
    how, machine = load_map(MAP)
    settings = stage_settings(machine)
    tolerance = {name: axis.plant.tolerance for name, axis in machine.axes.items()}
    found = {}
    for name in ("DATA_EMPS", "DATA_EMPS_PULSES"):
        recording = import_recording(Path(folder) / f"{name}.mat", how, machine)
        found[name] = examine([recording], settings, correct=True)
    page = [HEAD, *_gap(found), *_channels(found), *_where(found["DATA_EMPS"])]
    page += _causes(found, settings, tolerance)
    (docs / "images" / "emps.svg").write_text(_picture(found["DATA_EMPS"]), encoding="utf-8")
    (docs / "emps.md").write_text("\n".join(page) + "\n", encoding="utf-8")
    print("\n".join(page))


def _relative(examined: Examination) -> float:
    axis = examined.measured[0].replay.recording.axes[AXIS]
    force = float(np.sqrt(np.mean(axis.force_actual[axis.valid] ** 2)))
    assert examined.gap is not None
    return examined.gap[AXIS]["force"].nominal / force


def _gap(found: dict[str, Examination]) -> list[str]:
    lines = [
        "## How far the published model is off",
        "",
        "| data | position: gap | floor | force: gap | floor | relative force error | published |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for name, examined in found.items():
        assert examined.gap is not None
        position, force = examined.gap[AXIS]["position"], examined.gap[AXIS]["force"]
        published = {"DATA_EMPS": PUBLISHED, "DATA_EMPS_PULSES": 0.0894}[name]
        lines.append(
            f"| {name} | {position.nominal * 1e6:.2f} µm | {position.floor * 1e6:.2f} µm "
            f"| {force.nominal:.2f} N | {force.floor:.2f} N "
            f"| {100 * _relative(examined):.1f} % | {100 * published:.1f} % |"
        )
    checks = found["DATA_EMPS"].measured[0].repeats[AXIS]
    scatter = " and ".join(
        f"{c.repeated * s:.2g} {u} in {signal} (floor computed alike: {c.floor * s:.2g} {u})"
        for (signal, c), s, u in zip(checks.items(), (1e6, 1.0), ("µm", "N"), strict=True)
    )
    return [
        *lines,
        "",
        "Gap and floor: [formats/gap-report.md](formats/gap-report.md); rms, in closed loop,",
        "nothing is fitted. The last columns compare with the authors' closed-loop simulation.",
        f"{checks['force'].moves} strokes repeat another; they scatter by {scatter}.",
        "",
    ]


def _channels(found: dict[str, Examination]) -> list[str]:
    lines = ["## Channels", ""]
    for name, examined in found.items():
        for finding in examined.findings:
            state = " (corrected)" if finding.applied else ""
            lines.append(f"- {name}: {finding.text}{state}")
    return [
        *lines,
        "",
        "The published controller, recomputed from the logged reference and position, gives the",
        "logged control signal except for these remainders: sign, timing and units are as mapped.",
        "",
    ]


def _where(examined: Examination) -> list[str]:
    report = report_without_causes(examined)
    lines = ["## Where it lies", "", f"`DATA_EMPS`: {report.reason}.", ""]
    lines += [f"- {cell.text}" for cell in report.where]
    return [
        *lines,
        "",
        "![Measured and simulated force, and the residual](images/emps.svg)",
    ]


def _causes(
    found: dict[str, Examination], settings: StageSettings, tolerance: dict[str, float]
) -> list[str]:
    """The diagnosis of DATA_EMPS, and how its model does on held-out data."""
    begun, spent = time.perf_counter(), time.process_time()
    diagnosed = diagnose(found["DATA_EMPS"], tolerance, library(), jobs=2)
    begun, spent = time.perf_counter() - begun, time.process_time() - spent
    print(f"diagnosis: {begun:.0f} s, {spent:.0f} s of processor time", flush=True)
    report = diagnosed.report
    lines = [
        "",
        "## What causes it",
        "",
        f"Verdict on `DATA_EMPS`: `{report.verdict}`: {report.reason}.",
        "",
    ]
    for cause in report.causes:
        figures = ", ".join(
            f"{key} {p.value:.4g} ± {p.sigma:.2g} {p.unit}".rstrip()
            for key, p in cause.parameters.items()
        )
        lines.append(f"- {cause.effect}, probability {cause.probability:.2f}: {figures}")
    lines += [f"- alike: {' and '.join(group.effects)}" for group in report.confusable]
    lines.append("")
    if not report.causes:
        return [*lines, "So the twin is the published model, and no gap is closed."]
    model = diagnosed.models[AXIS]
    searched = diagnosed.searches[AXIS].free
    if searched is not None:
        other = _free_loop(found["DATA_EMPS_PULSES"], settings, tolerance)
        lines += _steps(searched, other)
        own = _own_level_and_phases(other, model)
        lines += [
            "",
            "Each step is fitted to moves of `DATA_EMPS` other than those it is judged on, start",
            "values included. On `DATA_EMPS_PULSES` the figures are those of `DATA_EMPS`. With a",
            f"Coulomb level and phases of its own, the last line becomes {_share(other, own):.2f}.",
            "",
        ]
    twin = replace(settings, axes=(model.settings(settings.axes[0]),))
    return [
        *lines,
        *_closed(found, twin),
        "",
        "Fitted to all of `DATA_EMPS`, base parameters within the tolerance included;",
        "`DATA_EMPS_PULSES` is held out. What is not closed has no known cause.",
    ]


def _free_loop(
    examined: Examination, settings: StageSettings, tolerance: dict[str, float]
) -> FreeLoop:
    return FreeLoop(AXIS, examined.measured, settings, tolerance[AXIS])


def _share(loop: FreeLoop, model: AxisModel) -> float:
    """Share of the gap that a model closes."""
    opened = loop.gap(loop.residual(loop.start))
    return 1.0 - (loop.gap(loop.residual(model)) - FLOOR_LEVEL) / (opened - FLOOR_LEVEL)


def _steps(searched: FreeSearch, other: FreeLoop) -> list[str]:
    """What each step of the selection closes, on held-out moves and on the other recording."""
    lines = [
        "| step | effect added | closed on held-out moves | on DATA_EMPS_PULSES |",
        "| --- | --- | --- | --- |",
    ]
    for number, step in enumerate(searched.steps, 1):
        shares = f"{step.closed:.2f} | {_share(other, step.model):.2f}"
        lines.append(f"| {number} | {', '.join(step.added)} | {shares} |")
    return lines


def _own_level_and_phases(loop: FreeLoop, model: AxisModel) -> AxisModel:
    """The model with the Coulomb level and the phases of waves fitted to another recording."""
    level = BASE.index("coulomb")
    phases = [
        (index, parameter.key)
        for index, term in enumerate(model.terms)
        for parameter in term.effect.parameters
        if parameter.role == "phase"
    ]

    def at(where: NDArray[np.float64]) -> AxisModel:
        base = model.base.copy()
        base[level] = where[0]
        changed = replace(model, base=base)
        for (index, key), phase in zip(phases, where[1:], strict=True):
            changed = changed.with_value(index, key, float(phase))
        return changed

    start = [model.base[level], *(model.terms[i].mapping()[key] for i, key in phases)]
    best = None
    for turn in (0.0, 2.0, 4.0):
        first = np.array([start[0], *(phase + turn for phase in start[1:])])
        simplex = np.vstack([first, first + np.diag([0.05, *([0.7] * len(phases))])])
        options = {"initial_simplex": simplex, "maxfev": 80}
        found = minimize(
            lambda w: loop.gap(loop.residual(at(w))), first, method="Nelder-Mead", options=options
        )
        if best is None or found.fun < best.fun:
            best = found
    assert best is not None
    return at(best.x)


def _closed(found: dict[str, Examination], twin: StageSettings) -> list[str]:
    lines = [
        "| data | force: gap as published | with it | floor | gap closed |",
        "| --- | --- | --- | --- | --- |",
    ]
    for name, examined in found.items():
        recording = examined.measured[0].replay.recording
        before = examined.gap
        after = measure_gap(recording, twin, draws=1)
        assert before is not None
        share = gap_closed(before, after)
        force = before[AXIS]["force"]
        lines.append(
            f"| {name} | {force.nominal:.2f} N | {after[AXIS]['force'].nominal:.2f} N "
            f"| {force.floor:.2f} N | {'-' if share is None else f'{share:.2f}'} |"
        )
    return lines


def _picture(examined: Examination) -> str:
    """Force over the first seconds, and the remainder over speed and position."""
    measured = examined.measured[0]
    replay = measured.replay
    axis = replay.recording.axes[AXIS]
    shown = slice(300, 8000)
    time = replay.recording.time[shown]
    left = measured.residual[AXIS]["force"]
    speed = np.gradient(axis.position_demand, replay.period)
    counted = axis.valid

    def binned(by: np.ndarray, count: int = 60) -> tuple[np.ndarray, np.ndarray]:
        edges = np.linspace(by[counted].min(), by[counted].max(), count + 1)
        place = np.clip(np.searchsorted(edges, by[counted]) - 1, 0, count - 1)
        number = np.bincount(place, minlength=count)
        mean = np.bincount(place, weights=left[counted], minlength=count) / np.maximum(number, 1)
        return ((edges[1:] + edges[:-1]) / 2)[number > 20], mean[number > 20]

    over_speed, by_speed = binned(speed)
    over_position, by_position = binned(axis.position_demand)
    return draw(
        [
            [
                Panel(
                    "time [s]", "force [N]",
                    (
                        Line(time, axis.force_actual[shown], "measured"),
                        Line(
                            time, measured.floor.nominal[AXIS]["force"][shown], "simulated",
                            "#c8452b", dashed=True,
                        ),
                    ),
                )
            ],
            [Panel("time [s]", "measured - simulated [N]", (Line(time, left[shown]),))],
            [
                Panel("speed [m/s]", "mean of what is left [N]", (Line(over_speed, by_speed),)),
                Panel("position [m]", "", (Line(over_position, by_position),)),
            ],
        ],
        900, 230, "EMPS: measured and simulated force, and what is left of it",
    )  # fmt: skip


if __name__ == "__main__":
    main()
