"""From a recipe to a flat list of frozen steps: what `run` does and what `--dry-run` counts.

Pure: the same recipe and start give the same steps. Only the targets of micro-moves onto a
fiducial are open; they come from the fiducial while the recipe runs. The steps come in stretches
that are done as a whole or again from their first step: a site, or one entry of a list of moves.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from stagectl.recipe.model import (
    Dwell,
    Excursion,
    Kind,
    Move,
    NoMark,
    OnTimeout,
    Pair,
    Profile,
    Recipe,
    Settle,
    To,
    unroll,
)


@dataclass(frozen=True, slots=True)
class MoveStep:
    """Move both axes to rest at a target.

    Attributes:
        site: site it belongs to, from 1; None in a list of moves.
        kind: macro, micro, creep or other.
        target: absolute position [m]; None for a micro-move, whose target the fiducial gives, and
            for a relative move.
        profile: limits of the motion, for each axis.
        relative: signed distance from the last target [m] instead of `target`.
        place: whose friction it shows, where that is not the site's or the target's [m]: of a
            calibration slipped in.
    """

    site: int | None
    kind: Kind
    target: Pair | None
    profile: Profile
    relative: Pair | None = None
    place: Pair | None = None


@dataclass(frozen=True, slots=True)
class SettleStep:
    """Wait until both axes stay in `window` [m] for `hold` [s], at most `timeout` [s]."""

    window: float
    hold: float
    timeout: float
    on_timeout: OnTimeout


@dataclass(frozen=True, slots=True)
class FiducialStep:
    """Ask where the mark of this site is; the next micro-move goes there."""

    site: int


@dataclass(frozen=True, slots=True)
class ExposeStep:
    """Hold still while the camera takes its picture: `duration` [s]."""

    duration: float


@dataclass(frozen=True, slots=True)
class DwellStep:
    """Hold still for `duration` [s]."""

    duration: float


@dataclass(frozen=True, slots=True)
class DoneStep:
    """A stretch is over: a run that is interrupted from here on goes on behind it.

    Attributes:
        number: of the stretch, from 1.
        site: the same, where the recipe has sites; None in a list of moves.
    """

    number: int
    site: int | None


Step = MoveStep | SettleStep | FiducialStep | ExposeStep | DwellStep
MarkedStep = Step | DoneStep


def plan(recipe: Recipe, start: Pair = (0.0, 0.0)) -> tuple[Step, ...]:
    """The steps of a recipe in their order.

    Args:
        recipe: a validated recipe.
        start: where the axes are when it begins [m] (home by default); only the direction of the
            first `reverse` of an axis can depend on it.
    """
    return tuple(step for _, steps in _stretches(recipe, start) for step in steps)


def plan_from(recipe: Recipe, done: int, start: Pair = (0.0, 0.0)) -> tuple[MarkedStep, ...]:
    """The steps after the first `done` stretches, each stretch with a `DoneStep` at its end.

    A list of moves that goes on in its middle begins with a move to where it was.

    Args:
        recipe: a validated recipe.
        done: stretches that are over, 0 for none.
        start: as `plan`.
    """
    steps: list[MarkedStep] = []
    for number, (origin, stretch) in enumerate(_stretches(recipe, start), 1):
        if number <= done:
            continue
        if recipe.moves and done and not steps:
            steps.append(MoveStep(None, "other", origin, recipe.macro))
        steps += [*stretch, DoneStep(number, None if recipe.moves else number)]
    return tuple(steps)


def _stretches(recipe: Recipe, start: Pair) -> Iterator[tuple[Pair, tuple[Step, ...]]]:
    """Each stretch with the position that it begins at."""
    settle = _settle_step(recipe.settle)
    origin = start
    if recipe.moves:
        for _, position, step in walk(recipe.moves, start):
            # Macro- and micro-moves wait for the settle window; creeps and reversals run on.
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
        for behind, place in recipe.slipped:
            if behind == site:
                steps += [MoveStep(None, "macro", place, recipe.macro), settle]
                steps += _excursions(recipe.slipped_excursions, None, place, settle)
        yield origin, tuple(steps)
        origin = position


def _excursions(
    excursions: Sequence[Excursion], site: int | None, place: Pair, settle: SettleStep
) -> Iterator[Step]:
    """The moves of a calibration at a place, each with the wait for rest."""
    for excursion in excursions:
        (x, y), (dx, dy) = place, excursion.offset
        target = (round(x + dx, 12), round(y + dy, 12))
        yield MoveStep(site, excursion.kind, target, excursion.profile, place=place)
        yield settle


def walk(
    moves: tuple[Move, ...], start: Pair
) -> Iterator[tuple[tuple[str | int, ...], Pair, MoveStep | DwellStep]]:
    """A list of moves unrolled: place in the recipe file, position afterwards [m], step.

    An axis that has not moved yet counts as having last moved in the negative direction, so that
    its first `reverse` goes in the positive one.
    """
    position = list(start)
    direction = [-1.0, -1.0]
    for location, move in unroll(moves):
        step: MoveStep | DwellStep
        if isinstance(move, Dwell):
            step = DwellStep(move.duration)
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


def _settle_step(settle: Settle) -> SettleStep:
    return SettleStep(settle.window, settle.hold, settle.timeout, settle.on_timeout)
