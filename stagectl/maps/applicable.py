"""Can this map be applied to this machine? Asked before it is put into use, and by every run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stagectl.config.machine import Axis, Machine
from stagectl.history import Pair
from stagectl.maps.build import LEAST_SITES
from stagectl.maps.model import FrictionMap, MapAxis, MapVersion

FAR_OFF = (0.2, 5.0)
"""A Coulomb force outside of so many times the machine file's is no friction of this stage."""
UNUSUAL = (0.6, 1.67)
UNSURE = 0.1
"""A site known no better than that (relative, 1 sigma) is hardly known."""
AGED = 30.0
"""An older map [days] is used, and that is said."""
DAY = 86400.0
ODD = 4.0
"""A site so many standard deviations off what its neighbours say does not fit them."""


@dataclass(frozen=True, slots=True)
class Problem:
    """Something about a map.

    Attributes:
        grave: it cannot be applied.  text: one sentence.
    """

    grave: bool
    text: str


def problems(friction_map: FrictionMap, machine: Machine) -> list[Problem]:
    """What speaks against a map, the grave things first."""
    found: list[Problem] = []
    if friction_map.stage.machine != machine.name:
        found.append(
            Problem(True, f"it is of {friction_map.stage.machine}, the machine is {machine.name}")
        )
    for name, axis in friction_map.axes.items():
        if name not in machine.axes:
            found.append(Problem(True, f"axis {name}: the machine has none"))
        else:
            found += _axis(name, axis, machine)
    found += [
        Problem(False, f"axis {name}: not in the map; it is learned by itself as without one")
        for name in machine.axes
        if name not in friction_map.axes
    ]
    return sorted(found, key=lambda problem: not problem.grave)


def outdated(friction_map: FrictionMap, now: float, max_age: float) -> list[Problem]:
    """What its age speaks against a map that is to be put into use.

    A run does not ask: there what the map says counts for less the older it is, and what moves have
    shown since for more.

    Args:
        friction_map: to be used.
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
        return [
            Problem(False, "what it stands for is still to come: is this computer's clock right?")
        ]
    return []


def sites_outside(version: MapVersion, sites: Sequence[Pair]) -> list[str]:
    """What is to be said of sites [m] that lie outside of the map; nothing where none does."""
    if not sites:
        return []
    inside = np.ones(len(sites), dtype=np.bool_)
    for axis in version.map.axes.values():
        inside &= axis.field().at(np.array(sites)).inside
    if inside.all():
        return []
    x, y = sites[int(inside.argmin())]
    return [
        f"friction map {version.number} ends short of {np.sum(~inside)} of {len(sites)} sites, the "
        f"first at ({x * 1e3:g}, {y * 1e3:g}) mm: the value at its edge stands there, with more "
        "doubt the further away"
    ]


def _axis(name: str, axis: MapAxis, machine: Machine) -> list[Problem]:
    found: list[Problem] = []
    first, second = list(machine.axes.values())[:2]
    outside = [s.place for s in axis.sites if not _inside(s.place, first, second)]
    if outside:
        x, y = outside[0]
        found.append(
            Problem(
                True,
                f"axis {name}: site ({x * 1e3:g}, {y * 1e3:g}) mm is outside the travel"
                + (f", and {len(outside) - 1} more" if len(outside) > 1 else ""),
            )
        )
    if len(axis.sites) < LEAST_SITES:
        found.append(Problem(True, f"axis {name}: only {len(axis.sites)} sites"))
        return found
    stated = machine.axes[name].plant.friction.coulomb
    ratios = [site.coulomb / stated for site in axis.sites]
    low, high = min(ratios), max(ratios)
    if low < FAR_OFF[0] or high > FAR_OFF[1]:
        found.append(
            Problem(True, f"axis {name}: {low:.2g} to {high:.2g} times the machine file's Coulomb "
                    "force: not this stage's")
        )  # fmt: skip
    elif low < UNUSUAL[0] or high > UNUSUAL[1]:
        found.append(
            Problem(False, f"axis {name}: {low:.2g} to {high:.2g} times the machine file's Coulomb "
                    "force")
        )  # fmt: skip
    unsure = [site for site in axis.sites if not site.sigma <= UNSURE]
    if len(unsure) > len(axis.sites) / 2:
        found.append(
            Problem(True, f"axis {name}: most sites are not known to {UNSURE:.0%}")
        )  # fmt: skip
    elif unsure:
        found.append(Problem(False, f"axis {name}: {len(unsure)} sites not known to {UNSURE:.0%}"))
    error, sigma = axis.field().left_out()
    score = np.abs(error) / np.maximum(sigma, 1e-9)
    worst = int(score.argmax())
    if math.isfinite(float(sigma[worst])) and score[worst] > ODD:
        x, y = axis.sites[worst].place
        found.append(
            Problem(
                False,
                f"axis {name}: site ({x * 1e3:g}, {y * 1e3:g}) mm is "
                f"{math.expm1(float(error[worst])):+.0%} off what its neighbours say: a spot, or a "
                "bad calibration",
            )
        )
    return found


def _inside(place: tuple[float, float], first: Axis, second: Axis) -> bool:
    return all(a.travel[0] <= p <= a.travel[1] for p, a in zip(place, (first, second), strict=True))
