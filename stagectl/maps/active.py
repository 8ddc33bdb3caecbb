"""The active map of a stage, brought up to date for a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from stagectl.config.machine import Machine
from stagectl.errors import UnusableInput
from stagectl.history import EstimateRecord, History, Pair, StageKey
from stagectl.history.records import StoredMap
from stagectl.maps.applicable import problems
from stagectl.maps.learning import figure_drift, limit_per_place, tracking_settings
from stagectl.maps.model import FrictionMap, MapVersion, from_json
from stagectl.maps.places import TrackedPlaces
from stagectl.sequencer import Figures

REPLAYED = 60
"""Number of latest measurements per place and axis used to update a map: together they determine
the level more accurately than it stays constant, so more would not help."""


@dataclass(frozen=True, slots=True)
class ActiveMap:
    """The map that a run uses.

    Attributes:
        version: of the map.
        places: friction over the table, which moves update.
        figures: axis -> friction figures to start from.
        drift: axis -> figure -> relative 1-sigma of its change per move, learned from the history.
    """

    version: MapVersion
    places: TrackedPlaces
    figures: dict[str, Figures]
    drift: dict[str, dict[str, float]]


def map_versions(history: History, stage: StageKey) -> list[MapVersion]:
    """All versions of a stage's map in order.

    Raises:
        UnusableInput: one of them cannot be read.
    """
    return [_version(history, stored) for stored in history.maps(stage)]


def _version(history: History, stored: StoredMap) -> MapVersion:
    built = from_json(stored.content, f"{history.name}: map {stored.number}")
    return MapVersion(stored.number, stored.made, stored.comment, stored.active, built)


def load_active(
    history: History,
    stage: StageKey,
    machine: Machine,
    sites: Sequence[Pair],
    started: float,
) -> ActiveMap | None:
    """The active map, updated with the measurements since; None where no map is active.

    Args:
        history: open.
        stage: to load the map of.
        machine: as the host believes it to be.
        sites: that the run will visit [m].
        started: of the run [s since 1970].

    Raises:
        UnusableInput: the map does not fit the machine any more.
    """
    stored = [m for m in history.maps(stage) if m.active]
    if not stored:
        return None
    version = _version(history, stored[0])
    refuse_unless_applicable(version, machine, history.name)
    friction_map = version.map
    each = limit_per_place(history, stage, REPLAYED)
    since = history.measurements(stage, friction_map.date, started, each)
    places = TrackedPlaces(
        friction_map,
        machine,
        sites,
        tracking_settings(machine, history, stage),
        started,
    )
    places.replay(since)
    return ActiveMap(
        version,
        places,
        _latest_figures(history, stage, friction_map, started),
        figure_drift(history, stage, tuple(machine.axes)),
    )


def _latest_figures(
    history: History, stage: StageKey, friction_map: FrictionMap, started: float
) -> dict[str, Figures]:
    """Figures to start from: of the last accepted estimate at any place, else the map's.

    The Coulomb force is the sites' mean with a wide sigma; the map has its values by place.
    """
    newest: dict[str, EstimateRecord] = {}
    for row in history.at_date(stage, started):
        if row.axis not in newest or row.time > newest[row.axis].time:
            newest[row.axis] = row
    figures: dict[str, Figures] = {}
    for name, axis in friction_map.axes.items():
        values = [site.coulomb for site in axis.sites]
        middle = sum(values) / len(values)
        known = dict(axis.figures)
        if name in newest:
            last = newest[name]
            known |= {figure: (value, last.sigma(figure)) for figure, value in last.figures.items()}
        figures[name] = {**known, "coulomb": (middle, 0.2 * middle)}
    return figures


def refuse_unless_applicable(version: MapVersion, machine: Machine, name: str) -> None:
    """Raise where the map cannot be applied to the machine.

    Raises:
        UnusableInput: naming map and reason.
    """
    grave = [p.text for p in problems(version.map, machine) if p.grave]
    if grave:
        raise UnusableInput(f"{name}: map {version.number} cannot be applied: {grave[0]}")
