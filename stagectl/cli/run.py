"""`stagectl run`: run a recipe on a stage or on its simulation."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from stagectl.cli.files import HistoryFile, InputFolder, OutputFolder
from stagectl.cli.options import (
    FILE,
    JSON_OUT,
    RECIPE,
    NumberRange,
    RunBy,
    option,
    takes,
    write_json,
)
from stagectl.cli.signals import stop_on_signal
from stagectl.cli.stage_options import ServerOption, StageCommand, StageOptions, warn_of_jitter
from stagectl.cli.terminal import console_for, show_result
from stagectl.errors import LimitsMissed

if TYPE_CHECKING:
    from collections.abc import Callable

    from stagectl.client import Client
    from stagectl.config import Machine
    from stagectl.run import Listener, RunRequest, RunResult

DEFAULT_BUDGET = 5.0
"""Time for calibration sites in a run, if neither option nor calibration file sets it [s]."""


@dataclass(frozen=True)
class _RunOptions:
    """What the host does, with which files."""

    compensation: str = option(
        "Force feedforward. none: acceleration force only; model: plus friction by the machine "
        "file; estimated: plus friction estimated online; oracle: plus TRUTH's friction.",
        click.Choice(["none", "model", "estimated", "oracle"]),
        "estimated",
    )
    friction_scale: float = option(
        "Start from the machine file's friction parameters times this factor.",
        NumberRange(0.01, 100.0),
        1.0,
    )
    observer: bool = option(
        "Correct the force offset at every SYNC from the measured position, on every axis that can "
        "have an observer (stagectl observer).",
        default=True,
        flags="--observer/--no-observer",
    )
    measurement: Path | None = option(
        "Design the observers by this measurement of the stage.  [default: the one beside the "
        "machine file; with --simulate, the virtual stage is measured]",
        FILE,
    )
    faults: Path | None = option(
        "Inject the bus and drive faults of this file; needs --simulate (docs/how-to/faults.md).",
        FILE,
    )
    out: Path | None = option(
        "Folder for recording, summary, report and bus log.  [default: runs/RECIPE-TIME]",
        OutputFolder(),
    )
    resume: Path | None = option(
        "Continue the interrupted run in folder RUN after its last finished site.",
        InputFolder(),
        metavar="RUN",
    )
    retries: int = option(
        "Restart a site after a recoverable fault at most this many times.",
        click.IntRange(0, 100),
        0,
    )
    history: str | None = option(
        "Friction history to write to.  [default: stage.db next to the run's folder; none for "
        "--simulate with --out; on a real stage, what the machine file names]",
        HistoryFile(),
        metavar="FILE|URL|none",
    )
    use_map: str = option(
        "Friction map to use: the active one of the history, if any, or none.",
        click.Choice(["active", "none"]),
        "active",
        flags="--map",
    )
    calibrate: Path | None = option(
        "Also measure due calibration sites of this file between sites, within --budget.",
        RECIPE,
        metavar="SITES",
    )
    budget: float | None = option(
        "Time for calibration sites [s].  [default: the calibration file's, else 5]",
        NumberRange(0.0),
    )


@click.command(cls=StageCommand)
@click.argument("recipe", type=RECIPE)
@takes(StageOptions)
@takes(_RunOptions)
@takes(RunBy)
@takes(ServerOption)
@JSON_OUT
@click.option(
    "--dry-run",
    is_flag=True,
    help="Check all that the run would check before it opens the bus, and print its plan.",
)
def command(
    stage: StageOptions, how: _RunOptions, by: RunBy, on: ServerOption, recipe: Path,
    json_out: Path | None, dry_run: bool,
) -> None:  # fmt: skip
    """Run RECIPE: a macro-move to each site, a micro-move onto its mark, an exposure.

    The friction estimate is updated after every move; the feedforward of the next one uses it.
    RECIPE is a file, or the name of one that comes with stagectl, such as inspection-20.

    \b
    On a virtual stage, without hardware:
      stagectl run recipes/inspection-20.yaml --simulate
    The same, with a host that starts from half the true friction:
      stagectl run recipes/inspection-20.yaml --simulate --friction-scale 0.5
    On a real stage:
      stagectl run RECIPE.yaml --machine M.yaml --bus socketcan:can0
    With a twin's model, on a stage server of the machine file it was made from:
      stagectl run RECIPE.yaml --machine TWIN.yaml --server socketcan-can0
    Continue after a fault, Ctrl-C or a power cut:
      stagectl run RECIPE.yaml --resume runs/RECIPE-20260101-120000

    Ctrl-C brings the stage to a controlled stop and keeps what was recorded; pressing it again
    does not speed that up. Exit code 0 completed, 2 unusable input, 3 fault, 4 completed but a
    site misses the recipe's limits, 130 stopped.
    """  # noqa: D301  (\b keeps click from wrapping what follows)
    if how.faults is not None and stage.simulate is None:
        raise click.UsageError("--faults needs --simulate")
    if how.compensation == "oracle" and stage.simulate is None:
        raise click.UsageError(
            "--compensation oracle needs --simulate: a real stage's friction is unknown"
        )
    from stagectl.cli.served import stage_for

    with stage_for(stage, on.server, moves=not dry_run, models=True) as (believed, truth, client):
        request = _request(stage, how, by, recipe, believed, truth)
        if client is not None:
            _run_on_server(client, request, how, json_out)
            return
    if how.calibrate is not None:
        request = _with_due_sites(request, how.calibrate, how.budget)
    if dry_run:
        _dry_run(request, json_out)
        return
    from stagectl.run import execute, find_measurement

    if how.observer:
        announce = partial(click.echo, err=True)
        found = find_measurement(request, how.measurement, stage.machine, how.resume, announce)
        request = replace(request, host=replace(request.host, measurement=found))
    if request.simulated is None:
        warn_of_jitter(request.machine, request.bus)
    _run(request, json_out, execute)


def _run_on_server(
    client: Client, request: RunRequest, how: _RunOptions, json_out: Path | None
) -> None:
    """Run it on the stage server that owns the stage."""
    from stagectl.cli.served import run_on

    unfit = {"--calibrate": how.calibrate, "--measurement": how.measurement}
    for flag, given in unfit.items():
        if given is not None:
            raise click.UsageError(f"{flag} is not for a stage server")
    _run(request, json_out, partial(run_on, client, how.resume))


def _request(
    stage: StageOptions, how: _RunOptions, by: RunBy, recipe: Path, believed: Machine,
    truth: Machine | None,
) -> RunRequest:  # fmt: skip
    """What the options ask for."""
    from stagectl.recipe import load_recipe

    loaded = load_recipe(recipe, believed)
    plan = None
    if how.faults is not None:
        from stagectl.config.faults import load_faults

        plan = load_faults(how.faults, believed, stage.seed)
    started = datetime.now(UTC).astimezone()
    folder = how.out or Path("runs") / f"{loaded.name}-{started:%Y%m%d-%H%M%S}"
    resumed = None
    if how.resume is not None:
        from stagectl.run import load_interrupted

        resumed = load_interrupted(how.resume, loaded)
    from stagectl.history import default_history
    from stagectl.run import HostSettings, RunRequest, SimulatedStage
    from stagectl.sequencer.compensation.mode import Mode

    return RunRequest(
        loaded,
        believed,
        folder,
        started,
        simulated=None if truth is None else SimulatedStage(truth, stage.seed, plan),
        host=HostSettings(
            mode=Mode(how.compensation),
            friction_scale=how.friction_scale,
            use_map=how.use_map == "active",
            observer=how.observer,
        ),
        remarks=by.remarks().or_of(resumed),
        bus=stage.bus,
        retries=how.retries,
        resumed=resumed,
        history=default_history(
            how.history, believed, truth is not None, folder, how.out is not None
        ),
    )


def _with_due_sites(request: RunRequest, path: Path, budget: float | None) -> RunRequest:
    """The run with as many due calibration sites inserted as the budget allows."""
    from stagectl.calibration import due_now, insert_sites, load_calibration

    if request.history is None:
        raise click.UsageError("--calibrate needs a history, from which it sees what is due")
    if not request.recipe.sites:
        raise click.UsageError("--calibrate needs a recipe with sites")
    calibration = load_calibration(path, request.machine)
    due = due_now(calibration, request)
    allowed = budget if budget is not None else calibration.budget
    allowed = DEFAULT_BUDGET if allowed is None else allowed
    recipe, spent = insert_sites(request.recipe, due, calibration.sequence, allowed)
    where = "; ".join(f"({x * 1e3:g}, {y * 1e3:g}) mm" for _, (x, y) in recipe.slipped)
    left = len(due) - len(recipe.slipped)
    click.echo(
        f"{len(due)} calibration sites due, {len(recipe.slipped)} inserted "
        f"({spent:.1f} of {allowed:g} s{f'; no time for the other {left}' if left else ''})"
        + (f": {where}" if where else ""),
        err=True,
    )
    return replace(request, recipe=recipe)


def _dry_run(request: RunRequest, json_out: Path | None) -> None:
    """Check all that the run would check before it opens the bus, and print its plan."""
    from stagectl.recipe import dry_run
    from stagectl.run import check

    check(request)
    done = 0 if request.resumed is None else request.resumed.done
    outcome = dry_run(request.recipe, request.machine, done=done)
    show_result(outcome.as_dict(), json_out, outcome.render())


def _run(
    request: RunRequest, json_out: Path | None, run: Callable[[RunRequest, Listener], RunResult]
) -> None:
    """Run with a progress display, and print what the run says."""
    from stagectl.cli.outcome import render_outcome
    from stagectl.cli.progress import RunProgress
    from stagectl.report import verdict
    from stagectl.run import Listener

    console = console_for(json_out)
    done = 0 if request.resumed is None else request.resumed.done
    with RunProgress(console, request.recipe, tuple(request.machine.axes), done) as progress:
        result = run(request, Listener(progress.phase, progress.event, stop_on_signal))
    write_json(result.summary, json_out)
    console.print(render_outcome(result, request.folder), crop=False)
    if result.error is not None:
        raise result.error
    judged = verdict(result.summary)
    if judged is not None and any(site.failures for site in result.verdicts):
        raise LimitsMissed(judged)
