"""Maps, their versions and changes as JSON values: docs/formats/history.md."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from stagectl.history import Activation, Pair, StageKey
from stagectl.maps.applicable import Problem
from stagectl.maps.compare import AxisChange
from stagectl.maps.model import MapVersion
from stagectl.maps.output.surface import surface

VERSION = 1


def _head(kind: str, stage: StageKey) -> dict[str, Any]:
    """The keys that all of them begin with."""
    return {
        "format": f"stagectl-map-{kind}",
        "version": VERSION,
        "machine": stage.machine,
        "simulated": stage.simulated,
    }


def version_as_json(version: MapVersion, at: Pair | None = None) -> dict[str, Any]:
    """A version: its axes with their sites, and the field's value at a place [m] where given."""
    axes: dict[str, Any] = {}
    for name, axis in version.map.axes.items():
        field = axis.field()
        axes[name] = {
            "correlation_length": field.length,
            "known_to": surface(axis).known_to,
            "figures": {
                key: {"value": value, "sigma": sigma}
                for key, (value, sigma) in axis.figures.items()
            },
            "sites": [asdict(site) for site in axis.sites],
        }
        if at is not None:
            found = field.at(np.array([at]))
            low, high = found.band()
            axes[name]["at"] = {
                "place": list(at),
                "coulomb": float(found.value[0]),
                "sigma": float(found.sigma[0]),
                "low": float(low[0]),
                "high": float(high[0]),
                "inside": bool(found.inside[0]),
            }
    return {**_head("shown", version.map.stage), **_version(version), "axes": axes}


def versions_as_json(
    stage: StageKey, versions: Sequence[MapVersion], used: Sequence[Activation]
) -> dict[str, Any]:
    """All versions and activations."""
    return {
        **_head("history", stage),
        "maps": [
            {
                **_version(version),
                "sites": {name: len(axis.sites) for name, axis in version.map.axes.items()},
            }
            for version in versions
        ],
        "used": [{"map": one.number, "time": one.time, "reason": one.reason} for one in used],
    }


def changes_as_json(
    stage: StageKey, old: int, new: int, changes: Sequence[AxisChange]
) -> dict[str, Any]:
    """Changes between two versions at every site, the largest first."""
    return {
        **_head("changes", stage),
        "old": old,
        "new": new,
        "axes": {
            change.axis: {
                "common": change.common,
                "own": change.own,
                "sites": [
                    asdict(site) | {"significant": site.significant} for site in change.sites
                ],
            }
            for change in changes
        },
    }


def activation_as_json(
    stage: StageKey, number: int | None, problems: Sequence[Problem], reason: str | None
) -> dict[str, Any]:
    """Whether a version can be used, and what was done; `number` None: no map is active now."""
    return {
        **_head("applied", stage),
        "map": number,
        "applicable": not any(problem.grave for problem in problems),
        "problems": [asdict(problem) for problem in problems],
        "done": reason,
    }


def _version(version: MapVersion) -> dict[str, Any]:
    return {
        "map": version.number,
        "made": version.made,
        "date": version.map.date,
        "comment": version.comment,
        "active": version.active,
    }
