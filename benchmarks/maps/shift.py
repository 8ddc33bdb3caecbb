"""Benefit of a friction map and its tracking over a shift of production.

A table whose Coulomb level varies by +-25 % over XY with a correlation length of 40 mm (effect
`friction_map`, another field for each axis), is 30 % higher when cold, decaying with 120 s, and
gets a spot of 20 % (`--spot`) at one site half way through (`friction_spot`). 25 sites are
calibrated warm and mapped; then wafers of 20 sites, whole moves over the lock-step CAN bus. The
host is restarted twice, and once killed (SIGKILL) in the middle of a wafer; its successor
continues from the history. The same wafers, noise included, are run with one estimate for the
whole table, without friction compensation, and with an oracle that knows the true level at each
site and time.

    python -m benchmarks.maps.shift [--wafers 200] [--seed 1] [--modes map,oracle,global,none]
    python -m benchmarks.maps.shift --folder FOLDER --minutes 30     # repeat until it is complete

With a folder it resumes where it ended, for whatever reason. The figures are of the wafers that all
modes have completed.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.maps.shift_report import done, report
from benchmarks.maps.shift_table import Table
from benchmarks.shared.machine_facts import machine_facts
from drivers import Stage
from estimation.trajectory import Limits
from hil_sim.bus import World
from hil_sim.stage import VirtualStage
from stagectl.calibration import load_calibration
from stagectl.config.machine.file import load_machine
from stagectl.config.settings.package_settings import driver_settings, stage_settings
from stagectl.history import RunEntry, StageKey, open_history
from stagectl.maps import build_map, load_active, to_json
from stagectl.recipe import Recipe, load_recipe, make_fiducial
from stagectl.recipe.plan import plan
from stagectl.run import RunHistory, software_version
from stagectl.sequencer import (
    AxisCompensation,
    Engine,
    Event,
    FreshPlaces,
    FrictionUpdated,
    LevelStepped,
    Mode,
    MovingAxis,
    Places,
    make_compensation,
    summarise_moves,
)
from stagectl.store import SAMPLE_TAG, sample_codec, sample_dtype
from stagedata import AxisSignals, Move, Recording

F64 = NDArray[np.float64]
ROOT = Path(__file__).parents[2]
EPOCH = 1.8e9
"""When the shift begins [s since 1970]; all times are virtual."""
BETWEEN = 3.0
"""Time between two wafers [s]."""
SITES = """calibrate: before the shift
sites: {grid: {origin: [-0.05, -0.05], pitch: [0.025, 0.025], count: [5, 5]}}
"""


def drive(
    table: Table,
    recipe: Recipe,
    compensation: Sequence[AxisCompensation],
    places: Places | None,
    seed: int,
    on_event: Callable[[Event], object],
) -> tuple[list[dict[str, Any]], float]:
    """One wafer or calibration on virtual drives; micro-moves' results, and its duration [s]."""
    machine = table.machine
    world = World(f"shift-{seed}-{id(recipe)}")
    virtual = VirtualStage(stage_settings(table.truth()), seed)
    virtual.attach(world)
    bus, axes = driver_settings(machine)
    bus = replace(bus, interface="lockstep", channel=world.name)
    codec = sample_codec(len(axes))
    samples: list[bytes] = []
    moves: list[Move] = []
    with Stage.open(bus, axes) as stage:
        stage.boot()
        stage.home()
        stage.enable()
        stage.sink = lambda sample: samples.append(codec.pack(SAMPLE_TAG, 0, *sample) + bytes(4))
        moving = [
            MovingAxis(
                axis.name, Limits(axis.velocity, axis.acceleration, axis.jerk), axis.increment,
                own, axis.following_error,
            )
            for axis, own in zip(axes, compensation, strict=True)
        ]  # fmt: skip
        engine = Engine(
            stage, moving, make_fiducial(recipe.fiducial), bus.sync_period, moves.append,
            on_event, places,
        )  # fmt: skip
        engine.run(plan(recipe, (stage.targets[0], stage.targets[1])))
        stage.sink = None
        stage.disable()
    data = np.frombuffer(b"".join(samples), sample_dtype(len(axes)))
    signals = {}
    for i, axis in enumerate(axes):
        unit = axis.rated_force / 1000.0
        signals[axis.name] = AxisSignals(
            data[f"target_{i}"] * axis.increment, data[f"offset_{i}"] * unit,
            data[f"position_{i}"] * axis.increment, data[f"force_{i}"] * unit, None,
            data[f"valid_{i}"] > 0,
        )  # fmt: skip
    elapsed = (data["time"] - data["time"][0]) * 1e-9
    recording = Recording(
        machine.text, "", "2026-01-01T00:00:00+00:00", elapsed, signals, tuple(moves), ""
    )
    control = next(iter(machine.axes.values())).drive.control_period
    results = summarise_moves(recording, control, bus.sync_period, (5e-8, 2e-7))
    return [
        {"axis": r.axis, "site": r.site, "50": r.settling[5e-8], "200": r.settling[2e-7],
         "peak": r.peak_error}
        for r in results if r.kind == "micro"
    ], float(elapsed[-1])  # fmt: skip


def entry(stage: StageKey, started: float, recipe: Recipe, purpose: Any, wafer: int) -> RunEntry:
    """The entry of a run in the history."""
    return RunEntry(
        stage,
        ("x", "y"),
        started,
        recipe.name,
        "shift",
        str(wafer),
        software_version(),
        "-",
        purpose,
    )


def calibrate(database: str, seed: int) -> dict[str, tuple[float, float]]:
    """25 sites, warm, before the shift; the map is put into use.

    Returns:
        Axis -> error of the map at places between the sites, rms and relative, and the share of
        the truths there inside its 95 % band.
    """
    machine = load_machine()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "sites.yaml"
        path.write_text(SITES)
        calibration = load_calibration(path, machine)
    recipe = calibration.at(calibration.recipe.sites)
    stage = StageKey(machine.name, True)
    history = open_history(database, write=True)
    begin = EPOCH - 1000.0
    notes = RunHistory(
        entry(stage, begin, recipe, "calibration", 0),
        partial(open_history, database, write=True),
    )  # fmt: skip
    notes.start()
    compensation = make_compensation(machine, Mode.ESTIMATED)
    coulomb = {n: a.plant.friction.coulomb for n, a in machine.axes.items()}
    table = Table(machine, seed, math.inf, 0.0)

    def note(event: Event) -> None:
        if isinstance(event, FrictionUpdated):
            notes.file(notes.estimate(event))

    drive(table, recipe, compensation, FreshPlaces(coulomb), 10_000 + seed, note)
    end(notes, database)
    built = build_map(history, stage)
    number = history.save_map(stage, begin, "before the shift", to_json(built))
    history.activate(stage, number, begin, "activated")
    generator = np.random.default_rng(seed)
    unseen = generator.uniform(-0.05, 0.05, (500, 2))
    errors = {}
    for a, name in enumerate(machine.axes):
        found = built.axes[name].field().at(unseen)
        true = coulomb[name] * table.level(a, unseen)
        low, high = found.band()
        errors[name] = (
            float(np.sqrt(np.mean((found.value / true - 1) ** 2))),
            float(np.mean((true > low) & (true < high))),
        )
    history.close()
    return errors


def end(notes: RunHistory, database: str) -> None:
    """Wait until the history has all of this run."""
    notes.end("completed", None)
    lacks = notes.unwritten(Path(database).parent)
    assert lacks is None, lacks


def produce(
    mode: str, first: int, last: int, wafers: int, seed: int, folder: Path, spot: float,
    until: float = math.inf,
) -> None:  # fmt: skip
    """Wafers first .. last - 1 in this process; a line for each in `folder/MODE.jsonl`.

    Past `until` (seconds since 1970) no further wafer is begun.
    """
    machine = load_machine()
    recipe = load_recipe(ROOT / "recipes" / "inspection-20.yaml", machine)
    stage = StageKey(machine.name, True)
    out = folder / f"{mode}.jsonl"
    lines = out.read_text().splitlines() if out.exists() else []
    now = float(json.loads(lines[-1])["end"]) if lines else 0.0
    compensation = None
    for wafer in range(first, last):
        table = Table(machine, seed, now, spot if wafer >= wafers // 2 else 0.0)
        events: list[Event] = []
        notes: RunHistory | None = None
        places: Places | None = None
        if mode == "map":
            database = str(folder / "stage.db")
            history = open_history(database, write=True)
            active = load_active(history, stage, machine, recipe.sites, EPOCH + now)
            assert active is not None
            notes = RunHistory(
                entry(stage, EPOCH + now, recipe, "production", wafer),
                partial(open_history, database, write=True),
            )  # fmt: skip
            history.close()
            notes.start()
            places = active.places
            active.places.on_step = events.append
            compensation = make_compensation(
                machine, Mode.ESTIMATED, known=active.figures, drift=active.drift
            )
        elif mode == "global":
            if compensation is None:
                known = json.loads(lines[-1])["figures"] if lines else None
                compensation = make_compensation(machine, Mode.ESTIMATED, known=known)
            for own in compensation:
                own.forget_state()
        elif mode == "oracle":
            places, compensation = table, make_compensation(machine, Mode.ORACLE, 1.0, machine)
        else:
            compensation = make_compensation(machine, Mode.NONE)

        def note(event: Event, notes: RunHistory | None = notes) -> None:
            if notes is not None and isinstance(event, FrictionUpdated):
                notes.file(notes.estimate(event, placed=True))

        micro, duration = drive(table, recipe, compensation, places, 100 * seed + wafer, note)
        for event in events:
            assert isinstance(event, LevelStepped)
            assert notes is not None
            notes.file(notes.step(event))
        if notes is not None:
            end(notes, str(folder / "stage.db"))
        steps = [
            [e.axis, *e.place, e.change, e.everywhere]
            for e in events if isinstance(e, LevelStepped)
        ]  # fmt: skip
        figures = {
            name: {
                key: (getattr(own.estimator.friction, key), sigma)
                for key, sigma in own.estimator.sigma.items()
            }
            for name, own in zip(machine.axes, compensation, strict=True)
        }  # fmt: skip
        line = {
            "wafer": wafer, "end": now + duration + BETWEEN, "micro": micro, "steps": steps,
            "figures": figures,
        }  # fmt: skip
        now = float(line["end"])  # type: ignore[arg-type]
        with out.open("a") as file:
            file.write(json.dumps(line) + "\n")
        if time.time() > until:
            return


def shift(
    mode: str, last: int, wafers: int, seed: int, folder: Path, spot: float, until: float
) -> None:
    """Wafers of a mode up to `last`; with the map the host is killed once in the last quarter."""

    def host() -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [sys.executable, "-m", "benchmarks.maps.shift", "--child", mode,
             str(done(folder, mode)), str(last), "--wafers", str(wafers), "--seed", str(seed),
             "--folder", str(folder.resolve()), "--spot", repr(spot), "--until", repr(until)],
            cwd=ROOT,
        )  # fmt: skip

    fatal, mark = 3 * wafers // 4, folder / "killed"
    while done(folder, mode) < last and time.time() < until:
        with host() as child:
            if mode == "map" and last > fatal and not mark.exists():
                while done(folder, mode) < fatal and child.poll() is None:
                    time.sleep(0.05)
                time.sleep(0.2)  # in the middle of a wafer
                if child.poll() is None:
                    os.kill(child.pid, signal.SIGKILL)
                    mark.write_text(f"in wafer {done(folder, mode) + 1}\n")
        assert child.returncode in (0, -signal.SIGKILL), child.returncode


def main() -> None:
    """The parent runs the whole shift, a child some wafers."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--wafers", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--spot", type=float, default=0.2, help="level at the spot, relative")
    parser.add_argument("--modes", default="map,oracle,global,none")
    parser.add_argument("--folder", type=Path, help="kept; what is there is gone on with")
    parser.add_argument(
        "--minutes", type=float, default=math.inf, help="after these no wafer is begun"
    )
    parser.add_argument(
        "--child", nargs=3, metavar=("MODE", "FIRST", "LAST"), help=argparse.SUPPRESS
    )
    parser.add_argument("--until", type=float, default=math.inf, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        mode, first, last = options.child
        produce(
            mode, int(first), int(last), options.wafers, options.seed, options.folder, options.spot,
            options.until,
        )  # fmt: skip
        return
    print(machine_facts())
    modes = options.modes.split(",")
    wafers, until = options.wafers, time.time() + 60.0 * options.minutes
    with tempfile.TemporaryDirectory() as scratch:
        folder = options.folder or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        begun = folder / "shift.json"
        asked = {"wafers": wafers, "seed": options.seed, "spot": options.spot}
        if not begun.exists():
            (folder / "stage.db").unlink(missing_ok=True)
            for axis, (error, inside) in calibrate(str(folder / "stage.db"), options.seed).items():
                print(
                    f"25 sites calibrated; axis {axis} between them: error {error:.2%} rms, "
                    f"{inside:.1%} inside the 95 % band"
                )
            begun.write_text(json.dumps(asked))
        elif json.loads(begun.read_text()) != asked:
            parser.error(f"{folder} holds another shift: {begun.read_text()}")
        # The host is begun anew at each of these; so all modes get on side by side.
        for last in (wafers // 4, wafers // 2, wafers):
            for mode in modes:
                shift(mode, last, wafers, options.seed, folder, options.spot, until)
        report(modes, wafers, folder, options.spot)


if __name__ == "__main__":
    main()
