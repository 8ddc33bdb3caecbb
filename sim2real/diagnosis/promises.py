"""What a diagnosis promises for moves that it has not seen: of the names, and of the twin.

Both are predictions of held-out moves in the same simulation that a user runs: with the effects
that are named and no others, and with the curves of the twin beside them. Plant figures that the
twin leaves as they are stay so here.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hil_sim.effects import Effect
from hil_sim.effects.library import own_effects
from sim2real.diagnosis.examination import Examination
from sim2real.empirical_force import EmpiricalForce
from sim2real.findings import Cause, Unlisted
from sim2real.fitting import NUISANCES, AxisModel, Term, compose_stage
from sim2real.held_out import FOLDS, HeldOut, Models, Remaining, combined_energy, share_closed
from sim2real.open_loop import MotionLoop, measure_motion
from sim2real.phases import OTHER_KIND, kinds_of_moves, split_moves, top_speeds
from sim2real.rivals import GROUPS, Description, describe_force

_TOLERANCE = 1e-4
"""Relative standard deviation of the plant's figures beside a description, which stay."""
_OF_OTHERS = 0.5
"""Part of what is closed that moves of another kind may show where a recording has one kind: on
EMPS 0.74 became 0.52 (docs/emps.md)."""
_FEW = 6
"""Most kinds of moves of a program that is repeated throughout, of which others tell nothing."""
_LITTLE = 0.02
"""Share of the gap that a description has to close beside the names, or beside a simpler one."""


@dataclass(frozen=True, slots=True, eq=False)
class Promises:
    """What is promised.

    Attributes:
        named: what the named effects leave of held-out moves; by the machine file without any.
        forces: descriptions of what no effect explains, that a twin gets.
        twin: what names and descriptions leave.
        folds: the models that predict the moves of each of `GROUPS`.
        models: of the names, fitted to all moves.
    """

    named: Remaining
    forces: tuple[EmpiricalForce, ...]
    twin: Remaining
    folds: Sequence[Models]
    models: Models


def promise(held_out: HeldOut, models: Models, causes: Sequence[Cause]) -> Promises:
    """Predict held-out moves by the effects named.

    Args:
        held_out: models fitted to all moves but a fold's, and what they leave.
        models: of the twin: figures as it has them, all effects fitted.
        causes: that are named.
    """
    folds = [
        _as_twin(only_causes(held_out.folds[group % FOLDS], causes), models) if causes else {}
        for group in range(GROUPS)
    ]
    left = held_out.leaves(folds[:FOLDS])
    return Promises(left, (), left, folds, only_causes(models, causes) if causes else {})


def describe_rest(
    promised: Promises, examined: Examination, held_out: HeldOut, unlisted: Sequence[Unlisted]
) -> Promises:
    """Predict held-out moves by the twin: with descriptions of what the named effects leave.

    Args:
        promised: by the names alone.
        examined: the recordings.
        held_out: as of `promise`.
        unlisted: coordinates that missing forces depend on.
    """
    left, folds, samples, forces = promised.twin, promised.folds, held_out.samples, []
    gap = combined_energy(held_out.before, samples) - held_out.before.shape[1]
    for candidates in _describe(examined, promised.models, unlisted):
        tried = [t for each in candidates if (t := _try_beside(held_out, folds, each)) is not None]
        if not tried:
            continue
        number = find_simplest([combined_energy(t[0].energies, samples) for t in tried], gap)
        after, beside, force = tried[number]
        _, interval = share_promised(held_out, after)
        fall = combined_energy(left.energies, samples) - combined_energy(after.energies, samples)
        if fall > _LITTLE * gap and interval is not None and interval[0] > 0.0:
            left, folds = after, beside
            forces.append(force)
    return replace(promised, forces=tuple(forces), twin=left, folds=folds)


def find_simplest(left: Sequence[float], gap: float) -> int:
    """Which of several descriptions to take: a later one where it closes clearly more.

    What closes hardly more follows what is this recording's own, such as the wander of friction.

    Args:
        left: squared gap over floor that each leaves of held-out moves, the simplest first.
        gap: that is described, likewise.
    """
    best = 0
    for number, energy in enumerate(left):
        if left[best] - energy > _LITTLE * gap:
            best = number
    return best


def _try_beside(
    held_out: HeldOut, folds: Sequence[Models], found: Description
) -> tuple[Remaining, list[dict[str, AxisModel]], EmpiricalForce] | None:
    """What models leave with a description, and both; None where they cannot be simulated."""
    beside = [with_force(models, force) for models, force in zip(folds, found.folds, strict=True)]
    try:
        return held_out.leaves(beside), beside, found.force
    except ValueError:
        return None


def share_promised(
    held_out: HeldOut, left: Remaining
) -> tuple[float | None, tuple[float, float] | None]:
    """Share of the gap that is closed on held-out moves, and its interval.

    Args:
        held_out: energies of the moves.
        left: of them, by models.
    """
    return share_closed(held_out.before, left.energies, held_out.samples)


def widened(interval: tuple[float, float] | None) -> tuple[float, float] | None:
    """An interval of a share where the moves do not show how others go; None stays None."""
    if interval is None:
        return None
    return min(interval[0], _OF_OTHERS * interval[0]), interval[1]


def have_one_speed(examined: Examination, axis: str) -> bool:
    """Whether all strokes of an axis reach the same speed: nothing predicts another one's."""
    speeds = [
        speed
        for m in examined.measured
        for speed in top_speeds(m.replay.recording.axes[axis].position_demand, m.replay.period)
    ]
    return bool(speeds) and min(speeds) > (1.0 - OTHER_KIND) * max(speeds)


def are_alike(examined: Examination) -> bool:
    """Whether all moves repeat a few: one pair there and back, or the moves of a short program.

    What predicts these need not predict others: with its other joints, a robot in a cycle does the
    same at the same places every time.
    """
    if len(examined.measured) != 1:
        return False
    replay = examined.measured[0].replay
    moves = split_moves(replay.recording, replay.period)
    pairs = [(one.start, other.stop) for one, other in zip(moves[::2], moves[1::2], strict=False)]
    if len(set(kinds_of_moves(replay.recording, pairs))) < 2:
        return True
    of_kind = Counter(kinds_of_moves(replay.recording, [(m.start, m.stop) for m in moves]))
    return len(of_kind) <= _FEW and min(of_kind.values()) > 1


def less_certain(found: Unlisted) -> Unlisted:
    """A coordinate where all moves are alike: others may show that it was another one."""
    low, high = found.gap_closed_interval
    return replace(
        found,
        probability=_OF_OTHERS * found.probability,
        gap_closed_interval=(_OF_OTHERS * low, high),
    )


def only_causes(models: Models, causes: Sequence[Cause]) -> dict[str, AxisModel]:
    """The models without effects that are no causes."""
    named = {(cause.axis, cause.effect) for cause in causes}
    return {
        name: replace(model, terms=tuple(t for t in model.terms if (name, t.name) in named))
        for name, model in models.items()
    }


def _as_twin(fold: Models, models: Models) -> dict[str, AxisModel]:
    """A fold's models, with figures changed only where the twin changes them."""
    return {
        name: replace(model, base=np.where(models[name].base == 0.0, 0.0, model.base))
        for name, model in fold.items()
    }


def with_force(models: Models, force: EmpiricalForce) -> dict[str, AxisModel]:
    """Models of a stage with a force that no effect explains; an axis without one is nominal."""
    library: Mapping[str, Effect] = own_effects()
    model = models.get(force.axis, AxisModel(np.zeros(NUISANCES)))
    for name, values in force.effects():
        ordered: Any = tuple(values[p.key] for p in library[name].parameters)
        model = model.added(Term(library[name], ordered))
    return {**models, force.axis: model}


def _describe(
    examined: Examination, twin: Models, unlisted: Sequence[Unlisted]
) -> list[tuple[Description, ...]]:
    """For each axis, descriptions of what a twin with these models leaves of its force."""
    settings = compose_stage(examined.settings, twin)
    motions = examined.motions or tuple(
        measure_motion(m.replay.recording, replace(settings, start=m.replay.start))
        for m in examined.measured
    )
    found = []
    for name in examined.gap or {}:
        own = [u for u in unlisted if u.axis == name]
        found.append(describe_force(MotionLoop(name, motions, settings, _TOLERANCE), own))
    return found
