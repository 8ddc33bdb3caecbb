"""What a run needs besides bus and files, checked as far as possible without either.

A dry run prepares in the same way and ends there. Nothing is written and no bus is opened.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import can

from drivers import ConfigurationError, Stage
from drivers.settings import AxisSettings, BusSettings
from hil_sim.settings import StageSettings
from stagectl.config.known_effects import KnownEffect, known_effects
from stagectl.config.package_settings import driver_settings, stage_settings
from stagectl.errors import UnusableInput
from stagectl.history import (
    History,
    StageKey,
    Thermometer,
    file_unfiled_runs,
    open_existing,
    open_history,
    plugin_thermometer,
)
from stagectl.maps import ActiveMap, load_active
from stagectl.recipe import Fiducial, make_fiducial
from stagectl.run.request import RunRequest
from stagectl.run.run_history import start_time
from stagectl.sequencer import AxisCompensation, Mode, make_compensation
from stagectl.store import refuse_in_progress


@dataclass(frozen=True, slots=True)
class Substitutes:
    """Bus, camera, operator and friction map in place of those that the request names.

    Attributes:
        bus: with a clock of its own.
        fiducial: finds the marks.
        stop: after this many samples the operator requests a stop, for this reason.
        active: the friction map to use.
    """

    bus: can.BusABC
    fiducial: Fiducial
    stop: tuple[int, str] | None = None
    active: ActiveMap | None = None


@dataclass(frozen=True, slots=True)
class Preparation:
    """All that a run is made of, ready to open the bus.

    Attributes:
        bus, axes: settings of the drivers.
        truth: settings of the virtual stage; None on a real one.
        fiducial: finds the marks.
        thermometer: of the stage, where a plug-in provides one.
        started: in the time of the history [s since 1970].
        active: the friction map, or None.
        compensation: of each axis.
        effects: of the host's machine file, and whether they are compensated.
    """

    bus: BusSettings
    axes: tuple[AxisSettings, ...]
    truth: StageSettings | None
    fiducial: Fiducial
    thermometer: Thermometer | None
    started: float
    active: ActiveMap | None
    compensation: tuple[AxisCompensation, ...]
    effects: tuple[KnownEffect, ...]


def prepare(
    request: RunRequest,
    announce: Callable[[str], object] = lambda _: None,
    substitutes: Substitutes | None = None,
) -> Preparation:
    """Check all that can be checked before the bus is opened.

    Args:
        request: what to run.
        announce: called with a few words when something that takes long begins.
        substitutes: of a replay, or of a test.

    Raises:
        ConfigError: machine file, recipe, or their effects, plug-ins or EDS cannot be used.
        UnusableInput: likewise the folder, the drivers' settings, the history or its map.
        StagectlError: the history cannot be read, or another run is writing to the folder.
    """
    machine, recipe = request.machine, request.recipe
    bus, axes = driver_settings(machine)
    _check_drivers(bus, axes)
    truth = None if request.truth is None else stage_settings(request.truth)
    if substitutes is None:
        fiducial = make_fiducial(recipe.fiducial, recipe.source)
        thermometer = plugin_thermometer(machine)
        _check_folder(request.folder)
        active, started = _active_map(request)
    else:
        fiducial, thermometer = substitutes.fiducial, None
        active, started = substitutes.active, request.started.timestamp()
    if active is not None:
        announce(f"friction map {active.version.number}")
        started = active.places.origin
    announce("preparing the estimator")
    compensation = _make_compensation(request, active)
    effects = _effects_of(request, active)
    return Preparation(
        bus, axes, truth, fiducial, thermometer, started, active, compensation, effects
    )


def _check_drivers(bus: BusSettings, axes: Sequence[AxisSettings]) -> None:
    """Refuse settings that the drivers cannot use, such as a damaged EDS."""
    with can.Bus(interface="virtual", channel=f"check-{id(axes)}") as nowhere:
        try:
            Stage(bus, axes, nowhere)
        except ConfigurationError as error:
            raise UnusableInput(str(error)) from error


def _check_folder(folder: Path) -> None:
    """Refuse a folder that cannot be written, or that a run in progress writes to."""
    there = folder.absolute()
    while not os.access(there, os.F_OK) and there.parent != there:
        there = there.parent
    if not there.is_dir():
        raise UnusableInput(f"{folder}: {there} is not a folder")
    if not os.access(there, os.W_OK | os.X_OK):
        raise UnusableInput(f"{folder}: {there} cannot be written")
    refuse_in_progress(folder)


def stage_key(request: RunRequest) -> StageKey:
    """The stage of a run in the history."""
    return StageKey(request.machine.name, request.truth is not None)


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


def _active_map(request: RunRequest) -> tuple[ActiveMap | None, float]:
    """The stage's active friction map, for a run that estimates friction; when the run starts."""
    history: History | None = None
    if request.history is not None:
        history = open_existing(request.history)
    try:
        started = start_time(history, request)
        if history is None or not request.use_map or request.mode is not Mode.ESTIMATED:
            return None, started
        sites = request.recipe.sites
        return load_active(history, stage_key(request), request.machine, sites, started), started
    finally:
        if history is not None:
            history.close()


def _is_mapped(request: RunRequest, active: ActiveMap | None) -> bool:
    """Whether friction over the table comes from a map, or is measured for one."""
    return active is not None or bool(request.recipe.excursions)


def _effects_of(request: RunRequest, active: ActiveMap | None) -> tuple[KnownEffect, ...]:
    return known_effects(
        request.machine, request.mode is not Mode.NONE, _is_mapped(request, active)
    )


def _make_compensation(
    request: RunRequest, active: ActiveMap | None
) -> tuple[AxisCompensation, ...]:
    """Compensation that starts from the figures of the resumed run, else from the map's."""
    known = None if active is None else active.figures
    if request.resumed is not None:
        known = dict(request.resumed.friction)
    return make_compensation(
        request.machine, request.mode, request.friction_scale, request.truth, known,
        None if active is None else active.drift, _is_mapped(request, active),
        bool(request.recipe.excursions or request.recipe.slipped),
    )  # fmt: skip
