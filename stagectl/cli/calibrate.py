"""`stagectl calibrate`: measure friction at fixed sites and build a new version of the map."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.files import HistoryFile, InputFolder, OutputFolder
from stagectl.cli.options import (
    JSON_OUT,
    RECIPE,
    RunBy,
    is_json_on_stdout,
    option,
    takes,
    write_json,
)
from stagectl.cli.signals import stop_on_signal
from stagectl.cli.stage_options import ServerOption, StageCommand, StageOptions
from stagectl.cli.terminal import console_for

if TYPE_CHECKING:
    from stagectl.calibration import Calibration, SiteSequence
    from stagectl.history import Pair
    from stagectl.run import Listener, RunRequest, RunResult

    Run = Callable[[RunRequest, Listener], RunResult]


@dataclass(frozen=True)
class _FileOptions:
    """Where the calibration is kept."""

    history: str | None = option("As for 'stagectl run'.", HistoryFile())
    out: Path | None = option(
        "Folder for recording, summary, report and bus log.  [default: runs/NAME-TIME]",
        OutputFolder(),
    )
    resume: Path | None = option(
        "Continue the interrupted calibration in this folder.", InputFolder(), metavar="RUN"
    )


@click.command(cls=StageCommand)
@click.argument("sites", type=RECIPE)
@click.option("--due", is_flag=True, help="Only sites that are due by the limits in SITES.")
@takes(StageOptions)
@takes(_FileOptions)
@takes(RunBy)
@takes(ServerOption)
@JSON_OUT
@click.option(
    "--dry-run",
    is_flag=True,
    help="Check all that the run would check before it opens the bus, and list the sites to visit.",
)
def command(
    stage: StageOptions, files: _FileOptions, by: RunBy, on: ServerOption, sites: Path, due: bool,
    json_out: Path | None, dry_run: bool,
) -> None:  # fmt: skip
    """Visit the sites in SITES.yaml, measure the friction of every axis there, build a new map.

    \b
    On a virtual stage:
      stagectl calibrate SITES.yaml --simulate TRUTH.yaml
    Only sites that are due, by time, by use or by changes seen in production:
      stagectl calibrate SITES.yaml --due

    The new map is stored in the history; 'stagectl map activate' puts it into use. Drive settings
    are not changed, and the stage ends at the first site.
    """  # noqa: D301  (\b keeps click from wrapping what follows)
    from stagectl.calibration import (
        calibration_as_json,
        load_calibration,
        require_enough_sites,
        resume_calibration,
    )
    from stagectl.cli.served import run_on, stage_for
    from stagectl.history import FILE_NAME, default_history

    with stage_for(stage, on.server, moves=not dry_run, models=True) as (believed, truth, client):
        calibration = load_calibration(sites, believed)
        started = datetime.now(UTC).astimezone()
        folder = files.out or Path("runs") / f"{calibration.recipe.name}-{started:%Y%m%d-%H%M%S}"
        where = default_history(
            files.history, believed, truth is not None, folder, files.out is not None
        )
        if where is None:  # a calibration is pointless without a history
            where = str((files.resume or folder) / FILE_NAME)
        quiet = is_json_on_stdout(json_out)
        if not quiet:
            _announce(calibration.sequence)
        from stagectl.run import HostSettings, RunRequest, SimulatedStage, execute

        request = RunRequest(
            calibration.recipe, believed, folder, started,
            None if truth is None else SimulatedStage(truth, stage.seed),
            HostSettings(observer=False),  # deviations are what is measured
            stage.bus, history=where, remarks=by.remarks(),
        )  # fmt: skip
        before: list[dict[str, Any]] = []
        if files.resume is not None:
            request, before = resume_calibration(request, calibration, files.resume)
        else:
            selected = _select_sites(calibration, request, due, quiet)
            if not selected:
                click.echo("no site is due", err=quiet)
                write_json(calibration_as_json(request, calibration.sequence), json_out)
                return
            request = replace(request, recipe=calibration.at(selected))
        require_enough_sites(request, request.recipe.sites)
        if dry_run:
            _dry_run(request, calibration.sequence, json_out, quiet)
        else:
            run = execute if client is None else partial(run_on, client, files.resume)
            _calibrate(request, calibration, before, run, json_out)


def _announce(sequence: SiteSequence) -> None:
    """Say what the moves at a site are expected to show."""
    from stagectl.calibration import predicted_gains

    click.echo(
        f"{len(sequence.excursions)} moves at each site, {sequence.duration:.2f} s; "
        "expected uncertainty, 1 sigma:"
    )
    for line in predicted_gains(sequence):
        click.echo(f"  {line}")
    if not sequence.reaches():
        click.echo("  below the required accuracy: a larger 'reach' may help")


def _dry_run(
    request: RunRequest, sequence: SiteSequence, json_out: Path | None, quiet: bool
) -> None:
    """Check all that the run would check before it opens the bus, and list the sites to visit."""
    from stagectl.calibration import calibration_as_json
    from stagectl.run import check

    check(request)
    places = request.recipe.sites[0 if request.resumed is None else request.resumed.done :]
    for x, y in places:
        click.echo(f"  would visit ({x * 1e3:g}, {y * 1e3:g}) mm", err=quiet)
    would_visit = [list(place) for place in places]
    write_json({**calibration_as_json(request, sequence), "would_visit": would_visit}, json_out)


def _select_sites(
    calibration: Calibration, request: RunRequest, due: bool, quiet: bool
) -> tuple[Pair, ...]:
    """All sites, or those that are due."""
    from stagectl.calibration import due_now

    sites = calibration.recipe.sites
    if not due:
        return sites
    found = due_now(calibration, request)
    for site in found if not quiet else ():
        x, y = site.place
        click.echo(f"due: ({x * 1e3:g}, {y * 1e3:g}) mm: {'; '.join(site.reasons)}")
    places = {site.place for site in found}
    return tuple(site for site in sites if site in places)


def _calibrate(
    request: RunRequest,
    calibration: Calibration,
    before: list[dict[str, Any]],
    run: Run,
    json_out: Path | None,
) -> None:
    """Calibrate, print the outcome and write it as JSON.

    Raises:
        StagectlError: what ended the calibration early.
    """
    from stagectl.calibration import calibrate, calibration_as_json, calibration_outline
    from stagectl.cli.progress import RunProgress
    from stagectl.config import is_server, without_password
    from stagectl.report import print_outline, whole
    from stagectl.run import Listener

    console = console_for(json_out)
    with RunProgress(console, request.recipe, tuple(request.machine.axes)) as progress:
        listener = Listener(progress.phase, progress.event, stop_on_signal)
        result = calibrate(request, calibration, before, lambda asked: run(asked, listener))
    report = result.report
    outline = calibration_outline(report)
    number = None if report.version is None else report.version.number
    if number is not None:
        where = str(request.history)
        where = without_password(where) if is_server(where) else where
        text = (
            f"map {number} stored in {where}; 'stagectl map activate {number} --history "
            f"{shlex.quote(where)}' puts it into use"
        )
        console.print(print_outline(outline, whole(text)), crop=False)
    else:
        console.print(print_outline(replace(outline, command=result.command)), crop=False)
    outcome = calibration_as_json(request, calibration.sequence, number, report.outcomes)
    write_json(outcome, json_out)
    if result.error is not None:
        raise result.error
