"""Compares two maps: change of the whole table and of each site, and its significance."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from stagectl.history import Pair
from stagectl.maps.model import FrictionMap, MapAxis

SIGNIFICANT = 3.5
"""Standard deviations from which a change is significant."""


@dataclass(frozen=True, slots=True)
class SiteChange:
    """Change of one site.

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
        """Whether the change exceeds chance."""
        return abs(self.change) > SIGNIFICANT * self.sigma


@dataclass(frozen=True, slots=True)
class AxisChange:
    """Changes of one axis.

    Attributes:
        axis: its name.
        common: median relative change of all sites.
        own: rms of the sites' changes about it.
        sites: changes about the common one, the largest first.
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
        if site.place in measured:  # measured then and now: no interpolation needed
            value[i], spread[i] = measured[site.place].coulomb, measured[site.place].sigma
    ratio = np.log([site.coulomb for site in new.sites]) - np.log(value)
    sigma = np.hypot(spread, [site.sigma for site in new.sites])
    # The median, so that a spot does not count as a common change.
    common = float(np.median(ratio))
    own = np.expm1(ratio - common)
    changes = [
        SiteChange(site.place, float(own[i]), float(sigma[i])) for i, site in enumerate(new.sites)
    ]
    changes.sort(key=lambda change: -abs(change.change))
    return AxisChange(
        name, math.expm1(common), float(np.sqrt(np.mean(np.square(own)))), tuple(changes)
    )
