"""What a run needs besides bus and files, made of what was checked; kernels are compiled here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from stagectl.history import file_unfiled_runs, open_existing, open_history
from stagectl.maps import ActiveMap
from stagectl.run.checks import Checked, Substitutes, check, is_mapped, stage_key
from stagectl.run.request import RunRequest
from stagectl.sequencer import AxisCompensation, make_compensation


@dataclass(frozen=True, slots=True)
class Preparation(Checked):
    """All that a run is made of, ready to open the bus.

    Attributes:
        compensation: of each axis.
    """

    compensation: tuple[AxisCompensation, ...]


def prepare(
    request: RunRequest,
    announce: Callable[[str], object] = lambda _: None,
    substitutes: Substitutes | None = None,
) -> Preparation:
    """Check the request, then make what takes long.

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
    return Preparation(
        found.bus, found.axes, found.truth, found.fiducial, found.thermometer, found.started,
        found.active, found.effects, _make_compensation(request, found.active),
    )  # fmt: skip


def file_earlier_runs(request: RunRequest, announce: Callable[[str], object]) -> None:
    """File what earlier runs of the stage left in their folders, where there is a history yet.

    Args:
        request: of the run that begins.
        announce: called with a line for each run that was filed.

    Raises:
        StagectlError: the history cannot be written.
    """
    if request.history is None:
        return
    existing = open_existing(request.history)
    if existing is None:
        return
    existing.close()
    history = open_history(request.history, write=True)
    try:
        for line in file_unfiled_runs(history, stage_key(request)):
            announce(line)
    finally:
        history.close()


def _make_compensation(
    request: RunRequest, active: ActiveMap | None
) -> tuple[AxisCompensation, ...]:
    """Compensation that starts from the figures of the resumed run, else from the map's."""
    known = None if active is None else active.figures
    if request.resumed is not None:
        known = dict(request.resumed.friction)
    return make_compensation(
        request.machine, request.mode, request.friction_scale, request.truth, known,
        None if active is None else active.drift, is_mapped(request, active),
        bool(request.recipe.excursions or request.recipe.slipped),
    )  # fmt: skip
