"""Dry run of a recipe: number of moves, path, duration and use of the axis limits, without a bus.

The duration is the sum of time-optimal moves, hold times after them, exposures and dwells. It
leaves out homing, settling and retries, so a run takes at least this long.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import asdict, dataclass, field
from functools import cache
from typing import TYPE_CHECKING

from stagectl.config import Machine
from stagectl.recipe.fiducial import Fiducial, make_fiducial
from stagectl.recipe.model import Excite, Pair, Recipe
from stagectl.recipe.plan import ExposeStep, FiducialStep, MarkedStep, MoveStep, plan_from
from stagectl.recipe.schema import Dwell, PluginMark, Profile, Settle, SimulatedMark

if TYPE_CHECKING:
    from rich.console import RenderableType

_UNITS = {"velocity": "m/s", "acceleration": "m/s^2", "jerk": "m/s^3"}


@dataclass(frozen=True, slots=True)
class LimitUse:
    """The largest demand of a recipe on one limit of one axis.

    Attributes:
        quantity: velocity, acceleration, jerk, lowest or highest (position).
        used, limit: in `unit`.
    """

    axis: str
    quantity: str
    used: float
    limit: float
    unit: str


@dataclass(frozen=True, slots=True)
class DryRun:
    """The result of a dry run.

    Attributes:
        sites: number of sites to visit.  moves: number of moves by kind.
        path_length: sum of the straight distances [m].  duration: lower bound [s].
        limits: use of each limit.  positions: targets in order [m].
        notes: what is not counted, and keys of the recipe without effect.
    """

    recipe: str
    machine: str
    sites: int
    moves: dict[str, int]
    path_length: float
    duration: float
    limits: tuple[LimitUse, ...]
    positions: tuple[Pair, ...]
    notes: tuple[str, ...]

    def as_dict(self) -> dict[str, object]:
        """The result for `--json`, in SI units."""
        return {"format": "stagectl-dry-run", "version": 1, **asdict(self)}

    def render(self) -> RenderableType:
        """The result for a terminal."""
        from rich.console import Group
        from rich.table import Table

        moves = ", ".join(f"{count} {kind}" for kind, count in self.moves.items()) or "none"
        head = Table.grid(padding=(0, 2))
        head.add_row("recipe", f"{self.recipe} on {self.machine} (dry run: nothing moves)")
        head.add_row("sites", str(self.sites))
        head.add_row("moves", moves)
        head.add_row("path", f"{self.path_length * 1e3:.3f} mm")
        head.add_row("duration", f"at least {self.duration:.2f} s")
        table = Table(title="Use of the axis limits", title_justify="left")
        for title in ("axis", "quantity", "used", "limit", "unit"):
            table.add_column(title, justify="right" if title in ("used", "limit") else "left")
        for use in self.limits:
            table.add_row(use.axis, use.quantity, f"{use.used:.6g}", f"{use.limit:.6g}", use.unit)
        return Group(head, table, *(f"note: {note}" for note in self.notes))


def dry_run(recipe: Recipe, machine: Machine, done: int = 0) -> DryRun:
    """Walk through the plan without moving.

    Args:
        recipe: validated against `machine`.
        machine: to run it on.
        done: sites, or entries of the list of moves, that an interrupted run has finished.

    Raises:
        ConfigError: the recipe's fiducial plug-in cannot be loaded.
    """
    tally = _Tally(recipe)
    for step in plan_from(recipe, done):
        tally.add(step)
    return DryRun(
        recipe=recipe.name,
        machine=machine.name,
        sites=max(len(recipe.sites) - done, 0),
        moves=dict(tally.moves),
        path_length=tally.path_length,
        duration=tally.duration,
        limits=_limits(recipe, machine, tally),
        positions=tuple(tally.positions),
        notes=(*recipe.notes, *tally.notes),
    )


@cache
def _duration(distance: float, profile: Profile) -> float:
    """Duration of a move [s]. Distances come rounded to nm, so equal steps hit the cache."""
    from estimation.trajectory import duration

    if distance <= 0:
        return 0.0
    return duration(distance, profile.velocity, profile.acceleration, profile.jerk)


@dataclass
class _Tally:
    """The position in the plan, and the totals so far."""

    recipe: Recipe
    moves: Counter[str] = field(default_factory=Counter)
    path_length: float = 0.0
    duration: float = 0.0
    positions: list[Pair] = field(default_factory=list)
    profiles: dict[int, set[Profile]] = field(default_factory=lambda: {0: set(), 1: set()})
    notes: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.position = (0.0, 0.0)
        self.mark: Pair | None = None
        self.fiducial: Fiducial | None = None
        source = self.recipe.fiducial
        if isinstance(source, PluginMark):
            self.notes.append(
                f"marks come from the plug-in '{source.name}': micro-moves are counted, not timed"
            )
        else:
            self.fiducial = make_fiducial(source)
            if isinstance(source, SimulatedMark):
                self.notes.append("marks are simulated; a run finds the same ones")

    def add(self, step: MarkedStep) -> None:
        """Add a step."""
        match step:
            case MoveStep():
                self._move(step)
            case Settle():
                self.duration += step.hold
            case Excite():
                self.duration += step.duration
                self.moves["excitation"] += 1
                self.profiles[step.axis].add(step.profile)
                for reach in (-step.amplitude, step.amplitude):
                    around = list(self.position)
                    around[step.axis] += reach
                    self.positions.append((around[0], around[1]))
            case ExposeStep() | Dwell():
                self.duration += step.duration
            case FiducialStep():
                site = self.recipe.sites[step.site - 1]
                offset = self.fiducial.find(step.site, site) if self.fiducial else (0.0, 0.0)
                self.mark = offset and (site[0] + offset[0], site[1] + offset[1])
                if offset is None:
                    self.notes.append(f"site {step.site}: no mark listed, no micro-move")

    def _move(self, step: MoveStep) -> None:
        target = step.end(self.position, self.mark)
        if target is None:
            return
        steps = (abs(target[0] - self.position[0]), abs(target[1] - self.position[1]))
        self.duration += max(_duration(round(d, 9), step.profile) for d in steps)
        self.path_length += math.hypot(*steps)
        self.moves[step.kind] += 1
        self.position = target
        self.positions.append(target)
        for axis in (0, 1):
            if step.relative is None or step.relative[axis]:
                self.profiles[axis].add(step.profile)


def _limits(recipe: Recipe, machine: Machine, tally: _Tally) -> tuple[LimitUse, ...]:
    uses: list[LimitUse] = []
    for k, name in enumerate(recipe.axes):
        axis = machine.axes[name]
        for quantity, unit in _UNITS.items():
            used = max((getattr(p, quantity) for p in tally.profiles[k]), default=0.0)
            uses.append(LimitUse(name, quantity, used, getattr(axis.limits, quantity), unit))
        visited = [position[k] for position in tally.positions] or [0.0]
        uses.append(LimitUse(name, "lowest", min(visited), axis.travel[0], "m"))
        uses.append(LimitUse(name, "highest", max(visited), axis.travel[1], "m"))
    return tuple(uses)
