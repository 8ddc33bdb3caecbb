"""A friction map as a frozen value, and as the JSON stored in the history.

A map is its sites' levels with their uncertainty, and the hyperparameters of the field between
them, which `MapAxis.field` makes from these. Format: docs/formats/history.md.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from estimation.field import KERNELS, FrictionField, Node
from stagectl.errors import UnusableInput
from stagectl.history import Pair, StageKey

FORMAT = "stagectl-friction-map"
VERSION = 1


@dataclass(frozen=True, slots=True)
class MapSite:
    """Sliding level of one axis at one calibrated place.

    Attributes:
        place: [m].
        coulomb: [N].
        sigma: its relative standard deviation.
        measured: time of its last measurement [s since 1970].
        count: number of measurements used.
    """

    place: Pair
    coulomb: float
    sigma: float
    measured: float
    count: int


@dataclass(frozen=True, slots=True)
class MapAxis:
    """One axis of a map.

    Attributes:
        sites: calibrated places.
        nodes: hyperparameters of the field.
        figures: name -> (value, sigma) of the other friction figures, which are the same over the
            whole table.
    """

    sites: tuple[MapSite, ...]
    nodes: tuple[Node, ...]
    figures: Mapping[str, tuple[float, float]]

    def field(self) -> FrictionField:
        """The Coulomb force over the table."""
        return FrictionField(
            np.array([site.place for site in self.sites]),
            np.array([site.coulomb for site in self.sites]),
            np.array([site.sigma for site in self.sites]),
            nodes=self.nodes,
        )


@dataclass(frozen=True, slots=True)
class FrictionMap:
    """Friction of a stage over its table.

    Attributes:
        stage: that it describes.
        date: that it describes [s since 1970]; later changes are tracked.
        axes: name -> axis, in the machine's order.
    """

    stage: StageKey
    date: float
    axes: Mapping[str, MapAxis]


@dataclass(frozen=True, slots=True)
class MapVersion:
    """A version of a map in the history.

    Attributes:
        number: from 1, per stage.
        made: when it was built [s since 1970].
        comment: by its maker.
        active: whether runs use it.
        map: of this version.
    """

    number: int
    made: float
    comment: str
    active: bool
    map: FrictionMap


def to_json(friction_map: FrictionMap) -> str:
    """A map as JSON text."""
    return json.dumps(
        {
            "format": FORMAT,
            "version": VERSION,
            "machine": friction_map.stage.machine,
            "simulated": friction_map.stage.simulated,
            "date": friction_map.date,
            "axes": {
                name: {
                    "sites": [
                        [*site.place, site.coulomb, site.sigma, site.measured, site.count]
                        for site in axis.sites
                    ],
                    "nodes": [
                        [node.weight, node.kernel, node.length, node.amplitude, node.scatter]
                        for node in axis.nodes
                    ],
                    "figures": {key: list(value) for key, value in axis.figures.items()},
                }
                for name, axis in friction_map.axes.items()
            },
        },
        allow_nan=False,
    )


def from_json(text: str, name: str) -> FrictionMap:
    """Read a map from JSON text.

    Args:
        text: as made by `to_json`.
        name: for the error.

    Raises:
        UnusableInput: it is not a map, or of a newer version.
    """
    try:
        data: dict[str, Any] = json.loads(text)
        if data["format"] != FORMAT:
            raise ValueError("not a friction map")
        if data["version"] > VERSION:
            raise ValueError(f"version {data['version']}, made by a newer stagectl")
        axes = {
            axis: MapAxis(
                tuple(
                    MapSite((float(x), float(y)), float(c), float(s), float(t), int(n))
                    for x, y, c, s, t, n in entry["sites"]
                ),
                tuple(
                    Node(float(w), str(k), float(length), float(a), float(s))
                    for w, k, length, a, s in entry["nodes"]
                ),
                {key: (float(v[0]), float(v[1])) for key, v in entry["figures"].items()},
            )
            for axis, entry in data["axes"].items()
        }
        for entry in axes.values():
            if not entry.sites or not entry.nodes:
                raise ValueError("an axis without sites")
            if any(node.kernel not in KERNELS for node in entry.nodes):
                raise ValueError("an unknown kernel")
            if not all(math.isfinite(s.coulomb) and s.coulomb > 0 for s in entry.sites):
                raise ValueError("a Coulomb force that is not > 0")
        stage = StageKey(str(data["machine"]), bool(data["simulated"]))
        return FrictionMap(stage, float(data["date"]), axes)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        reason = f"no {error}" if isinstance(error, KeyError) else str(error)
        raise UnusableInput(f"{name}: not a usable friction map: {reason}") from error
