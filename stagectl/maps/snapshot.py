"""Map and tracking as they stand when a run begins, for its recording, and restored from there.

A replay needs both as they were then, whatever has become of them. Numbers are kept exactly.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping
from dataclasses import asdict, fields
from typing import Any

import numpy as np

from estimation.field import SiteTracker, TrackingSettings
from stagectl.config.machine import Machine
from stagectl.maps.active import ActiveMap
from stagectl.maps.model import MapVersion, from_json, to_json
from stagectl.maps.places import TrackedPlaces
from stagectl.sequencer import Figures

_SETTINGS = {field.name for field in fields(TrackingSettings)}
"""Settings that another version had and this one lacks are ignored: a replay shows the effect."""


def take_snapshot(active: ActiveMap) -> dict[str, Any]:
    """Plain values, for JSON."""
    places, version = active.places, active.version
    return {
        "number": version.number,
        "made": version.made,
        "comment": version.comment,
        "content": to_json(version.map),
        "origin": places.origin,
        "sites": [list(site) for site in places.sites],
        "figures": {
            axis: {n: list(v) for n, v in own.items()} for axis, own in active.figures.items()
        },
        "drift": active.drift,
        "trackers": {
            name: {
                "settings": asdict(tracker.settings),
                "time": tracker.time,
                **{key: _packed(value) for key, value in tracker.numbers().items()},
            }
            for name, tracker in places.trackers.items()
        },
    }


def restore_snapshot(note: Mapping[str, Any], machine: Machine, name: str) -> ActiveMap:
    """Map and tracking of a snapshot.

    Args:
        note: as `take_snapshot` made it.
        machine: of the same recording.
        name: of the recording, for errors.

    Raises:
        UnusableInput: the map cannot be used.
        KeyError, TypeError, ValueError: the snapshot is damaged.
    """
    version = MapVersion(
        int(note["number"]), float(note["made"]), str(note["comment"]), True,
        from_json(str(note["content"]), name),
    )  # fmt: skip
    trackers = {
        str(axis): SiteTracker.of_numbers(
            {
                key: _unpacked(value)
                for key, value in entry.items()
                if key not in ("settings", "time")
            },
            TrackingSettings(**{k: v for k, v in entry["settings"].items() if k in _SETTINGS}),
            float(entry["time"]),
        )
        for axis, entry in note["trackers"].items()
    }
    places = TrackedPlaces(
        version.map,
        machine,
        [(float(x), float(y)) for x, y in note["sites"]],
        {axis: tracker.settings for axis, tracker in trackers.items()},
        float(note["origin"]),
    )
    places.trackers.update(trackers)
    figures: dict[str, Figures] = {
        str(axis): {str(n): (float(v[0]), float(v[1])) for n, v in own.items()}
        for axis, own in note["figures"].items()
    }
    drift = {
        str(axis): {str(n): float(v) for n, v in own.items()} for axis, own in note["drift"].items()
    }
    return ActiveMap(version, places, figures, drift)


def _packed(value: np.ndarray[Any, Any]) -> dict[str, Any]:
    """An array as text: base64 of little-endian float64."""
    text = base64.b64encode(np.ascontiguousarray(value, "<f8").tobytes()).decode("ascii")
    return {"shape": list(value.shape), "float64": text}


def _unpacked(note: Mapping[str, Any]) -> np.ndarray[Any, Any]:
    data = np.frombuffer(base64.b64decode(note["float64"]), "<f8")
    return data.astype(np.float64).reshape([int(n) for n in note["shape"]])
