"""What is fed forward of what moves have lacked: no cause without evidence against its rivals.

One move may look like any of several causes: mass, lead and coupling share the course of the
acceleration, and forces over position look like a mass on every path anew. Moves are therefore
kept in groups, by direction and length, and a cause is fed forward if two groups agree on it: one
value explains what both lacked, and no rival explains either as well, by what the other group shows
of it. The force per acceleration is one such cause; whether mass or motor constant
make it, moves do not tell.

See docs/reference/observer.md, learning from whole moves.
"""

from __future__ import annotations

import math

import numpy as np

from estimation.least_squares import cholesky_inverse
from estimation.move_group import GROUPS, move_group
from estimation.observer.feedforward_error import SCALE, FeedforwardError
from stagedata import F64
from stagedata.compiled import kernel, machine_code

KEPT = 0.9
"""Weight of a move relative to the next one: the figures may change."""
EXPLAINED = 0.25
"""A value explains moves where it leaves at most this share of what the best one for them takes
off."""
SIGNIFICANT = 3.0
"""Standard deviations by which a value must exceed `BIAS`, and by which rivals do worse."""
BIAS = np.array([5e-4, 5e-5, 5e-4])
"""What moves may show that lack nothing: up to 0.05 % of the mass, and 30 us of lead on the virtual
stage, whose integration step is 20 us early."""
LIKELY = SCALE
"""Spread before the first move, 1 sigma."""
LEAST, MOST = np.array([-0.9, -1e-3, -0.3]), np.array([np.inf, 1e-3, 0.3])
"""What is beyond is something else: an axis has a mass, and neither a lead of more than a SYNC nor
a coupling of more than a third of it."""


class LearnedFeedforward:
    """What is fed forward besides the planned force.

    Attributes:
        value: `MASS`, `LEAD`, `COUPLING` by all moves together, (3,).
        fed: what is fed forward of them, (3,).
    """

    def __init__(self) -> None:
        self.value: F64 = np.zeros(3)
        self.fed: F64 = np.zeros(3)
        self._information: F64 = np.zeros((GROUPS, 3, 3))
        self._pull: F64 = np.zeros((GROUPS, 3))
        self._each: F64 = np.zeros((3, 4, 4))
        limits = (LIKELY, BIAS, LEAST, MOST)
        scratch = (np.zeros((GROUPS, 3, 3)), np.zeros((GROUPS, 3)), np.zeros((3, 4, 4)))
        rest = np.zeros(3), np.zeros((3, 3))
        self._take_in = machine_code(take_in, *rest, 0, np.zeros(3), *scratch)
        self._decide = machine_code(decide, *scratch, limits, np.zeros(3), np.zeros(3))

    def take(self, error: FeedforwardError) -> None:
        """Learn from a move that was made with `fed`: what it lacked comes on top."""
        group = move_group(error.travel, error.rested)
        self._take_in(
            error.value, error.information, group, self.fed, self._information, self._pull,
            self._each,
        )  # fmt: skip
        self._decide(
            self._information, self._pull, self._each, (LIKELY, BIAS, LEAST, MOST), self.value,
            self.fed,
        )  # fmt: skip


@kernel()
def take_in(error, shown, group, fed, information, pull, each):  # type: ignore[no-untyped-def]
    """Take in what a move lacked.

    Args:
        error: what it lacked, (3,).
        shown: inverse of the covariance of that, (3, 3).
        group: of the move.
        fed: what was fed forward, (3,).
        information: of each group, sum of `shown` over its moves, weighted; changed, (G, 3, 3).
        pull: sum of `shown` times what was lacking in all, likewise, (G, 3).
        each: for each cause, sum over the moves of what it explains of each by a value of the
            move's own: w' each w, with w = (1, -x) where x is explained already, (3, 4, 4).
    """
    information *= KEPT
    pull *= KEPT
    each *= KEPT
    along = np.empty(4)
    for i in range(3):
        along[0] = 0.0
        for j in range(3):
            along[0] += shown[i, j] * (fed[j] + error[j])
            along[1 + j] = shown[i, j]
            information[group, i, j] += shown[i, j]
        pull[group, i] += along[0]
        if shown[i, i] > 0.0:
            for j in range(4):
                for k in range(4):
                    each[i, j, k] += along[j] * along[k] / shown[i, i]


@kernel()
def decide(information, pull, each, limits, value, fed):  # type: ignore[no-untyped-def]
    """Choose what is fed forward, one cause after another.

    Args:
        information: as of `take_in`.
        pull: likewise.
        each: likewise.
        limits: `LIKELY`, `BIAS`, `LEAST`, `MOST`.
        value: written, (3,).
        fed: written, (3,).
    """
    likely, _, least, most = limits
    chosen, allowed = np.zeros(3, np.bool_), np.ones(3, np.bool_)
    _solve(information, pull, likely, allowed, value)
    while True:
        _solve(information, pull, likely, chosen, fed)
        beyond = False
        for i in range(3):
            if not least[i] <= fed[i] <= most[i]:  # of something else, which the others are not
                chosen[i], allowed[i], beyond = False, False, True
        if beyond:
            continue
        best, largest = -1, 0.0
        for i in range(3):
            if allowed[i] and not chosen[i]:
                gain = _gain_of(i, information, pull, each, limits, fed)
                if gain > largest:
                    best, largest = i, gain
        if best < 0:
            return
        chosen[best] = True


@kernel()
def _solve(information, pull, likely, chosen, value):  # type: ignore[no-untyped-def]
    """The chosen causes' values by all groups together; 0 of the others."""
    normal, right = np.zeros((3, 3)), np.zeros(3)
    for i in range(3):
        value[i], normal[i, i] = 0.0, likely[i] ** -2.0
        if not chosen[i]:
            continue
        for g in range(GROUPS):
            right[i] += pull[g, i]
            for j in range(3):
                if chosen[j]:
                    normal[i, j] += information[g, i, j]
    cholesky_inverse(normal)
    for i in range(3):
        for j in range(3):
            value[i] += normal[i, j] * right[j]


@kernel()
def _gain_of(cause, information, pull, each, limits, fed):  # type: ignore[no-untyped-def]
    """What a cause beside those fed forward takes off all moves; 0 where it may not be fed."""
    likely, bias, _, _ = limits
    open_pull, own = np.zeros((GROUPS, 3)), np.zeros((GROUPS, 3))
    known, total = 0.0, 0.0
    for g in range(GROUPS):
        for i in range(3):
            open_pull[g, i] = pull[g, i]
            for j in range(3):
                open_pull[g, i] -= information[g, i, j] * fed[j]
            own[g, i] = open_pull[g, i] / (information[g, i, i] + likely[i] ** -2.0)
        known += information[g, cause, cause]
        total += open_pull[g, cause]
    if not known > 0.0:
        return 0.0
    gain, separate = total**2 / known, 0.0
    for j in range(4):
        for k in range(4):
            one, other = (-fed[j - 1] if j else 1.0), (-fed[k - 1] if k else 1.0)
            separate += one * other * each[cause, j, k]
    if gain < (1.0 - EXPLAINED) * separate:
        return 0.0  # another value in every move, as of a force over position
    if abs(total / known) <= bias[cause] + SIGNIFICANT / math.sqrt(known):
        return 0.0
    for g in range(GROUPS):
        for k in range(g):
            both = information[g, cause, cause] + information[k, cause, cause]
            if not both > 0.0:
                continue
            common = (open_pull[g, cause] + open_pull[k, cause]) / both
            one = _lead_over_rivals(cause, common, information[g], open_pull[g], own[k])
            other = _lead_over_rivals(cause, common, information[k], open_pull[k], own[g])
            if one > 0.0 and other > 0.0 and one + other > SIGNIFICANT**2:
                return gain
    return 0.0


@kernel()
def _lead_over_rivals(cause, common, information, pull, other):  # type: ignore[no-untyped-def]
    """By how much a cause explains one of two groups better than any rival.

    In squares of standard deviations; -1 where the value of both groups does not explain this one.

    Args:
        cause: its number.
        common: its value by both groups.
        information: of the group, (3, 3).
        pull: of the group, less what is explained already, (3,).
        other: values of the rivals from the other group, each alone, (3,).
    """
    if not information[cause, cause] > 0.0:
        return -1.0
    taken, rival = 0.0, 0.0
    for i in range(3):
        value = common if i == cause else other[i]
        explained = 2.0 * value * pull[i] - value**2 * information[i, i]
        if i == cause:
            taken = explained
        else:
            rival = max(rival, explained)
    best = pull[cause] ** 2 / information[cause, cause]
    if best - taken > max(EXPLAINED * best, SIGNIFICANT**2):
        return -1.0
    return taken - rival
