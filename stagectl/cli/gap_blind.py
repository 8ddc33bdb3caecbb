"""`stagectl gap blind`: the diagnosis on stages whose effects are drawn and sealed."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path
from typing import TYPE_CHECKING

import click

from stagectl.cli.options import FILE, write_json

if TYPE_CHECKING:
    from sim2real.blind.trial import Outcome, Setup


@click.command("blind", short_help="Check the diagnosis on effects that are sealed.")
@click.option("--trials", type=click.IntRange(1), default=20, show_default=True)
@click.option("--seed", type=click.IntRange(0), default=1, show_default=True)
@click.option("--lines", type=FILE, help="Append each trial here as a line; resume from there.")
@click.option("--only", metavar="EFFECT", help="Draw no other effect.")
@click.option("--jobs", type=click.IntRange(1), default=2, show_default=True)
@click.option("--leave-out", is_flag=True)
@click.option("--tag", default="")
def blind(trials, seed, lines, only, jobs, leave_out, tag) -> None:  # type: ignore
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from importlib import resources

    from hil_sim.effects.library import library
    from sim2real.blind.trial import Setup, draw_trial, run_trial
    from stagectl.config.machine import load_machine
    from stagectl.config.mapping import stage_settings

    path = Path(str(resources.files("stagectl") / "data" / "machines" / "wafer-xy.yaml"))
    model = load_machine(path)
    setup = Setup(
        stage_settings(model),
        {n: a.plant.tolerance for n, a in model.axes.items()},
        library(), path.read_text(), seed, leave_out, only, None, jobs,
    )
    for number in range(trials):
        t0 = time.perf_counter()
        trial = draw_trial(setup, number)
        t1 = time.perf_counter()
        out = run_trial(setup, trial, time.perf_counter)
        line = {"git": tag, **out.to_json(), "drawing": round(t1 - t0, 1)}
        with open(lines, "a") as f:
            f.write(json.dumps(line) + "\n")
        print(number, out.kind, [(d.axis, d.effect, round(d.gap, 1)) for d in out.truth], "->", out.verdict,
          [(t.axis, t.effect, round(t.probability, 2)) for t in out.told], {k: round(v, 1) for k, v in out.sigmas.items()},
          out.promised, out.second, round(out.seconds, 1), round(t1 - t0, 1), out.error, flush=True)
