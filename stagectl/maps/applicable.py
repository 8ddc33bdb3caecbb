"""Whether a map can be used on a machine; checked on activation and by every run."""

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
        return [
            Problem(False, "what it stands for is still to come: is this computer's clock right?")
        ]
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
            Problem(True, f"axis {name}: most sites are not known to {100 * UNSURE:.0f} %")
        )  # fmt: skip
    elif unsure:
        found.append(
            Problem(False, f"axis {name}: {len(unsure)} sites not known to {100 * UNSURE:.0f} %")
        )
    error, sigma = axis.field().left_out()
    score = np.abs(error) / np.maximum(sigma, 1e-9)
    worst = int(score.argmax())
    if math.isfinite(float(sigma[worst])) and score[worst] > ODD:
        x, y = axis.sites[worst].place
        found.append(
            Problem(
                False,
                f"axis {name}: site ({x * 1e3:g}, {y * 1e3:g}) mm is "
                f"{100 * math.expm1(float(error[worst])):+.0f} % off what its neighbours say: a "
                "spot, or a bad calibration",
            )
        )
    return found


def _inside(place: tuple[float, float], first: Axis, second: Axis) -> bool:
    return all(a.travel[0] <= p <= a.travel[1] for p, a in zip(place, (first, second), strict=True))
