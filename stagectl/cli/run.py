"""`stagectl run`: a recipe on the stage or on its simulation."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import click

from stagectl.cli.motion import machines_of, simulated_or_real, stop_on_signal
from stagectl.cli.options import FILE, JSON_FILE, NumberRange, quietly, write_json

if TYPE_CHECKING:
    from hil_sim.bus import FaultPlan
    from stagectl.config.machine import Machine
    from stagectl.recipe import Recipe
    from stagectl.run import RunRequest

USUAL_BUDGET = 5.0
"""Time for sites slipped into a run, where neither option nor file says [s]."""


@click.command(short_help="Run a recipe on the stage, or on its simulation.")
@click.argument("recipe", type=FILE)
@simulated_or_real
@click.option(
    "--compensation",
    type=click.Choice(["none", "model", "estimated", "oracle"]),
    default="estimated",
    show_default=True,
    help="Force offsets: mass only; plus the machine file's friction; that, learned on line; "
    "plus TRUTH's friction.",
)
@click.option(
    "--friction-scale",
    type=NumberRange(0.01, 100.0),
    default=1.0,
    show_default=True,
    help="Start from the machine file's friction figures times this.",
)
@click.option(
    "--faults",
    type=FILE,
    help="Seeded faults of bus and drives, with --simulate (docs/faults.md).",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder for recording, summary, report and bus log [runs/RECIPE-TIME].",
)
@click.option(
    "--resume",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="RUN",
    help="Go on with the interrupted run in this folder, behind its last finished site.",
)
@click.option(
    "--retries",
    type=click.IntRange(0, 100),
    default=0,
    show_default=True,
    help="Begin a site again so often after a fault that can be recovered.",
)
@click.option(
    "--history",
    metavar="FILE|URL|none",
    help="Friction history to write to [stage.db beside the run's folder; real runs: the machine "
    "file's, or stage.db in the folder of --out].",
)
@click.option(
    "--map",
    "use_map",
    type=click.Choice(["active", "none"]),
    default="active",
    show_default=True,
    help="Go by the history's active friction map, where there is one.",
)
@click.option(
    "--calibrate",
    type=FILE,
    metavar="SITES",
    help="Slip due sites of this calibration into the run, within --budget.",
)
@click.option(
    "--budget",
    type=NumberRange(0.0),
    help="Time for them [s; the calibration file's, else 5].",
)
@click.option(
    "--json", "json_out", type=JSON_FILE, help="Also write the summary here; - is stdout."
)
@click.option("--dry-run", is_flag=True, help="Only say what would be done; nothing moves.")
def command(
    recipe: Path,
    machine: Path | None,
    simulate: Path | None,
    bus: tuple[str, str] | None,
    compensation: str,
    friction_scale: float,
    seed: int,
    faults: Path | None,
    out: Path | None,
    resume: Path | None,
    retries: int,
    history: str | None,
    use_map: str,
    calibrate: Path | None,
    budget: float | None,
    json_out: Path | None,
    dry_run: bool,
) -> None:
    """Run RECIPE: at every site a macro-move, friction update, micro-move, exposure.

    \b
    On the virtual stage, no hardware:
      stagectl run recipes/inspection-20.yaml --simulate
    With a host that starts from half of all friction figures:
      stagectl run recipes/inspection-20.yaml --simulate --friction-scale 0.5
    On a real bus:
      stagectl run RECIPE.yaml --machine M.yaml --bus socketcan:can0
    Go on with a run that a fault, Ctrl-C or a power cut ended:
      stagectl run RECIPE.yaml --resume runs/RECIPE-20260101-120000

    Ctrl-C brings the stage to a controlled stop and keeps what was recorded; a second one
    does not hurry it. Exit code 0 completed, 2 unusable input, 3 fault, 130 stopped.
    """  # noqa: D301  (\b keeps click from wrapping what follows)
    from stagectl.recipe import load_recipe

    if faults is not None and simulate is None:
        raise click.UsageError("--faults needs --simulate: real faults come by themselves")
    if compensation == "oracle" and simulate is None:
        raise click.UsageError("--compensation oracle needs --simulate: nobody knows a real truth")
    believed, truth = machines_of(machine, simulate, bus, moves=not dry_run)
    loaded = load_recipe(recipe, believed)
    plan = None if faults is None else _faults(faults, believed, seed)
    if dry_run:
        if resume is not None:
            raise click.UsageError("--dry-run tells of the whole recipe; leave --resume out")
        _dry_run(loaded, believed, json_out)
        return
    started = datetime.now(UTC).astimezone()
    folder = out or Path("runs") / f"{loaded.name}-{started:%Y%m%d-%H%M%S}"
    _check_apart(folder, resume)
    from stagectl.history import default_history
    from stagectl.run import RunRequest, load_interrupted
    from stagectl.sequencer import Mode

    request = RunRequest(
        loaded,
        believed,
        truth,
        bus,
        Mode(compensation),
        friction_scale,
        seed,
        folder,
        started,
        plan,
        retries,
        None if resume is None else load_interrupted(resume, loaded),
        default_history(history, believed, truth is not None, folder, out is not None),
        use_map == "active",
    )
    if calibrate is not None:
        request = _with_due_sites(request, calibrate, budget)
    _run(request, json_out)


def _with_due_sites(request: RunRequest, path: Path, budget: float | None) -> RunRequest:
    """The run with the due sites of a calibration in it that there is time for."""
    from dataclasses import replace

    from stagectl.calibration import due_now, load_calibration, slip_in

    if request.history is None:
        raise click.UsageError("--calibrate needs a history: what is due is known from it")
    if not request.recipe.sites:
        raise click.UsageError("--calibrate needs a recipe with sites to slip others in between")
    calibration = load_calibration(path, request.machine)
    due = due_now(calibration, request)
    allowed = budget if budget is not None else calibration.budget
    recipe, spent = slip_in(
        request.recipe, due, calibration.sequence, USUAL_BUDGET if allowed is None else allowed
    )
    where = "; ".join(f"({x * 1e3:g}, {y * 1e3:g}) mm" for _, (x, y) in recipe.slipped)
    click.echo(
        f"{len(due)} sites due, {len(recipe.slipped)} slipped in ({spent:.1f} s)"
        + (f": {where}" if where else ""),
        err=True,
    )
    return replace(request, recipe=recipe)


def _faults(path: Path, machine: Machine, seed: int) -> FaultPlan:
    from stagectl.config.fault_plan import load_faults

    return load_faults(path, machine, seed)


def _dry_run(recipe: Recipe, machine: Machine, json_out: Path | None) -> None:
    from stagectl.recipe import dry_run

    outcome = dry_run(recipe, machine)
    if json_out is not None:
        write_json(outcome.as_dict(), json_out)
    if not quietly(json_out):
        from rich.console import Console

        Console().print(outcome.render())


def _check_apart(folder: Path, resume: Path | None) -> None:
    if resume is not None and folder.resolve() == resume.resolve():
        raise click.BadParameter(
            f"{folder}: holds the run that is gone on with; the rest needs a folder of its own",
            param_hint="--out",
        )


def _run(request: RunRequest, json_out: Path | None) -> None:
    from rich.console import Console

    from stagectl.cli.closing import closing
    from stagectl.cli.progress import RunProgress
    from stagectl.run import Listener, execute

    quiet = quietly(json_out)
    console = Console(stderr=quiet)
    with RunProgress(console, request.recipe, tuple(request.machine.axes)) as progress:
        result = execute(request, Listener(progress.phase, progress.event, stop_on_signal))
    if json_out is not None:
        write_json(result.summary, json_out)
    console.print(closing(result, request.folder), crop=False)
    if result.error is not None:
        raise result.error
