"""What has changed from one map to another: by how much, where, and whether it means anything."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from stagectl.history import Pair
from stagectl.maps.model import FrictionMap, MapAxis

MEANS_SOMETHING = 3.5
"""A change beyond so many standard deviations is none by chance."""


@dataclass(frozen=True, slots=True)
class SiteChange:
    """One place.

    Attributes:
        place: [m].
        change: relative.
        sigma: its standard deviation.
    """

    place: Pair
    change: float
    sigma: float

    @property
    def significant(self) -> bool:
        """Whether it is more than chance."""
        return abs(self.change) > MEANS_SOMETHING * self.sigma


@dataclass(frozen=True, slots=True)
class AxisChange:
    """One axis.

    Attributes:
        common: mean relative change of all places.
        own: rms of the places' changes about it.
        sites: largest change about the mean first; `SiteChange.change` is about the mean.
    """

    axis: str
    common: float
    own: float
    sites: tuple[SiteChange, ...]


def compare(old: FrictionMap, new: FrictionMap) -> list[AxisChange]:
    """Changes of the axes that both maps have, at the newer one's sites."""
    return [
        _axis(name, old.axes[name], axis) for name, axis in new.axes.items() if name in old.axes
    ]


def _axis(name: str, old: MapAxis, new: MapAxis) -> AxisChange:
    places = np.array([site.place for site in new.sites])
    field = old.field().at(places)
    value, spread = field.value.copy(), field.sigma.copy()
    measured = {site.place: site for site in old.sites}
    for i, site in enumerate(new.sites):
        if site.place in measured:  # measured then and now: what lies between sites is no matter
            value[i], spread[i] = measured[site.place].coulomb, measured[site.place].sigma
    ratio = np.log([site.coulomb for site in new.sites]) - np.log(value)
    sigma = np.hypot(spread, [site.sigma for site in new.sites])
    # Those that are known well say what all have in common; a median keeps a spot out of it.
    common = float(np.median(ratio))
    own = np.expm1(ratio - common)
    changes = [
        SiteChange(site.place, float(own[i]), float(sigma[i])) for i, site in enumerate(new.sites)
    ]
    changes.sort(key=lambda change: -abs(change.change))
    return AxisChange(
        name, math.expm1(common), float(np.sqrt(np.mean(np.square(own)))), tuple(changes)
    )
