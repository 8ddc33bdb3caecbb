"""A calibration as a whole: its sites visited, a new map built and stored, its page written."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from stagectl.calibration.documents import read_calibration, rewrite_all_documents
from stagectl.calibration.outcome import SiteOutcome, site_outcomes, visited_sites
from stagectl.calibration.page import CalibrationReport, write_calibration_page
from stagectl.calibration.sequence import SiteSequence
from stagectl.calibration.sites import Calibration
from stagectl.errors import StagectlError
from stagectl.history import StageKey, open_history
from stagectl.maps import (
    MapVersion,
    TooFewPlaces,
    build_map,
    compare,
    map_versions,
    to_json,
    tracking_settings,
)
from stagectl.report import friction_map_used, resume_command
from stagectl.run import RunRequest, RunResult, document_paths, load_interrupted, stage_key
from stagectl.store import RECORDING_NAME

Estimates = list[dict[str, Any]]
"""Entries of a summary, one per estimate."""


@dataclass(frozen=True, slots=True)
class CalibrationResult:
    """The result of a calibration.

    Attributes:
        report: what there is to say.
        error: what ended it early, or kept it from a map; None without.
        command: that continues it, where it is interrupted and can be.
    """

    report: CalibrationReport
    error: StagectlError | None
    command: str | None


def resume_calibration(
    request: RunRequest, calibration: Calibration, folder: Path
) -> tuple[RunRequest, Estimates]:
    """The request that continues an interrupted calibration, due or not, and its estimates so far.

    Args:
        request: as for a new one.
        calibration: its sites and moves.
        folder: of the interrupted one.

    Raises:
        UnusableInput: there is none, or it is of another recipe or an older version.
    """
    resumed = load_interrupted(folder, calibration.recipe)
    if not document_paths(folder / RECORDING_NAME)[1].exists():  # killed before it wrote its page
        rewrite_all_documents(folder)
    interrupted = read_calibration(folder / RECORDING_NAME)
    continued = replace(
        request,
        recipe=replace(calibration.recipe, sites=interrupted.sites),
        resumed=resumed,
        remarks=request.remarks.or_of(resumed),
    )
    return continued, list(interrupted.friction)


def calibrate(
    request: RunRequest,
    calibration: Calibration,
    before: Estimates,
    run: Callable[[RunRequest], RunResult],
) -> CalibrationResult:
    """Run the calibration, store the map and write the page.

    Args:
        request: of the run, its recipe that of the sites to visit.
        calibration: its sites and moves.
        before: estimates of the interrupted calibration that this one continues.
        run: carries it out, as `stagectl.run.execute` does.

    Raises:
        ConfigError, StagectlError, OSError: as `run`.
        StagectlError: the page cannot be written.
    """
    result = run(request)
    stage = stage_key(request)
    notices, failed, command = list(result.notices), result.error, None
    version: MapVersion | None = None
    before_it: MapVersion | None = None
    if failed is None:
        try:
            if result.unwritten is not None:
                raise StagectlError(f"{result.unwritten}, then 'stagectl map build' builds the map")
            version, before_it = _build(request, stage)
        except TooFewPlaces as error:
            notices.append(f"no new map: {error}")
        except StagectlError as error:
            failed = StagectlError(f"no new map: {error}")
    friction = [*before, *result.summary["friction"]]
    sites = request.recipe.sites
    if result.error is not None:
        sites, command = visited_sites(sites, friction), resume_command(result.summary)
    built = None if version is None else version.map
    changes = [] if built is None or before_it is None else compare(before_it.map, built)
    report = CalibrationReport(
        request.recipe.name, str(stage), f"{request.started:%Y-%m-%d %H:%M:%S %Z}",
        None if failed is None else str(failed), friction_map_used(result.summary),
        len(sites), len(request.recipe.sites),
        site_outcomes(sites, friction, tuple(request.machine.axes), built, changes),
        changes, calibration.sequence, version, before_it, notices=notices,
    )  # fmt: skip
    write_calibration_page(request.folder / "report.html", report)
    return CalibrationResult(report, failed, command)


def _build(request: RunRequest, stage: StageKey) -> tuple[MapVersion, MapVersion | None]:
    """Build a map and store it in the history.

    Returns:
        The map and the version before.

    Raises:
        TooFewPlaces: no axis was measured at enough of them.
        StagectlError: the history cannot be read or written.
    """
    with closing(open_history(str(request.history), write=True)) as history:
        versions = map_versions(history, stage)
        settings = tracking_settings(request.machine, history, stage)
        built = build_map(history, stage, settings=settings)
        now, comment = datetime.now(UTC).timestamp(), request.remarks.comment or ""
        number = history.save_map(stage, now, comment, to_json(built))
        version = MapVersion(number, now, comment, False, built)
        return version, versions[-1] if versions else None


def calibration_as_json(
    request: RunRequest,
    sequence: SiteSequence,
    number: int | None = None,
    outcomes: Sequence[SiteOutcome] = (),
) -> dict[str, object]:
    """The outcome of a calibration as a document (docs/formats): map number, sites."""
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
            for e in outcomes
        ],
    }  # fmt: skip
