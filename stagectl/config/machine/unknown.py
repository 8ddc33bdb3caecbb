"""What a machine file leaves `unknown`: figures that a gap diagnosis finds; nothing else can run.

`take_unknown` puts numbers in their place, so that the file can be validated like any other;
`fill_unknown` then makes them fit the machine: a mass that its drive can move, friction that is a
small part of its force, presliding of a ten-thousandth of its travel. They are starting points.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from stagectl.config.machine.checks import BOTH_LOOPS
from stagectl.config.machine.drive import Pid
from stagectl.config.machine.model import Axis, Machine
from stagectl.config.parsing.yaml_nodes import Document
from stagectl.errors import ConfigError

UNKNOWN = "unknown"
GAINS = "gains"
"""What `pid: unknown` or `cascade: unknown` leaves open, as `sim2real.diagnosis` calls it."""
_FRICTION = (
    "coulomb", "viscous", "static_ratio", "stribeck_velocity", "stiffness", "attraction",
)  # fmt: skip
_ANY_FRICTION = {"model": "gms", "elements": 4, "stribeck_shape": 1.0}
"""What the word `friction: unknown` stands for, beside figures that are unknown."""
_ANY_GAINS = {"kp": 1.0, "ki": 0.0, "kd": 1.0, "derivative_time": 0.0}
_FRICTION_SHARE, _PRESLIDING, _RELAXATION = 0.02, 1e-4, 200.0
"""Coulomb force over peak force, presliding over travel, and C/Fc [1/s]."""
_SLOW = 0.01
"""Stribeck velocity over the velocity limit."""
_BANDWIDTH = 10.0
"""Of the position loop [Hz]."""

Place = tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Unknown:
    """What a machine file leaves unknown.

    Attributes:
        axes: axis -> keys: `mass`, keys of `friction`, or `GAINS`.
        places: of each in the file.
    """

    axes: Mapping[str, tuple[str, ...]]
    places: tuple[Place, ...]

    @property
    def of_the_plant(self) -> tuple[Place, ...]:
        """The places but for those of gains."""
        return tuple(place for place in self.places if "drive" not in place)


def spell_out(document: Document) -> Any:
    """A copy of a file's values, with each figure where it says `friction: unknown`."""
    data: Any = copy.deepcopy(document.data)
    axes = data.get("axes") if isinstance(data, dict) else None
    for axis in axes.values() if isinstance(axes, dict) else ():
        plant = axis.get("plant") if isinstance(axis, dict) else None
        if isinstance(plant, dict) and plant.get("friction") == UNKNOWN:
            plant["friction"] = {**_ANY_FRICTION, **dict.fromkeys(_FRICTION, UNKNOWN)}
    return data


def take_unknown(document: Document) -> tuple[Any, Unknown]:
    """The values of a machine file with numbers where it says `unknown`, and where that was.

    `unknown` elsewhere stays what it is, and is refused like any word.

    Raises:
        ConfigError: an axis has both pid and cascade, at least one of them unknown.
    """
    data = spell_out(document)
    found: dict[str, tuple[str, ...]] = {}
    places: list[Place] = []
    axes = data.get("axes") if isinstance(data, dict) else None
    for name, axis in axes.items() if isinstance(axes, dict) else ():
        keys: list[str] = []
        for section, key, number in (
            (("plant",), "mass", 1.0),
            *((("plant", "friction"), key, 1.0) for key in _FRICTION),
            (("drive",), "pid", dict(_ANY_GAINS)),
            (("drive",), "cascade", dict(_ANY_GAINS)),
        ):
            values: Any = axis
            for part in section:
                values = values.get(part) if isinstance(values, dict) else None
            if not isinstance(values, dict) or values.get(key) != UNKNOWN:
                continue
            if key in ("pid", "cascade"):
                if values.get("cascade" if key == "pid" else "pid") is not None:
                    place = ("axes", name, "drive", "cascade")
                    raise ConfigError([document.problem(place, BOTH_LOOPS)])
                del values[key]
                key_inside, keys_found = "pid", GAINS
            else:
                key_inside, keys_found = key, key
            values[key_inside] = number
            keys.append(keys_found)
            places.append(("axes", name, *section, key))
        if keys:
            found[name] = tuple(keys)
    return data, Unknown(found, tuple(places))


def fill_unknown(machine: Machine, unknown: Unknown) -> Machine:
    """The machine with starting points that suit it where figures are unknown."""
    axes = {name: _filled(axis, unknown.axes.get(name, ())) for name, axis in machine.axes.items()}
    return machine.model_copy(update={"axes": axes})


def _filled(axis: Axis, keys: tuple[str, ...]) -> Axis:
    if not keys:
        return axis
    peak, limits = axis.drive.peak_force, axis.limits
    span = axis.travel[1] - axis.travel[0]
    mass = axis.plant.mass
    if "mass" in keys:
        mass = peak * min(0.5 / limits.acceleration, span / limits.velocity**2)
    friction = axis.plant.friction
    coulomb = _FRICTION_SHARE * peak if "coulomb" in keys else friction.coulomb
    starts = {
        "coulomb": coulomb,
        "viscous": 0.0,
        "static_ratio": 0.0,
        "stribeck_velocity": _SLOW * limits.velocity,
        "stiffness": coulomb / (_PRESLIDING * span),
        "attraction": _RELAXATION * coulomb,
    }
    plant = axis.plant.model_copy(
        update={
            "mass": mass,
            "friction": friction.model_copy(update={k: starts[k] for k in keys if k in starts}),
        }
    )
    drive = axis.drive
    if GAINS in keys:
        rate = 2.0 * math.pi * _BANDWIDTH
        gains = Pid(kp=mass * rate**2, ki=0.0, kd=1.4 * mass * rate, derivative_time=0.1 / rate)
        drive = drive.model_copy(update={"pid": gains})
    return axis.model_copy(update={"plant": plant, "drive": drive})
