"""Whether a map can be used on a machine; checked on activation and by every run."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from stagectl.config.machine import Machine
from stagectl.history import Pair
from stagectl.maps.build import LEAST_SITES
from stagectl.maps.model import FrictionMap, MapAxis, MapVersion

FAR_OFF = (0.2, 5.0)
"""Plausible Coulomb force, as multiples of the machine file's."""
UNUSUAL = (0.6, 1.67)
"""Likewise; a warning outside of it."""
UNSURE = 0.1
"""Relative standard deviation from which a site is hardly known."""
AGED = 30.0
"""Age from which a map is used with a warning [days]."""
DAY = 86400.0
ODD = 4.0
"""Standard deviations from which a site disagrees with its neighbours."""


@dataclass(frozen=True, slots=True)
class Problem:
    """An objection to a map.

    Attributes:
        grave: the map cannot be used.
        text: one sentence.
    """

    grave: bool
    text: str


def problems(friction_map: FrictionMap, machine: Machine) -> list[Problem]:
    """Objections to using a map on a machine, the grave ones first."""
    return sorted(_problems(friction_map, machine), key=lambda problem: not problem.grave)


def _problems(friction_map: FrictionMap, machine: Machine) -> Iterator[Problem]:
    if friction_map.stage.machine != machine.name:
        said = f"it is of {friction_map.stage.machine}, the machine is {machine.name}"
        yield Problem(True, said)
    for name, axis in friction_map.axes.items():
        if name not in machine.axes:
            yield Problem(True, f"axis {name}: the machine has none")
        else:
            for grave, text in _of_axis(axis, name, machine):
                yield Problem(grave, f"axis {name}: {text}")
    for name in machine.axes:
        if name not in friction_map.axes:
            said = f"axis {name}: not in the map; it is learned by itself as without one"
            yield Problem(False, said)


def outdated(friction_map: FrictionMap, now: float, max_age: float) -> list[Problem]:
    """Objections to activating a map because of its age.

    A run does not check this: its tracking trusts an old map less, and later moves more.

    Args:
        friction_map: to be activated.
        now: [s since 1970].
        max_age: [days].
    """
    days = (now - friction_map.date) / DAY
    said = f"what it stands for is {days:.0f} days old"
    if days > max_age:
        return [Problem(True, f"{said}, older than {max_age:g}: calibrate again")]
    if days > AGED:
        return [Problem(False, said)]
    if days < -1.0:
        said = "what it stands for is still to come: is this computer's clock right?"
        return [Problem(False, said)]
    return []


def sites_outside(version: MapVersion, sites: Sequence[Pair]) -> list[str]:
    """A warning about sites [m] that lie outside of the map; empty where none does."""
    if not sites:
        return []
    inside = np.ones(len(sites), dtype=np.bool_)
    for axis in version.map.axes.values():
        inside &= axis.field().at(np.array(sites)).inside
    if inside.all():
        return []
    first = _mm(sites[int(inside.argmin())])
    return [
        f"friction map {version.number} ends short of {np.sum(~inside)} of {len(sites)} sites, the "
        f"first at {first}: the value at its edge stands there, with more doubt the further away"
    ]


def _of_axis(axis: MapAxis, name: str, machine: Machine) -> Iterator[tuple[bool, str]]:
    """Objections to an axis of a map: whether grave, and what."""
    travels = [own.travel for own in machine.axes.values()]
    outside = [
        site.place
        for site in axis.sites
        if not all(low <= p <= high for p, (low, high) in zip(site.place, travels, strict=False))
    ]
    if outside:
        more = f", and {len(outside) - 1} more" if len(outside) > 1 else ""
        yield True, f"site {_mm(outside[0])} is outside the travel{more}"
    if len(axis.sites) < LEAST_SITES:
        yield True, f"only {len(axis.sites)} sites"
        return
    stated = machine.axes[name].plant.friction.coulomb
    ratios = [site.coulomb / stated for site in axis.sites]
    low, high = min(ratios), max(ratios)
    said = f"{low:.2g} to {high:.2g} times the machine file's Coulomb force"
    if low < FAR_OFF[0] or high > FAR_OFF[1]:
        yield True, f"{said}: not this stage's"
    elif low < UNUSUAL[0] or high > UNUSUAL[1]:
        yield False, said
    unsure = [site for site in axis.sites if not site.sigma <= UNSURE]
    if len(unsure) > len(axis.sites) / 2:
        yield True, f"most sites are not known to {100 * UNSURE:.0f} %"
    elif unsure:
        yield False, f"{len(unsure)} sites not known to {100 * UNSURE:.0f} %"
    error, sigma = axis.field().left_out()
    score = np.abs(error) / np.maximum(sigma, 1e-9)
    worst = int(score.argmax())
    if math.isfinite(float(sigma[worst])) and score[worst] > ODD:
        yield (
            False,
            f"site {_mm(axis.sites[worst].place)} is {100 * math.expm1(float(error[worst])):+.0f} "
            "% off what its neighbours say: a spot, or a bad calibration",
        )


def _mm(place: Pair) -> str:
    return f"({place[0] * 1e3:g}, {place[1] * 1e3:g}) mm"
