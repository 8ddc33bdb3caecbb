"""`stagectl run`: run a recipe on a stage or on its simulation."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import click

from stagectl.cli.console import console_for
from stagectl.cli.files import HistoryFile, InputFolder, OutputFolder
from stagectl.cli.options import (
    FILE,
    JSON_OUT,
    RECIPE,
    NumberRange,
    is_json_on_stdout,
    run_by_options,
    write_json,
)
from stagectl.cli.signals import stop_on_signal
from stagectl.cli.stage_options import StageCommand, load_machines, stage_options

if TYPE_CHECKING:
    from stagectl.run import RunRequest

DEFAULT_BUDGET = 5.0
"""Time for calibration sites in a run, if neither option nor calibration file sets it [s]."""


@click.command(cls=StageCommand)
@click.argument("recipe", type=RECIPE)
@stage_options
@click.option(
    "--compensation",
    type=click.Choice(["none", "model", "estimated", "oracle"]),
    default="estimated",
    show_default=True,
    help="Force feedforward. none: acceleration force only; model: plus friction by the machine "
    "file; estimated: plus friction estimated online; oracle: plus TRUTH's friction.",
)
@click.option(
    "--friction-scale",
    type=NumberRange(0.01, 100.0),
    default=1.0,
    show_default=True,
    help="Start from the machine file's friction parameters times this factor.",
)
@click.option(
    "--observer/--no-observer",
    default=True,
    show_default=True,
    help="Correct the force offset at every SYNC from the measured position, on every "
    "axis that can have an observer (stagectl observer).",
)
@click.option(
    "--measurement",
    type=FILE,
    help="Design the observers by this measurement of the stage.  [default: the one beside the "
    "machine file; with --simulate, the virtual stage is measured]",
)
@click.option(
    "--faults",
    type=FILE,
    help="Inject the bus and drive faults of this file; needs --simulate (docs/faults.md).",
)
@click.option(
    "--out",
    type=OutputFolder(),
    help="Folder for recording, summary, report and bus log.  [default: runs/RECIPE-TIME]",
)
@click.option(
    "--resume",
    type=InputFolder(),
    metavar="RUN",
    help="Continue the interrupted run in folder RUN after its last finished site.",
)
@click.option(
    "--retries",
    type=click.IntRange(0, 100),
    default=0,
    show_default=True,
    help="Restart a site after a recoverable fault at most this many times.",
)
@click.option(
    "--history",
    type=HistoryFile(),
    metavar="FILE|URL|none",
    help="Friction history to write to.  [default: stage.db next to the run's folder; none for "
    "--simulate with --out; on a real stage, what the machine file names]",
)
@click.option(
    "--map",
    "use_map",
    type=click.Choice(["active", "none"]),
    default="active",
    show_default=True,
    help="Friction map to use: the active one of the history, if any, or none.",
)
@click.option(
    "--calibrate",
    type=RECIPE,
    metavar="SITES",
    help="Also measure due calibration sites of this file between sites, within --budget.",
)
@click.option(
    "--budget",
    type=NumberRange(0.0),
    help="Time for calibration sites [s].  [default: the calibration file's, else 5]",
)
@run_by_options
@JSON_OUT
@click.option(
    "--dry-run",
    is_flag=True,
    help="Check all that the run would check before it opens the bus, and print its plan.",
)
def command(
    recipe: Path,
    machine: Path | None,
    simulate: Path | None,
    bus: tuple[str, str] | None,
    compensation: str,
    friction_scale: float,
    observer: bool,
    measurement: Path | None,
    seed: int,
    faults: Path | None,
    out: Path | None,
    resume: Path | None,
    retries: int,
    history: str | None,
    use_map: str,
    calibrate: Path | None,
    budget: float | None,
    operator: str | None,
    comment: str | None,
    json_out: Path | None,
    dry_run: bool,
) -> None:
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
    Continue after a fault, Ctrl-C or a power cut:
      stagectl run RECIPE.yaml --resume runs/RECIPE-20260101-120000

    Ctrl-C brings the stage to a controlled stop and keeps what was recorded; pressing it again
    does not speed that up. Exit code 0 completed, 2 unusable input, 3 fault, 4 completed but a
    site misses the recipe's limits, 130 stopped.
    """  # noqa: D301  (\b keeps click from wrapping what follows)
    from stagectl.recipe import load_recipe

    if faults is not None and simulate is None:
        raise click.UsageError("--faults needs --simulate")
    if compensation == "oracle" and simulate is None:
        raise click.UsageError(
            "--compensation oracle needs --simulate: a real stage's friction is unknown"
        )
    believed, truth = load_machines(machine, simulate, bus, moves=not dry_run)
    loaded = load_recipe(recipe, believed)
    plan = None
    if faults is not None:
        from stagectl.config.faults import load_faults

        plan = load_faults(faults, believed, seed)
    started = datetime.now(UTC).astimezone()
    folder = out or Path("runs") / f"{loaded.name}-{started:%Y%m%d-%H%M%S}"
    resumed = None
    if resume is not None:
        from stagectl.run import load_interrupted

        resumed = load_interrupted(resume, loaded)
    from stagectl.history import default_history
    from stagectl.run import HostSettings, Remarks, RunRequest, SimulatedStage
    from stagectl.sequencer.compensation.mode import Mode

    request = RunRequest(
        loaded,
        believed,
        folder,
        started,
        simulated=None if truth is None else SimulatedStage(truth, seed, plan),
        host=HostSettings(
            mode=Mode(compensation),
            friction_scale=friction_scale,
            use_map=use_map == "active",
            observer=observer,
        ),
        remarks=Remarks(operator or None, comment or None).or_of(resumed),
        bus=bus,
        retries=retries,
        resumed=resumed,
        history=default_history(history, believed, truth is not None, folder, out is not None),
    )
    if calibrate is not None:
        request = _with_due_sites(request, calibrate, budget)
    if dry_run:
        _dry_run(request, json_out)
    else:
        if observer:
            from stagectl.run import find_measurement

            found = find_measurement(request, measurement, machine, resume, _announce)
            request = replace(request, host=replace(request.host, measurement=found))
        _run(request, json_out)


def _announce(text: str) -> None:
    click.echo(text, err=True)


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
    write_json(outcome.as_dict(), json_out)
    if not is_json_on_stdout(json_out):
        console_for(json_out).print(outcome.render())


def _run(request: RunRequest, json_out: Path | None) -> None:
    from stagectl.cli.outcome import render_outcome
    from stagectl.cli.progress import RunProgress
    from stagectl.errors import LimitsMissed
    from stagectl.report import verdict
    from stagectl.run import Listener, execute

    console = console_for(json_out)
    done = 0 if request.resumed is None else request.resumed.done
    with RunProgress(console, request.recipe, tuple(request.machine.axes), done) as progress:
        result = execute(request, Listener(progress.phase, progress.event, stop_on_signal))
    write_json(result.summary, json_out)
    console.print(render_outcome(result, request.folder), crop=False)
    if result.error is not None:
        raise result.error
    judged = verdict(result.summary)
    if judged is not None and any(site.failures for site in result.verdicts):
        raise LimitsMissed(judged)
