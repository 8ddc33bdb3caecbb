"""From a recipe to a flat list of frozen steps, which `run` executes and `--dry-run` counts.

The same recipe and start always give the same steps. Only the targets of micro-moves onto a mark
are open; the fiducial provides them during the run. The steps form segments (a site, or one entry
of a list of moves): after a fault or an interruption, a segment is repeated from its first step.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from stagectl.recipe.model import Excite, Excursion, Move, Pair, Recipe, To, unroll
from stagectl.recipe.schema import Dwell, Kind, NoMark, Profile, Settle


@dataclass(frozen=True, slots=True)
class MoveStep:
    """Move both axes to rest at a target.

    Attributes:
        site: its site, from 1; None in a list of moves.
        kind: macro, micro, creep or other.
        target: absolute position [m]; None for a relative move and for a micro-move, whose target
            comes from the fiducial.
        profile: limits of the motion, per axis.
        relative: signed distance from the last target [m], instead of `target`.
        place: where its friction estimate belongs [m], if not at the site or the target.
    """

    site: int | None
    kind: Kind
    target: Pair | None
    profile: Profile
    relative: Pair | None = None
    place: Pair | None = None

    def end(self, position: Sequence[float], mark: Pair | None) -> Pair | None:
        """Where it leads from a position, by the mark if that is its target; None without one."""
        if self.relative is not None:
            return position[0] + self.relative[0], position[1] + self.relative[1]
        return self.target or mark


@dataclass(frozen=True, slots=True)
class FiducialStep:
    """Locate the mark of this site, the target of the next micro-move."""

    site: int


@dataclass(frozen=True, slots=True)
class ExposeStep:
    """Hold still during an exposure of `duration` [s]."""

    duration: float


@dataclass(frozen=True, slots=True)
class DoneStep:
    """The end of a segment: a run interrupted after it resumes with the next segment.

    Attributes:
        number: of the segment, from 1.
        site: the same number if the recipe has sites; None in a list of moves.
    """

    number: int
    site: int | None


Step = MoveStep | Excite | Settle | FiducialStep | ExposeStep | Dwell
MarkedStep = Step | DoneStep


def plan(recipe: Recipe, start: Pair = (0.0, 0.0)) -> tuple[Step, ...]:
    """The steps of a recipe in order.

    Args:
        recipe: a validated recipe.
        start: position of the axes at the start [m], home by default. Only the direction of an
            axis' first `reverse` can depend on it.
    """
    return tuple(step for _, steps in _segments(recipe, start) for step in steps)


def plan_from(recipe: Recipe, done: int, start: Pair = (0.0, 0.0)) -> tuple[MarkedStep, ...]:
    """The steps after the first `done` segments, with a `DoneStep` at the end of each segment.

    A list of moves that resumes in the middle first moves to where it was.

    Args:
        recipe: a validated recipe.
        done: number of finished segments.
        start: as for `plan`.
    """
    steps: list[MarkedStep] = []
    for number, (origin, segment) in enumerate(_segments(recipe, start), 1):
        if number <= done:
            continue
        if recipe.moves and done and not steps:
            steps.append(MoveStep(None, "other", origin, recipe.macro))
        steps += [*segment, DoneStep(number, None if recipe.moves else number)]
    return tuple(steps)


def count_segments(recipe: Recipe) -> int:
    """Number of sites, or of entries of a list of moves with its repeats unrolled."""
    return len(recipe.sites) or sum(1 for _ in walk(recipe.moves, (0.0, 0.0)))


def _segments(recipe: Recipe, start: Pair) -> Iterator[tuple[Pair, tuple[Step, ...]]]:
    """Each segment with its start position."""
    settle = recipe.settle
    origin = start
    if recipe.moves:
        for _, position, step in walk(recipe.moves, start):
            # Macro- and micro-moves wait for the settle window; creeps and reversals do not.
            waits = isinstance(step, MoveStep) and step.kind in ("macro", "micro")
            yield origin, (step, settle) if waits else (step,)
            origin = position
        return
    for site, position in enumerate(recipe.sites, 1):
        steps: list[Step] = [MoveStep(site, "macro", position, recipe.macro), settle]
        if not isinstance(recipe.fiducial, NoMark):
            steps += [FiducialStep(site), MoveStep(site, "micro", None, recipe.micro), settle]
        if recipe.expose > 0:
            steps.append(ExposeStep(recipe.expose))
        steps += _excursions(recipe.excursions, site, position, settle)
        for after, place in recipe.slipped:
            if after == site:
                steps += [MoveStep(None, "macro", place, recipe.macro), settle]
                steps += _excursions(recipe.slipped_excursions, None, place, settle)
        yield origin, tuple(steps)
        origin = position


def _excursions(
    excursions: Sequence[Excursion], site: int | None, place: Pair, settle: Settle
) -> Iterator[Step]:
    """The calibration moves at a place, each followed by settling."""
    for excursion in excursions:
        (x, y), (dx, dy) = place, excursion.offset
        target = (round(x + dx, 12), round(y + dy, 12))
        yield MoveStep(site, excursion.kind, target, excursion.profile, place=place)
        yield settle


def walk(
    moves: tuple[Move, ...], start: Pair
) -> Iterator[tuple[tuple[str | int, ...], Pair, MoveStep | Excite | Dwell]]:
    """A list of moves, unrolled: location in the recipe file, position afterwards [m], step.

    An axis that has not moved yet is taken to have moved in the negative direction, so its first
    `reverse` is positive.
    """
    position = list(start)
    direction = [-1.0, -1.0]
    for location, move in unroll(moves):
        step: MoveStep | Excite | Dwell
        if isinstance(move, Dwell | Excite):
            step = move
        elif isinstance(move, To):
            for axis, target in enumerate(move.target):
                if abs(target - position[axis]) >= 1e-9:
                    direction[axis] = 1.0 if target > position[axis] else -1.0
                position[axis] = target
            step = MoveStep(None, move.kind, move.target, move.profile)
        else:
            relative = [0.0, 0.0]
            direction[move.axis] *= -1.0
            relative[move.axis] = direction[move.axis] * move.distance
            position[move.axis] = round(position[move.axis] + relative[move.axis], 12)
            step = MoveStep(None, move.kind, None, move.profile, (relative[0], relative[1]))
        yield location, (position[0], position[1]), step
