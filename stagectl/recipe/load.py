"""From a recipe file to a `Recipe` that the machine can run, or to all reasons why it cannot.

Checked before anything moves: each value by itself (schema), sites and moves against the travel
(micro-moves included), profiles against the axis limits, and files that the recipe names.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path

from stagectl.config import Axis, Machine
from stagectl.config.validation import sort_problems, suggest, validate
from stagectl.config.yaml_nodes import Document, load_document, parse_document
from stagectl.errors import ConfigError
from stagectl.recipe import schema
from stagectl.recipe.duration_limit import MAX_MOVE, why_too_long
from stagectl.recipe.fiducial import ENTRY_POINTS
from stagectl.recipe.model import (
    MAX_STEPS,
    Dwell,
    Excite,
    FiducialSource,
    ListedMarks,
    Move,
    NoMark,
    Pair,
    PluginMark,
    Profile,
    Recipe,
    Repeat,
    Reverse,
    Settle,
    SimulatedMark,
    SiteLimits,
    To,
    count_unrolled,
)
from stagectl.recipe.plan import ExciteStep, MoveStep, walk
from stagectl.recipe.tables import read_offsets, read_sites

Location = tuple[str | int, ...]
Place = Callable[[str], str]
"""Makes the line of a problem from its reason."""

MAX_SITES = 100_000
MOST_BAND = 0.25
"""Highest frequency of an excitation over that of SYNC: straight lines join the setpoints."""
LEAST_PERIODS = 4
"""Fewest periods of an excitation's lowest frequency."""
MOTION_KEYS = ("velocity", "acceleration", "jerk")


def load_recipe(path: Path | str, machine: Machine) -> Recipe:
    """The recipe of a file, checked against the machine.

    Raises:
        ConfigError: the recipe cannot be run on this machine; one line per problem.
    """
    return _recipe(load_document(path), machine)


def parse_recipe(text: str, name: str, machine: Machine) -> Recipe:
    """The recipe of a text; the files it names are relative to `name`.

    Raises:
        ConfigError: as `load_recipe`.
    """
    return _recipe(parse_document(text, name), machine)


def _recipe(document: Document, machine: Machine) -> Recipe:
    check = _Check(document, machine)
    file = validate(document, schema.RecipeFile)
    macro = check.read_profile(file.macro, ("macro",))
    micro = check.read_profile(file.micro, ("micro",))
    sites, places = check.read_sites(file.sites)
    fiducial = check.read_fiducial(file.fiducial, len(sites))
    check.check_keys(file)
    check.check_settle(file.settle)
    if (reason := check.why_never_exceeded(file.settle.window)) is not None:
        check.refuse(("settle", "window"), reason)
    check.check_travel(sites, places, fiducial)
    moves = check.read_moves(file.moves or [], macro, micro, ("moves",))
    check.check_path(moves)
    if check.problems:
        raise ConfigError(sort_problems(check.problems))
    first, second = machine.axes
    unused = [k for k in ("expose", "fiducial") if moves and getattr(file, k) is not None]
    if moves and file.limits != schema.SiteLimitsSection():
        unused.append("limits")
    notes = [f"{key} has no effect with moves" for key in unused]
    if (reason := check.why_never_exceeded(file.limits.peak_error)) is not None:
        notes.append(f"limits.peak_error: {reason}")
    recipe = Recipe(
        name=file.recipe,
        axes=(first, second),
        macro=macro,
        micro=micro,
        settle=Settle(
            file.settle.window, file.settle.hold, file.settle.timeout, file.settle.on_timeout
        ),
        expose=file.expose or 0.0,
        sites=sites,
        fiducial=fiducial,
        moves=moves,
        lot=file.lot,
        wafer=file.wafer,
        limits=SiteLimits(file.limits.settling, file.limits.peak_error),
        text=document.text,
        source=document.name,
        notes=tuple(notes),
    )
    if (reason := why_too_long(recipe)) is not None:
        raise ConfigError(document.problem(("moves",) if moves else ("sites",), reason))
    return recipe


@dataclass
class _Check:
    """Builds the parts of a recipe and collects their problems."""

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
        return list(self.machine.axes.items())

    def refuse(self, location: Location, reason: str) -> None:
        self.problems.append(self.document.problem(location, reason))

    def check_keys(self, file: schema.RecipeFile) -> None:
        """Check which keys require or exclude each other."""
        if file.sites is None and file.moves is None:
            self.refuse(("sites",), "is missing (or a list of moves instead)")
        elif file.sites is not None and file.moves is not None:
            self.refuse(("moves",), "cannot be combined with sites: only one of them")
        elif file.sites is not None:
            for key in ("expose", "fiducial"):
                if getattr(file, key) is None:
                    self.refuse((key,), "is missing")

    def check_settle(self, settle: schema.SettleSection) -> None:
        """Refuse a window below the encoder's increment and a hold beyond the timeout."""
        coarse = max(axis.encoder.increment for _, axis in self.axes)
        if settle.window < coarse:
            self.refuse(("settle", "window"), f"is below the encoder increment, {coarse:g} m")
        if settle.timeout < settle.hold:
            self.refuse(("settle", "timeout"), f"is shorter than hold, {settle.hold:g} s")
        elif settle.timeout > MAX_MOVE:
            reason = f"{settle.timeout:g} s is longer than the longest move, {MAX_MOVE:g} s"
            self.refuse(("settle", "timeout"), reason)

    def why_never_exceeded(self, length: float | None) -> str | None:
        """Why no axis can be this far off without a following error fault, or None."""
        least, name = min((axis.limits.following_error, name) for name, axis in self.axes)
        if length is None or length < least:
            return None
        reason = f"{length:g} m is never exceeded: axis {name} faults at {least:g} m"
        return f"{reason} (limits.following_error)"

    def read_profile(
        self, section: schema.ProfileSection, at: Location, only: int | None = None
    ) -> Profile:
        """The section as a profile, checked against the limits of the axes, or of axis `only`."""
        profile = Profile(section.velocity, section.acceleration, section.jerk)
        self.check_limits(profile, at, only)
        return profile

    def check_limits(self, profile: Profile, at: Location, only: int | None) -> None:
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

    def read_sites(self, sites: object) -> tuple[tuple[Pair, ...], list[Place]]:
        """The sites in the order of visits, and for each a function that places its problems."""

        def place(*location: str | int) -> Place:
            return lambda reason: self.document.problem(location, reason)

        if isinstance(sites, schema.GridSites):
            count = sites.grid.count[0] * sites.grid.count[1]
            if count > MAX_SITES:
                self.refuse(("sites", "grid", "count"), f"more than {MAX_SITES} sites: {count}")
                return (), []
            positions = grid_positions(sites.grid)
            return positions, [place("sites", "grid")] * count
        if isinstance(sites, schema.FileSites):
            try:
                rows = read_sites(Path(self.document.name).parent / sites.file)
            except ConfigError as error:
                self.problems += self.table_problems(("sites", "file"), error)
                return (), []
            return tuple(row.pair for row in rows), [row.problem for row in rows]
        if isinstance(sites, list):
            return tuple(sites), [place("sites", index) for index in range(len(sites))]
        return (), []

    def table_problems(self, location: Location, error: ConfigError) -> list[str]:
        """Problems of a table; those without a line are placed where the recipe names it."""
        if all(re.search(r":\d+:\d+: ", problem) for problem in error.problems):
            return list(error.problems)
        return [self.document.problem(location, str(error))]

    def read_fiducial(self, section: object, sites: int) -> FiducialSource:
        """The source of the marks. Reads files and looks up plug-ins."""
        match section:
            case schema.SimulatedFiducial():
                return SimulatedMark(section.range, section.seed)
            case schema.FileFiducial():
                try:
                    rows = read_offsets(Path(self.document.name).parent / section.file)
                except ConfigError as error:
                    self.problems += self.table_problems(("fiducial", "file"), error)
                    return NoMark()
                self.problems += [
                    row.problem(f"site {row.site} is not in the recipe, which has {sites}")
                    for row in rows
                    if sites and row.site is not None and row.site > sites
                ]
                return ListedMarks({row.site: row.pair for row in rows if row.site is not None})
            case schema.PluginFiducial():
                known = sorted(metadata.entry_points(group=ENTRY_POINTS).names)
                if section.name not in known:
                    reason = f"no plug-in '{section.name}' is installed"
                    reason += suggest(section.name, known)
                    self.refuse(("fiducial", "name"), reason)
                return PluginMark(section.name)
            case _:
                return NoMark()

    def check_travel(
        self, sites: tuple[Pair, ...], places: list[Place], fiducial: FiducialSource
    ) -> None:
        """Check that each site and its micro-move are within the travel."""
        reasons: dict[int, list[str]] = {}
        for index, site in enumerate(sites):
            low = high = (0.0, 0.0)
            if isinstance(fiducial, SimulatedMark):
                low, high = (-fiducial.range,) * 2, (fiducial.range,) * 2
            elif isinstance(fiducial, ListedMarks):
                offset = fiducial.offsets.get(index + 1, (0.0, 0.0))
                low = (min(0.0, offset[0]), min(0.0, offset[1]))
                high = (max(0.0, offset[0]), max(0.0, offset[1]))
            for k, (name, axis) in enumerate(self.axes):
                reason = _outside(site[k], low[k], high[k], axis.travel)
                if reason:
                    reasons.setdefault(index, []).append(f"{reason} of axis {name}")
        first = next(iter(reasons), None)
        if first is not None and len(set(places)) == 1 < len(places):  # a grid: one place for all
            more = f" ({len(reasons)} sites in all)" if len(reasons) > 1 else ""
            reasons = {first: [reasons[first][0] + more]}
        for index, lines in list(reasons.items())[:100]:
            self.problems += [places[index](f"site {index + 1}: {line}") for line in lines]

    def read_moves(
        self, items: list[schema.MoveItem], macro: Profile, micro: Profile, at: Location
    ) -> tuple[Move, ...]:
        """The list of moves with complete profiles, checked against the limits."""
        names = [name for name, _ in self.axes]
        moves: list[Move] = []
        for index, item in enumerate(items):
            here = (*at, index)
            match item:
                case schema.DwellItem():
                    moves.append(Dwell(item.dwell))
                case schema.ExciteItem():
                    if (excite := self.read_excite(item, micro, here)) is not None:
                        moves.append(excite)
                    else:
                        moves.append(Dwell(0.0))  # a placeholder, as below
                case schema.RepeatItem():
                    inner = self.read_moves(item.moves, macro, micro, (*here, "moves"))
                    moves.append(Repeat(item.repeat, inner))
                case schema.ToItem():
                    moves.append(To(item.to, item.kind, self.read_motion(item, macro, micro, here)))
                case schema.ReverseItem():
                    if item.axis not in names:
                        reason = f"no such axis in the machine{suggest(item.axis, names)}"
                        self.refuse((*here, "axis"), reason)
                        moves.append(Dwell(0.0))  # a placeholder keeps the indices of the others
                        continue
                    axis = names.index(item.axis)
                    profile = self.read_motion(item, macro, micro, here, axis)
                    moves.append(Reverse(item.reverse, axis, item.kind, profile))
        return tuple(moves)

    def read_excite(self, item: schema.ExciteItem, micro: Profile, at: Location) -> Excite | None:
        """An excitation, its band below what the SYNC can carry; None where it has problems."""
        names = [name for name, _ in self.axes]
        if item.excite not in names:
            reason = f"no such axis in the machine{suggest(item.excite, names)}"
            self.refuse((*at, "excite"), reason)
            return None
        low, high = item.band
        most = MOST_BAND / self.machine.bus.sync_period
        if not low < high:
            self.refuse((*at, "band"), f"must be [lowest, highest], is [{low:g}, {high:g}] Hz")
        elif high > most:
            self.refuse((*at, "band"), f"{high:g} Hz is above {most:g} Hz, a quarter of the SYNC's")
        elif item.duration * low < LEAST_PERIODS:
            self.refuse((*at, "duration"), f"is shorter than {LEAST_PERIODS} periods of {low:g} Hz")
        axis = names.index(item.excite)
        profile = self.read_motion(item, micro, micro, at, axis)
        return Excite(axis, item.shape, item.amplitude, (low, high), item.duration, profile)

    def read_motion(
        self,
        item: schema.ToItem | schema.ReverseItem | schema.ExciteItem,
        macro: Profile,
        micro: Profile,
        at: Location,
        only: int | None = None,
    ) -> Profile:
        """The profile of a move: its own limits, else its kind's; a creep needs a velocity."""
        kind = "other" if isinstance(item, schema.ExciteItem) else item.kind
        base = macro if kind == "macro" else micro
        if kind == "creep" and item.velocity is None:
            self.refuse((*at, "velocity"), "is missing: a creep needs a velocity of its own")
        profile = Profile(
            item.velocity or base.velocity,
            item.acceleration or base.acceleration,
            item.jerk or base.jerk,
        )
        if profile != base:
            self.check_limits(profile, at, only)
        return profile

    def check_path(self, moves: tuple[Move, ...]) -> None:
        """Check that every position is within the travel, starting from home."""
        if (total := count_unrolled(moves)) > MAX_STEPS:
            self.refuse(("moves",), f"unrolls to {total} moves and dwells, more than {MAX_STEPS}")
            return
        seen: set[tuple[Location, int]] = set()
        for location, position, step in walk(moves, (0.0, 0.0)):
            if isinstance(step, ExciteStep):
                k, reach = step.excitation.axis, step.excitation.amplitude
                name, axis = self.axes[k]
                reason = _outside(position[k], -reach, reach, axis.travel, "excitation")
                if reason and (location, k) not in seen:
                    seen.add((location, k))
                    self.refuse((*location, "amplitude"), f"{reason} of axis {name}")
                continue
            for k, (name, axis) in enumerate(self.axes):
                reason = _outside(position[k], 0.0, 0.0, axis.travel)
                if reason and isinstance(step, MoveStep) and (location, k) not in seen:
                    if step.relative is not None and step.relative[k] == 0:
                        continue  # it was outside already, by a move that is reported
                    seen.add((location, k))
                    key = "to" if step.relative is None else "reverse"
                    self.refuse((*location, key), f"{reason} of axis {name}")


def grid_positions(grid: schema.Grid) -> tuple[Pair, ...]:
    """Positions row by row along the first axis; in a serpentine every second row is reversed."""
    columns, rows = grid.count
    positions = []
    for row in range(rows):
        order = range(columns)
        if grid.order == "serpentine" and row % 2:
            order = range(columns - 1, -1, -1)
        for column in order:
            x = grid.origin[0] + column * grid.pitch[0]
            y = grid.origin[1] + row * grid.pitch[1]
            positions.append((round(x, 12), round(y, 12)))
    return tuple(positions)


def _outside(
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
