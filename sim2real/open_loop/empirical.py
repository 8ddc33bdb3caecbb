"""The force that no effect explains, described: over position, direction and velocity.

A description, not a cause: nothing says that it holds elsewhere than where the axis has been. It is
a sum of three smooth parts, each linear between a few nodes,

    F = a(x) + c(x) sgn(v) + h(v),   h(0) = 0,

fitted by least squares with a penalty on second differences, and judged on strokes that took part
neither in the fit nor in the choice of the penalty's weight: the share of the residual's energy
above the floor that it closes there. What goes with acceleration and its rate is fitted beside it
and left out of both: a drive reports the force at an instant, and within a SYNC period it is not
constant, which on recurring strokes would pass for a force over position.

The description is limited to what the effect `residual_table` can represent. There c(x) is a
factor on the model's Coulomb force, so it cannot reverse friction, and it is 0 where that force is
below the floor of the gap.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hil_sim.effects.ports import EffectPorts
from hil_sim.effects.residual_table import ResidualTable
from hil_sim.settings import AxisSettings, StageSettings
from sim2real.findings import EmpiricalForce
from sim2real.gap import NO_GAP_BELOW, Measured
from sim2real.open_loop.motion import Motion
from sim2real.phases import split_moves
from stagedata import BoolArray

F64 = NDArray[np.float64]

PLACES = 13
"""Nodes over the travelled length."""
SPEEDS = (0.02, 0.1, 0.3, 0.6, 1.0)
"""Nodes over velocity in each direction, in shares of the highest one."""
_LEAST = 0.1
"""Share of the gap below which a description says nothing."""
_SMOOTH = (1e-3, 1e-2, 1e-1, 1.0)
"""Weights of the penalty that are tried, per sample; strokes that took no part choose."""
_BESIDE = 2
"""Columns beside the description: acceleration and its rate."""
_FOLDS = 5
"""Groups of strokes of which each is judged by a fit to the others, where there are that many."""


def describe_residual(
    name: str, motions: Sequence[Motion], measured: Sequence[Measured], settings: StageSettings
) -> EmpiricalForce | None:
    """The description of what a model leaves of an axis' force; None where it closes nothing.

    None, too, where the simulator would refuse it as too steep: nodes at low velocities are left
    out before that.

    Args:
        name: of the axis.
        motions: of the recordings.
        measured: the model along these motions.
        settings: the model.
    """
    used = [motion.axes[name].usable for motion in motions]
    if sum(int(u.sum()) for u in used) < 10 * PLACES:
        return None
    position = np.concatenate(
        [m.axes[name].position[u] for m, u in zip(motions, used, strict=True)]
    )
    velocity = np.concatenate(
        [m.axes[name].velocity[u] for m, u in zip(motions, used, strict=True)]
    )
    low, high, fastest = position.min(), position.max(), np.abs(velocity).max()
    if high <= low or fastest <= 0.0:
        return None
    axis = next(axis for axis in settings.axes if axis.name == name)
    places = np.linspace(low, high, PLACES)
    floor = float(np.mean([m.floor.rms[name]["force"] for m in measured]))
    level = _coulomb_level(axis, settings.sync_period, places)
    level[level < floor] = 0.0
    residual = [m.residual[name]["force"][u] for m, u in zip(measured, used, strict=True)]
    folds = _folds(motions, used)
    for skipped in range(len(SPEEDS)):
        shares = fastest * np.array(SPEEDS[skipped:])
        speeds = np.concatenate((-shares[::-1], [0.0], shares))
        columns = [
            _columns(motion, name, places, speeds)[u]
            for motion, u in zip(motions, used, strict=True)
        ]
        fit = _TableFit(np.concatenate(columns), np.concatenate(residual), folds, level)
        if len(fit.folds) < 2:
            return None  # nothing can be held out
        heights = fit.solve(fit.folds, fit.choose_weight(fit.folds))
        against = heights[PLACES : 2 * PLACES]
        factor = 1.0 + np.divide(against, level, out=np.zeros(PLACES), where=level > 0.0)
        over = np.insert(heights[2 * PLACES : -_BESIDE], len(shares), 0.0)
        parts = (places, heights[:PLACES], against, speeds, over)
        lists = (tuple(part.tolist()) for part in parts)
        force = EmpiricalForce(name, 1.0, *lists, coulomb=tuple(factor.tolist()))
        if ResidualTable().refusal(force.table(), axis) is None:
            break
    else:
        return None
    energy, remaining = fit.held_out()
    if energy < NO_GAP_BELOW * floor**2:
        return None
    closed = 1.0 - (remaining - floor**2) / (energy - floor**2)
    return replace(force, gap_closed=min(closed, 1.0)) if closed >= _LEAST else None


class _TableFit:
    """Fits of the description to groups of strokes.

    Args:
        columns: as `_columns`, float64[P, n].
        left: force to be described, float64[P] [N].
        fold: group of each sample, int64[P].
        level: Coulomb force of the model at the nodes, float64[PLACES] [N]; 0 where it has none.

    Attributes:
        folds: groups that occur.
    """

    def __init__(self, columns: F64, left: F64, fold: NDArray[np.int64], level: F64) -> None:
        self.folds = [int(number) for number in np.unique(fold)]
        self._level = level
        self._penalty = _penalty(columns.shape[1])
        columns[:, PLACES : 2 * PLACES] *= level > 0.0
        both = np.column_stack([columns, left])
        self._squares = {f: both[fold == f].T @ both[fold == f] for f in self.folds}
        """Sums over the samples of each group, float64[n + 1, n + 1]."""
        self._counts = {f: int((fold == f).sum()) for f in self.folds}

    def solve(self, folds: Sequence[int], weight: float) -> F64:
        """Heights at the nodes and of the columns beside, fitted to some groups, float64[n]."""
        squares = sum(self._squares[f] for f in folds) / sum(self._counts[f] for f in folds)
        heights = np.linalg.solve(squares[:-1, :-1] + weight * self._penalty, squares[:-1, -1])
        against = slice(PLACES, 2 * PLACES)
        heights[against] = np.where(
            self._level > 0.0, np.maximum(heights[against], -self._level), 0.0
        )
        return np.asarray(heights)

    def choose_weight(self, folds: Sequence[int]) -> float:
        """The penalty weight with which each group is predicted best by a fit to the others.

        The largest weight where there is only one group.
        """
        if len(folds) < 2:
            return _SMOOTH[-1]

        def left(weight: float) -> float:
            others = ([f for f in folds if f != held] for held in folds)
            return sum(
                self._energy(held, self.solve(rest, weight))
                for held, rest in zip(folds, others, strict=True)
            )

        return min(_SMOOTH, key=left)

    def held_out(self) -> tuple[float, float]:
        """Mean squares without and with the description, each group by a fit to others [N^2]."""
        energy = remaining = 0.0
        for held in self.folds:
            rest = [f for f in self.folds if f != held]
            squares = sum(self._squares[f] for f in rest)
            beside = np.zeros(len(squares) - 1)
            sampling = slice(-1 - _BESIDE, -1)
            beside[-_BESIDE:] = np.linalg.solve(squares[sampling, sampling], squares[sampling, -1])
            energy += self._energy(held, beside)
            remaining += self._energy(held, self.solve(rest, self.choose_weight(rest)))
        count = sum(self._counts.values())
        return energy / count, remaining / count

    def _energy(self, fold: int, heights: F64) -> float:
        """Sum of the squares that these heights leave of a group's force [N^2]."""
        difference = np.append(-heights, 1.0)
        return float(difference @ self._squares[fold] @ difference)


def _columns(motion: Motion, name: str, places: F64, speeds: F64) -> F64:
    """Low-passed forces of unit height at each node, and what is beside, float64[P, n]."""
    axis = motion.axes[name]
    over = np.column_stack([np.interp(axis.position, places, unit) for unit in np.eye(len(places))])
    units = np.delete(np.eye(len(speeds)), len(speeds) // 2, axis=0)
    of_speed = np.column_stack([np.interp(axis.velocity, speeds, unit) for unit in units])
    forces = np.hstack([over, over * np.sign(axis.velocity)[:, None], of_speed])
    low = np.column_stack([motion.low_pass(name, column) for column in forces.T])
    return np.hstack([low, _sampling(motion, name)])


def _sampling(motion: Motion, name: str) -> F64:
    """Acceleration and its rate, each over its rms, low-passed like the force, float64[P, 2]."""
    acceleration = motion.axes[name].acceleration
    columns = np.column_stack([acceleration, np.gradient(acceleration, motion.period)])
    columns = np.column_stack([motion.low_pass(name, column) for column in columns.T])
    return np.asarray(columns / np.maximum(np.sqrt(np.mean(columns**2, axis=0)), 1e-12))


def _coulomb_level(axis: AxisSettings, sync_period: float, places: F64) -> F64:
    """Coulomb force of the model at the nodes, float64[PLACES] [N]."""
    ports = EffectPorts.filled(axis, sync_period, 0.0)
    level = np.full(len(places), axis.friction.coulomb * ports.coulomb)
    if ports.position_coulomb is not None:
        level = level * np.interp(places, ports.positions, ports.position_coulomb)
    return np.asarray(level)


def _penalty(size: int) -> F64:
    """Squared second differences from node to node, and a little of every height.

    None of the columns beside the description.
    """
    second = np.diff(np.eye(PLACES), 2, axis=0)
    over = second.T @ second
    speeds = size - _BESIDE - 2 * PLACES + 1
    penalty = np.zeros((size, size))
    penalty[:-_BESIDE, :-_BESIDE] = 1e-3 * np.eye(size - _BESIDE)
    penalty[:PLACES, :PLACES] += over
    penalty[PLACES : 2 * PLACES, PLACES : 2 * PLACES] += over
    bent = np.delete(np.diff(np.eye(speeds), 2, axis=0), speeds // 2, axis=1)
    penalty[2 * PLACES : -_BESIDE, 2 * PLACES : -_BESIDE] += bent.T @ bent
    return np.asarray(penalty)


def _folds(motions: Sequence[Motion], used: Sequence[BoolArray]) -> NDArray[np.int64]:
    """The group of each usable sample's strokes, int64: there and back belong together."""
    groups = []
    first = 0
    for motion, usable in zip(motions, used, strict=True):
        pair = np.zeros(len(motion.recording), dtype=np.int64)
        for block in split_moves(motion.recording, motion.period):
            pair[block.start : block.stop] = block.number // 2
        occurring, number = np.unique(pair[usable], return_inverse=True)
        groups.append(first + number)
        first += len(occurring)
    return np.asarray(np.concatenate(groups) % _FOLDS)
