"""Problems of a recipe, collected with their places, and what its parts are checked against."""

from __future__ import annotations

from dataclasses import dataclass, field

from stagectl.config import Axis, Machine
from stagectl.config.parsing.yaml_nodes import Document
from stagectl.errors import ConfigError
from stagectl.recipe.schema import Profile

Location = tuple[str | int, ...]

MOTION_KEYS = ("velocity", "acceleration", "jerk")


@dataclass
class Check:
    """The problems of a recipe so far, and what every part of it is checked against.

    Attributes:
        document: of the recipe.
        machine: that is to run it.
        problems: found so far, one line each.
    """

    document: Document
    machine: Machine
    problems: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        if len(self.machine.axes) != 2:
            raise ConfigError(
                self.machine.document.problem(
                    ("axes",), f"a recipe needs two axes, has {len(self.machine.axes)}"
                )
            )

    @property
    def axes(self) -> list[tuple[str, Axis]]:
        """The axes of the machine, each with its name."""
        return list(self.machine.axes.items())

    def refuse(self, location: Location, reason: str) -> None:
        """Note a problem at a place in the recipe."""
        self.problems.append(self.document.problem(location, reason))

    def why_never_exceeded(self, length: float | None) -> str | None:
        """Why no axis can be this far off without a following error fault, or None."""
        least, name = min((axis.limits.following_error, name) for name, axis in self.axes)
        if length is None or length < least:
            return None
        reason = f"{length:g} m is never exceeded: axis {name} faults at {least:g} m"
        return f"{reason} (limits.following_error)"

    def check_limits(self, profile: Profile, at: Location, only: int | None = None) -> None:
        """Check a profile against the limits and drives of all axes, or of axis `only`."""
        for key in MOTION_KEYS:
            wanted = getattr(profile, key)
            over = [
                f"{name} ({getattr(axis.limits, key):g})"
                for index, (name, axis) in enumerate(self.axes)
                if only in (None, index) and wanted > getattr(axis.limits, key)
            ]
            if over:
                self.refuse((*at, key), f"{wanted:g} is above the limit of axis {', '.join(over)}")
        for index, (name, axis) in enumerate(self.axes):
            force, peak = axis.plant.mass * profile.acceleration, axis.drive.peak_force
            allowed = profile.acceleration <= axis.limits.acceleration
            if only in (None, index) and allowed and force > peak:
                reason = f"{profile.acceleration:g} takes {force:.4g} N on axis {name}"
                self.refuse((*at, "acceleration"), f"{reason}, whose drive has {peak:g} N at most")


def why_outside(
    position: float,
    low: float,
    high: float,
    travel: tuple[float, float],
    what: str = "fiducial",
) -> str | None:
    """Why a position, or `what` lies from `low` to `high` around it, is outside the travel."""
    span = f"the travel {travel[0]:g} ... {travel[1]:g} m"
    if not travel[0] <= position <= travel[1]:
        return f"{position:.9g} m is outside {span}"
    if position + low < travel[0] or position + high > travel[1]:
        reach = max(-low, high)
        return f"{position:.9g} m with its {what} {reach:g} m away is outside {span}"
    return None
