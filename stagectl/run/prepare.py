"""What a run needs besides bus and files, made of what was checked; kernels are compiled here."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from pathlib import Path

from stagectl.errors import RunFault
from stagectl.history import existing_history, file_unfiled_runs, open_history
from stagectl.maps import ActiveMap
from stagectl.measurement import (
    Measurement,
    load_measurement,
    measure_virtual_stage,
    response_path,
)
from stagectl.run.checks import Checked, Substitutes, check, is_mapped, stage_key
from stagectl.run.compilation import compiled_by_two
from stagectl.run.recorded.resume import recorded_measurement
from stagectl.run.request import RunRequest
from stagectl.sequencer import AxisCompensation, make_compensation
from stagectl.store import RECORDING_NAME


def prepare(
    request: RunRequest,
    announce: Callable[[str], object] = lambda _: None,
    substitutes: Substitutes | None = None,
) -> tuple[Checked, tuple[AxisCompensation, ...]]:
    """Check the request, then make what takes long: the compensation of each axis.

    Args:
        request: what to run.
        announce: called with a few words when something that takes long begins.
        substitutes: of a replay, or of a test.

    Raises:
        ConfigError, UnusableInput, StagectlError: as `check`.
    """
    found = check(request, substitutes)
    if found.active is not None:
        announce(f"friction map {found.active.version.number}")
    announce("preparing the estimator")
    return found, _make_compensation(request, found.active)


def file_earlier_runs(request: RunRequest, announce: Callable[[str], object]) -> None:
    """File what earlier runs of the stage left in their folders, where there is a history yet.

    Args:
        request: of the run that begins.
        announce: called with a line for each run that was filed.

    Raises:
        StagectlError: the history cannot be written.
    """
    with existing_history(request.history) as existing:
        if existing is None or request.history is None:
            return
    with closing(open_history(request.history, write=True)) as history:
        for line in file_unfiled_runs(history, stage_key(request)):
            announce(line)


def _make_compensation(
    request: RunRequest, active: ActiveMap | None
) -> tuple[AxisCompensation, ...]:
    """Compensation that starts from the figures of the resumed run, else from the map's."""
    known = None if active is None else active.figures
    if request.resumed is not None:
        known = dict(request.resumed.friction)
    return make_compensation(
        request.machine, request.host.mode, request.host.friction_scale, request.truth, known,
        None if active is None else active.drift, is_mapped(request, active),
        bool(request.recipe.excursions or request.recipe.slipped),
    )  # fmt: skip


def find_measurement(
    request: RunRequest,
    given: Path | None,
    machine: Path | None,
    resume: Path | None,
    announce: Callable[[str], object],
) -> Measurement | None:
    """The measurement of the stage by which the observers are designed; None without one.

    Args:
        request: what to run; checked first, for measuring a virtual stage takes a second.
        given: file of the measurement; None: the run's that is resumed, a new one of a virtual
            stage, or the one beside the machine file.
        machine: machine file; None: the packaged one.
        resume: folder of the run that is resumed, or None.
        announce: called with what takes long, or went wrong.

    Raises:
        ConfigError, UnusableInput, StagectlError: a file cannot be used, or as `check`.
    """
    check(request)
    if given is not None:
        return load_measurement(given)
    recorded = None if resume is None else recorded_measurement(resume / RECORDING_NAME)
    truth = request.truth
    if truth is not None and recorded is not None:
        return recorded
    if truth is not None:
        try:
            with compiled_by_two(request.machine, truth, lambda _: None):
                return measure_virtual_stage(request.machine, truth, announce)
        except RunFault as fault:
            announce(f"the virtual stage could not be measured, so it has no observer: {fault}")
            return None
    beside = response_path(request.machine, machine)
    return load_measurement(beside) if beside.exists() else recorded
