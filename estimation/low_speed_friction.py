"""Friction at low speed that the friction law does not have, learned where long moves come to rest.

A nut that creeps over its preload, balls that roll in their own grease and worn seals add a force
that dies out with speed. In the deceleration of a long move everything slides, so that what the
measured force has beside mass, Coulomb and viscous friction is this force. Its level and the speed
over which it decays are found by least squares: for each speed of a grid the level follows
linearly, and the sums over the moves are kept for each of them, by groups of moves
(`estimation.move_group`): two groups have to show the force, and agree.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from estimation.kinematics import slope
from estimation.move import MoveData
from estimation.move_group import GROUPS, move_group
from stagedata import F64
from stagedata.compiled import kernel, machine_code

SPEEDS = np.geomspace(2e-3, 5e-2, 17)
"""Speeds over which the force may decay [m/s]."""
_PLACES, _LOG_SPEEDS = np.arange(len(SPEEDS)), np.log(SPEEDS)
FASTEST = 0.1
"""Faster than this, none of it is left [m/s]."""
SLOWEST = 1e-3
"""Slower than this an axis may have stopped sliding [m/s]."""
FEWEST = 12
"""Samples of a deceleration that say anything."""
KEPT = 0.9
"""Weight of a move relative to the next one: friction may change."""
EXPLAINED = 0.25
"""It is fed forward if it leaves at most this share of what later moves show."""
SIGNIFICANT = 5.0
"""Standard deviations by which it must differ from zero."""
LEAST = 0.03
"""Smallest share of Fc that is taken for a force of its own."""
_CORRELATED = 8.0
"""Neighbouring samples whose errors are alike."""
_NUISANCES = 5
"""Constant, velocity, acceleration and jerk are friction's and the mass' own; the acceleration's
cube is that of a motor which saturates."""
_NOISE = 2e-3
"""Least rms of a force sample, relative to Fc."""


def low_speed_shape(share: F64) -> F64:
    """Force over its level, by the velocity over the speed that it decays over; any shape."""
    shape: F64 = np.tanh(5.0 * share) * np.exp(-np.abs(share))
    return shape


_shape = kernel()(low_speed_shape)


class LowSpeedFriction:
    """Of one axis.

    Args:
        coulomb: Fc of the start model [N].
        period: Ts [s].

    Attributes:
        level: of the force, once a move has shown it that it was not learned from; else 0 [N].
        speed: over which it decays [m/s].
    """

    def __init__(self, coulomb: float, period: float) -> None:
        self.level, self.speed = 0.0, float(SPEEDS[0])
        self._coulomb, self._period = coulomb, period
        self._sums = np.zeros((GROUPS, len(SPEEDS), 3))
        self._moves = 0
        self._before = self._after = 0.0
        self._value = 0.0
        rest, sums = np.zeros(2), np.zeros((len(SPEEDS), 3))
        self._add_up = machine_code(add_up, rest, rest, rest, 0, period, SPEEDS, sums)
        _misfit(sums, coulomb)

    def force(self, velocity: F64) -> F64:
        """Along velocities [m/s]: force [N], same shape."""
        result: F64 = self.level * low_speed_shape(velocity / self.speed)
        return result

    def without(self, move: MoveData) -> MoveData:
        """A move's data without this force."""
        if not self.level:
            return move
        return replace(move, force=move.force - self.force(slope(move.path, self._period)))

    def learn_from(self, move: MoveData, friction: F64, coulomb: float) -> bool:
        """`learn` from a move, if it was fast and none of its samples is missing.

        Args:
            move: with mean forces (`estimation.sampled_force`).
            friction: as for `learn`.
            coulomb: as for `learn`.
        """
        if not move.valid.all() or np.abs(slope(move.position, self._period)).max() < FASTEST:
            return False
        return self.learn(move.position, move.force, friction, coulomb)

    def describe(self) -> list[str]:
        """What is fed forward that the friction law does not have, as clauses."""
        if not self.level:
            return []
        more = f"{abs(self.level):.2g} N {'more' if self.level > 0.0 else 'less'}"
        return [f"friction takes {more} force at low speed, below {1e3 * self.speed:.2g} mm/s"]

    def learn(self, position: F64, force: F64, friction: F64, coulomb: float) -> bool:
        """Learn from a long move; True where `level` has become another than zero, or zero again.

        Args:
            position: sampled [m], shape (K,), without gaps.
            force: measured, shape (K,) [N].
            friction: of the model, without its viscous part, shape (K,) [N].
            coulomb: Fc of the model [N].
        """
        begin = int(np.argmax(np.abs(position[2:] - position[:-2]))) + 1
        sums = np.zeros((len(SPEEDS), 3))
        count = self._add_up(position, force, friction, begin, self._period, SPEEDS, sums)
        if count < FEWEST:
            return False
        left = _misfit(sums, 0.0)
        noise = max(float(left.min()) / count, (_NOISE * self._coulomb) ** 2)
        sums /= noise * _CORRELATED
        known = self.level != 0.0
        if self._moves:
            self._compare(sums)
        self._moves += 1
        self._sums *= KEPT
        self._sums[move_group(float(position[-1] - position[0]))] += sums
        self._decide(coulomb)
        return known != (self.level != 0.0)

    def _compare(self, sums: F64) -> None:
        """Note how well a move shows what was learned before it."""
        at = int(np.argmin(_misfit(self._sums.sum(axis=0), self._coulomb)))
        own, along, square = sums[at]
        left = float(_misfit(sums, 0.0).min())
        value = self._value
        self._before = KEPT * self._before + square - left
        self._after = KEPT * self._after + square - 2.0 * value * along + value**2 * own - left

    def _decide(self, coulomb: float) -> None:
        """Level and speed that the moves together show; friction never drives an axis."""
        sums = self._sums.sum(axis=0)
        misfit = _misfit(sums, self._coulomb)
        at = int(np.argmin(misfit))
        own = sums[:, 0] + self._coulomb**-2
        values = sums[:, 1] / own
        self._value = float(values[at])
        aside = 0.0
        if 0 < at < len(SPEEDS) - 1:  # the vertex of the parabola through three speeds
            below, lowest, above = misfit[at - 1 : at + 2]
            aside = 0.5 * float((below - above) / (below - 2.0 * lowest + above))
        level = float(np.interp(at + aside, _PLACES, values))
        self.speed = float(np.exp(np.interp(at + aside, _PLACES, _LOG_SPEEDS)))
        agrees = self._after <= EXPLAINED * self._before
        certain = abs(level) > LEAST * coulomb + SIGNIFICANT / np.sqrt(own[at])
        # What dies out faster than the lowest speed is presliding, which the law has or has not.
        likely = at > 0 and abs(level) < coulomb
        shown = self._moves > 1 and agrees and self._groups_that_agree(at) > 1
        self.level = level if shown and certain and likely else 0.0

    def _groups_that_agree(self, at: int) -> int:
        """How many groups show the force by themselves at this speed, and about as large."""
        own = self._sums[:, at, 0] + self._coulomb**-2
        values = self._sums[:, at, 1] / own
        alike = (values - self._value) ** 2 <= EXPLAINED * self._value**2
        return int(np.count_nonzero(alike & (np.abs(values) > SIGNIFICANT / np.sqrt(own))))


@kernel()
def _misfit(sums, spread):  # type: ignore[no-untyped-def]
    """What each speed leaves of the force, shape (S,), with a spread of its level beforehand [N].

    `sums` as of `add_up`; a spread of 0 is none.
    """
    misfit, known = np.empty(sums.shape[0]), spread**-2 if spread > 0.0 else 1e-12
    for s in range(sums.shape[0]):
        misfit[s] = sums[s, 2] - sums[s, 1] ** 2 / (sums[s, 0] + known)
    return misfit


@kernel()
def add_up(position, force, friction, begin, period, speeds, sums):  # type: ignore[no-untyped-def]
    """Sums over a deceleration; returns the number of its samples.

    Args:
        position: [m], (K,).
        force: measured [N], (K,).
        friction: of the model [N], (K,).
        begin: of the deceleration.
        period: Ts [s].
        speeds: S to try [m/s], (S,).
        sums: written, (S, 3): squares of the force's shape, its products with the force, and
            squares of the force; all of them without what goes with the nuisances.
    """
    nuisances = np.empty((_NUISANCES, position.shape[0]))
    velocities, own = np.empty(position.shape[0]), np.empty(position.shape[0])
    count = 0
    for k in range(max(begin, 2), position.shape[0] - 2):
        steps = position[k + 1] - position[k - 1]
        velocity = 0.5 * steps / period
        if abs(velocity) > FASTEST:
            continue
        if abs(velocity) < SLOWEST:
            break
        bend = (position[k + 1] - 2.0 * position[k] + position[k - 1]) / period**2
        nuisances[0, count] = 1.0
        nuisances[1, count] = velocity
        nuisances[2, count] = bend
        nuisances[3, count] = (0.5 * (position[k + 2] - position[k - 2]) - steps) / period**3
        nuisances[4, count] = bend**3
        velocities[count], own[count] = velocity, force[k] - friction[k]
        count += 1
    if count < FEWEST:
        return count
    basis = nuisances[:, :count].copy()
    for i in range(_NUISANCES):
        _take_off(basis[:i], basis[i])
        basis[i] /= math.sqrt((basis[i] ** 2).sum()) + 1e-300
    left = own[:count].copy()
    _take_off(basis, left)
    shape = np.empty(count)
    for s in range(speeds.shape[0]):
        for n in range(count):
            shape[n] = _shape(velocities[n] / speeds[s])
        _take_off(basis, shape)
        sums[s, 0] = (shape * shape).sum()
        sums[s, 1] = (shape * left).sum()
        sums[s, 2] = (left * left).sum()
    return count


@kernel()
def _take_off(basis, values):  # type: ignore[no-untyped-def]
    """Take from values, (n,), what goes with orthonormal rows, (m, n)."""
    for i in range(basis.shape[0]):
        share = 0.0
        for n in range(values.shape[0]):
            share += basis[i, n] * values[n]
        for n in range(values.shape[0]):
            values[n] -= share * basis[i, n]
