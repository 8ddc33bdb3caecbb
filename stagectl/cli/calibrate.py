"""`stagectl calibrate`: measure friction at fixed sites and build a new version of the map."""

from __future__ import annotations

import shlex
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from stagectl.cli.console import console_for
from stagectl.cli.files import HistoryFile, InputFolder, OutputFolder
from stagectl.cli.options import (
    JSON_OUT,
    RECIPE,
    is_json_on_stdout,
    run_by_options,
    write_json,
)
from stagectl.cli.signals import stop_on_signal
from stagectl.cli.stage_options import StageCommand, load_machines, stage_options

if TYPE_CHECKING:
    from stagectl.calibration import Calibration, SiteOutcome, SiteSequence
    from stagectl.history import Pair, StageKey
    from stagectl.maps import AxisChange, MapVersion
    from stagectl.recipe import Recipe
    from stagectl.run import Resumed, RunRequest


@click.command(cls=StageCommand)
@click.argument("sites", type=RECIPE)
@click.option("--due", is_flag=True, help="Only sites that are due by the limits in SITES.")
@stage_options
@click.option("--history", type=HistoryFile(), help="As for 'stagectl run'.")
@click.option(
    "--out",
    type=OutputFolder(),
    help="Folder for recording, summary, report and bus log.  [default: runs/NAME-TIME]",
)
@click.option(
    "--resume",
    type=InputFolder(),
    metavar="RUN",
    help="Continue the interrupted calibration in this folder.",
)
@run_by_options
@JSON_OUT
@click.option(
    "--dry-run",
    is_flag=True,
    help="Check all that the run would check before it opens the bus, and list the sites to visit.",
)
def command(
    sites: Path, due: bool, machine: Path | None, simulate: Path | None,
    bus: tuple[str, str] | None, seed: int, history: str | None, out: Path | None,
    resume: Path | None, operator: str | None, comment: str | None, json_out: Path | None,
    dry_run: bool,
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
    from stagectl.calibration import load_calibration, predicted_gains, require_enough_sites
    from stagectl.history import FILE_NAME, default_history

    believed, truth = load_machines(machine, simulate, bus, moves=not dry_run)
    calibration = load_calibration(sites, believed)
    started = datetime.now(UTC).astimezone()
    folder = out or Path("runs") / f"{calibration.recipe.name}-{started:%Y%m%d-%H%M%S}"
    where = default_history(history, believed, truth is not None, folder, out is not None)
    if where is None:  # a calibration is pointless without a history
        where = str((folder if resume is None else resume) / FILE_NAME)
    quiet = is_json_on_stdout(json_out)
    if not quiet:
        click.echo(
            f"{len(calibration.sequence.excursions)} moves at each site, "
            f"{calibration.sequence.duration:.2f} s; expected uncertainty, 1 sigma:"
        )
        for line in predicted_gains(calibration.sequence):
            click.echo(f"  {line}")
        if not calibration.sequence.reaches():
            click.echo("  below the required accuracy: a larger 'reach' may help")
    from stagectl.run import RunRequest, check
    from stagectl.sequencer import Mode

    request = RunRequest(
        calibration.recipe, believed, truth, bus, Mode.ESTIMATED, 1.0, seed, folder, started,
        resumed=None, history=where, operator=operator or None, comment=comment or None,
        observer=False,  # deviations are what is measured
    )  # fmt: skip
    before: list[dict[str, Any]] = []
    if resume is not None:
        recipe, resumed, before = _resume(calibration, resume)
        request = replace(
            request, resumed=resumed, operator=request.operator or resumed.operator,
            comment=request.comment or resumed.comment,
        )  # fmt: skip
    else:
        selected = _select_sites(calibration, request, due, quiet)
        if not selected:
            click.echo("no site is due", err=quiet)
            write_json(_as_dict(request, None, [], calibration.sequence), json_out)
            return
        recipe = calibration.at(selected)
    request = replace(request, recipe=recipe)
    require_enough_sites(request, recipe.sites)
    if dry_run:
        check(request)
        places = recipe.sites[0 if request.resumed is None else request.resumed.done :]
        for x, y in places:
            click.echo(f"  would visit ({x * 1e3:g}, {y * 1e3:g}) mm", err=quiet)
        if json_out is not None:
            nothing = _as_dict(request, None, [], calibration.sequence)
            write_json({**nothing, "would_visit": [list(place) for place in places]}, json_out)
        return
    error = _measure(request, calibration, json_out, quiet, before)
    if error is not None:
        raise error


def _resume(calibration: Calibration, folder: Path) -> tuple[Recipe, Resumed, list[dict[str, Any]]]:
    """The sites of an interrupted calibration, due or not, and the estimates it made."""
    from stagectl.calibration import read_calibration, rewrite_all_documents
    from stagectl.run import document_paths, load_interrupted
    from stagectl.store import RECORDING_NAME

    resumed = load_interrupted(folder, calibration.recipe)
    if not document_paths(folder / RECORDING_NAME)[1].exists():  # killed before it wrote its page
        rewrite_all_documents(folder)
    interrupted = read_calibration(folder / RECORDING_NAME)
    recipe = replace(calibration.recipe, sites=interrupted.sites)
    return recipe, resumed, list(interrupted.friction)


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


def _measure(
    request: RunRequest, calibration: Calibration, json_out: Path | None, quiet: bool,
    before: list[dict[str, Any]],
) -> Exception | None:  # fmt: skip
    """Run the calibration, store the map, print the outcome (long: one step after another).

    Args:
        request: of the run.
        calibration: its sites and moves.
        json_out: file for the outcome; None for none.
        quiet: standard output is reserved for JSON.
        before: estimates of the interrupted calibration that this one continues.

    Returns:
        What ended the calibration early, or None.
    """
    from stagectl.calibration import (
        CalibrationReport,
        calibration_outline,
        site_outcomes,
        visited_sites,
        write_calibration_page,
    )
    from stagectl.cli.progress import RunProgress
    from stagectl.config import is_server, without_password
    from stagectl.errors import StagectlError
    from stagectl.history import StageKey
    from stagectl.maps import TooFewPlaces
    from stagectl.report import friction_map_used, print_outline, resume_command, whole
    from stagectl.run import Listener, execute

    console = console_for(json_out)
    machine = request.machine
    with RunProgress(console, request.recipe, tuple(machine.axes)) as progress:
        result = execute(request, Listener(progress.phase, progress.event, stop_on_signal))
    stage = StageKey(machine.name, request.truth is not None)
    notices = list(result.notices)
    version, before_it, failed = None, None, result.error
    changes: list[AxisChange] = []
    if failed is None:
        try:
            if result.unwritten is not None:
                raise StagectlError(f"{result.unwritten}, then 'stagectl map build' builds the map")
            version, before_it, changes = _new_map(request, stage)
        except TooFewPlaces as error:
            notices.append(f"no new map: {error}")
        except StagectlError as error:
            failed = StagectlError(f"no new map: {error}")
    friction = [*before, *result.summary["friction"]]
    sites = request.recipe.sites
    if result.error is not None:  # leave out sites that were not reached
        sites = visited_sites(sites, friction)
    built = None if version is None else version.map
    number = None if version is None else version.number
    found = site_outcomes(sites, friction, tuple(machine.axes), built, changes)
    report = CalibrationReport(
        request.recipe.name, str(stage), f"{request.started:%Y-%m-%d %H:%M:%S %Z}",
        None if failed is None else str(failed), friction_map_used(result.summary),
        len(sites), len(request.recipe.sites), found, changes, calibration.sequence, version,
        before_it, notices=notices,
    )  # fmt: skip
    outline = calibration_outline(report)
    if number is not None:
        where = str(request.history)
        where = without_password(where) if is_server(where) else where
        text = (
            f"map {number} stored in {where}; 'stagectl map activate {number} --history "
            f"{shlex.quote(where)}' puts it into use"
        )
        console.print(print_outline(outline, whole(text)), crop=False)
    else:
        command = None if result.error is None else resume_command(result.summary)
        console.print(print_outline(replace(outline, command=command)), crop=False)
    write_json(_as_dict(request, number, found, calibration.sequence), json_out)
    write_calibration_page(request.folder / "report.html", report)
    return failed


def _new_map(
    request: RunRequest, stage: StageKey
) -> tuple[MapVersion, MapVersion | None, list[AxisChange]]:
    """Build a map and store it in the history.

    Returns:
        The map, the version before, and the changes from that one.

    Raises:
        TooFewPlaces: no axis was measured at enough of them.
        StagectlError: the history cannot be read or written.
    """
    from stagectl.history import open_history
    from stagectl.maps import (
        MapVersion,
        build_map,
        compare,
        map_versions,
        to_json,
        tracking_settings,
    )

    history = open_history(str(request.history), write=True)
    try:
        versions = map_versions(history, stage)
        settings = tracking_settings(request.machine, history, stage)
        built = build_map(history, stage, settings=settings)
        now, comment = datetime.now(UTC).timestamp(), request.comment or ""
        number = history.save_map(stage, now, comment, to_json(built))
        before = versions[-1] if versions else None
        changes = [] if before is None else compare(before.map, built)
        return MapVersion(number, now, comment, False, built), before, changes
    finally:
        history.close()


def _as_dict(
    request: RunRequest, number: int | None, found: list[SiteOutcome], sequence: SiteSequence
) -> dict[str, object]:
    return {
        "format": "stagectl-calibration", "version": 1, "machine": request.machine.name,
        "simulated": request.truth is not None, "map": number,
        "expected_bits": {
            axis: {name: gain.bits for name, gain in gains.items()}
            for axis, gains in sequence.gains.items()
        },
        "sites": [
            {
                "site": e.site, "place": list(e.place), "axis": e.axis, "coulomb": e.coulomb,
                "sigma": e.sigma, "change": e.change,
                "bits": {name: gain.bits for name, gain in e.gains.items()},
                "refused": list(e.refused), "severity": e.severity, "suggestion": e.suggestion,
            }
            for e in found
        ],
    }  # fmt: skip
