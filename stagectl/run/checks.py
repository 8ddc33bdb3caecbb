"""Whether a run can begin: all that can be checked without a bus, and before anything is written.

A dry run ends here; a run goes on with what was read on the way (`execution.prepare`). No kernel is
compiled or loaded.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import can

from stagectl.config.settings.package_settings import driver_settings, stage_settings
from stagectl.errors import UnusableInput
from stagectl.history import History, StageKey, Thermometer, existing_history, plugin_thermometer
from stagectl.recipe import Fiducial, make_fiducial
from stagectl.run.request import RunRequest
from stagectl.sequencer.compensation.mode import Mode
from stagectl.store import refuse_in_progress

if TYPE_CHECKING:
    from drivers.settings import AxisSettings, BusSettings
    from hil_sim.settings import StageSettings
    from stagectl.config.settings.known_effects import KnownEffect
    from stagectl.maps import ActiveMap


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
class Checked:
    """What was made of a request on the way.

    Attributes:
        bus, axes: settings of the drivers.
        truth: settings of the virtual stage; None on a real one.
        fiducial: finds the marks.
        thermometer: of the stage, where a plug-in provides one.
        started: in the time of the history [s since 1970].
        active: the friction map, or None.
        effects: of the host's machine file, and whether they are compensated.
    """

    bus: BusSettings
    axes: tuple[AxisSettings, ...]
    truth: StageSettings | None
    fiducial: Fiducial
    thermometer: Thermometer | None
    started: float
    active: ActiveMap | None
    effects: tuple[KnownEffect, ...]


def check(request: RunRequest, substitutes: Substitutes | None = None) -> Checked:
    """Check all that can be checked before the bus is opened.

    Args:
        request: what to run.
        substitutes: of a replay, or of a test.

    Raises:
        ConfigError: machine file, recipe, or their effects, plug-ins or EDS cannot be used.
        UnusableInput: likewise the folder, the drivers' settings, the history or its map.
        StagectlError: the history cannot be read, or another run is writing to the folder.
    """
    machine, recipe = request.machine, request.recipe
    bus, axes = driver_settings(machine, request.bus)
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
        started = active.places.origin
    effects = _check_effects(request, is_mapped(request, active))
    return Checked(bus, axes, truth, fiducial, thermometer, started, active, effects)


def stage_key(request: RunRequest) -> StageKey:
    """The stage of a run in the history."""
    return StageKey(request.machine.name, request.truth is not None)


def start_time(history: History | None, request: RunRequest) -> float:
    """When a run starts, in the time of its history [s since 1970].

    The time of a virtual stage runs faster than this computer's. It continues where the stage's
    last run ended, so that no earlier estimate lies in the future.
    """
    now = request.started.timestamp()
    if request.truth is None or history is None:
        return now
    newest = history.newest(StageKey(request.machine.name, simulated=True))
    return now if newest is None else max(now, newest + 1.0)


def is_mapped(request: RunRequest, active: ActiveMap | None) -> bool:
    """Whether friction over the table comes from a map, or is measured for one."""
    return active is not None or bool(request.recipe.excursions)


def _check_drivers(bus: BusSettings, axes: Sequence[AxisSettings]) -> None:
    """Refuse settings that the drivers cannot use, such as a damaged EDS."""
    from drivers import ConfigurationError, Stage

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


def _check_effects(request: RunRequest, mapped: bool) -> tuple[KnownEffect, ...]:
    """The effects of the host's machine file; refuses those that cannot be compensated as asked."""
    machines = [request.machine]
    if request.host.mode is Mode.ORACLE and request.truth is not None:
        machines.append(request.truth)
    if not any(axis.effects for machine in machines for axis in machine.axes.values()):
        return ()  # the usual case, without loading what knows effects
    from stagectl.config.settings.known_effects import known_effects, known_terms

    compensating = request.host.mode is not Mode.NONE
    if compensating:
        for machine in machines:
            known_terms(machine, mapped)
    return known_effects(request.machine, compensating, mapped)


def _active_map(request: RunRequest) -> tuple[ActiveMap | None, float]:
    """The stage's active friction map, for a run that estimates friction; when the run starts."""
    with existing_history(request.history) as history:
        started = start_time(history, request)
        if history is None or not request.host.use_map or request.host.mode is not Mode.ESTIMATED:
            return None, started
        from stagectl.maps import load_active

        sites = request.recipe.sites
        return load_active(history, stage_key(request), request.machine, sites, started), started
