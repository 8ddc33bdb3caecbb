"""The force that no effect explains, described: over position, direction and velocity.

A description, not a cause: nothing says that it holds elsewhere than where the axis has been. It is
a sum of three smooth parts, each linear between a few nodes,

    F = a(x) + c(x) sgn(v) + h(v),   h(0) = 0,

fitted by least squares with a penalty on second differences, and judged on strokes that took no
part: the share of the residual's energy above the floor that it closes there. What goes with
acceleration and its rate is fitted beside it and left out of both: a drive reports the force at an
instant, and within a SYNC period it is not constant, which on recurring strokes would pass for a
force over position.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hil_sim.effects.ports import EffectPorts
from hil_sim.settings import StageSettings
from sim2real.gap import NO_GAP_BELOW, Measured
from sim2real.open_loop.motion import Motion
from sim2real.phases import split_moves
from sim2real.report import EmpiricalForce
from sim2real.shrinkage import FOLDS
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


def describe_residual(
    name: str, motions: Sequence[Motion], measured: Sequence[Measured], settings: StageSettings
) -> EmpiricalForce | None:
    """The description of what a model leaves of an axis' force; None where it closes nothing.

    Args:
        name: of the axis.
        motions: of the recordings.
        measured: the model along these motions.
        settings: the model.
    """
    used = [motion.axes[name].usable for motion in motions]
    if sum(int(u.sum()) for u in used) < 10 * PLACES:
        return None
    position = [m.axes[name].position for m in motions]
    velocity = [m.axes[name].velocity for m in motions]
    low = min(float(x[u].min()) for x, u in zip(position, used, strict=True) if u.any())
    high = max(float(x[u].max()) for x, u in zip(position, used, strict=True) if u.any())
    fastest = max(float(np.abs(v[u]).max()) for v, u in zip(velocity, used, strict=True) if u.any())
    if high <= low or fastest <= 0.0:
        return None
    places = np.linspace(low, high, PLACES)
    shares = np.array(SPEEDS) * fastest
    speeds = np.concatenate((-shares[::-1], [0.0], shares))
    matrix = np.concatenate([
        np.column_stack([
            motion.low_pass(name, column)[u]
            for column in _columns(x, v, places, speeds).T
        ])
        for motion, x, v, u in zip(motions, position, velocity, used, strict=True)
    ])  # fmt: skip
    beside = np.concatenate(
        [_sampling(motion, name)[u] for motion, u in zip(motions, used, strict=True)]
    )
    matrix = np.hstack([matrix, beside])
    left = np.concatenate(
        [m.residual[name]["force"][u] for m, u in zip(measured, used, strict=True)]
    )
    fold = np.concatenate([_folds(motion)[u] for motion, u in zip(motions, used, strict=True)])
    floor = float(np.mean([m.floor.rms[name]["force"] for m in measured]))
    penalty = _penalty(len(speeds))
    tried = [(_held_out(matrix, left, fold, weight * penalty), weight) for weight in _SMOOTH]
    remaining, weight = min(tried)
    energy = _held_out(beside, left, fold, np.zeros((beside.shape[1],) * 2))
    if energy < NO_GAP_BELOW * floor**2:
        return None
    closed = 1.0 - (remaining - floor**2) / (energy - floor**2)
    if closed < _LEAST:
        return None
    found = _solved(matrix, left, weight * penalty)
    over = np.insert(found[2 * PLACES : -beside.shape[1]], len(SPEEDS), 0.0)
    against = found[PLACES : 2 * PLACES]
    factor = _as_factor(against, places, settings, name)
    parts = (places, found[:PLACES], against, speeds, over, factor)
    return EmpiricalForce(name, min(closed, 1.0), *(tuple(part.tolist()) for part in parts))


def _columns(position: F64, velocity: F64, places: F64, speeds: F64) -> F64:
    """Forces of unit height at each node, float64[P, nodes]."""
    over = np.column_stack([np.interp(position, places, unit) for unit in np.eye(len(places))])
    units = np.delete(np.eye(len(speeds)), len(speeds) // 2, axis=0)
    of_speed = np.column_stack([np.interp(velocity, speeds, unit) for unit in units])
    return np.hstack([over, over * np.sign(velocity)[:, None], of_speed])


def _sampling(motion: Motion, name: str) -> F64:
    """Acceleration and its rate, each over its rms, low-passed like the force, float64[P, 2]."""
    acceleration = motion.axes[name].acceleration
    found = np.column_stack([acceleration, np.gradient(acceleration, motion.period)])
    found = np.column_stack([motion.low_pass(name, column) for column in found.T])
    return np.asarray(found / np.maximum(np.sqrt(np.mean(found**2, axis=0)), 1e-12))


def _as_factor(against: F64, places: F64, settings: StageSettings, name: str) -> F64:
    """Force against the motion [N] as a factor on the model's Coulomb force, float64[PLACES]."""
    axis = next(axis for axis in settings.axes if axis.name == name)
    ports = EffectPorts(axis, settings.sync_period, 0.0)
    for effect in axis.effects:
        effect.apply(ports)
    level = np.full(len(places), axis.friction.coulomb * ports.coulomb)
    if ports.position_coulomb is not None:
        level = level * np.interp(places, ports.positions, ports.position_coulomb)
    factor = np.ones(len(places))
    there = level > 0.0
    factor[there] += against[there] / level[there]
    return np.maximum(factor, 0.0)


def _penalty(speeds: int) -> F64:
    """Squared second differences from node to node, and a little of every height.

    None of the two columns for acceleration and its rate.
    """
    second = np.diff(np.eye(PLACES), 2, axis=0)
    over = second.T @ second
    size = 2 * PLACES + speeds - 1
    penalty = np.zeros((size + 2, size + 2))
    penalty[:size, :size] = 1e-3 * np.eye(size)
    penalty[:PLACES, :PLACES] += over
    penalty[PLACES : 2 * PLACES, PLACES : 2 * PLACES] += over
    bent = np.delete(np.diff(np.eye(speeds), 2, axis=0), speeds // 2, axis=1)
    penalty[2 * PLACES : size, 2 * PLACES : size] += bent.T @ bent
    return np.asarray(penalty)


def _solved(matrix: F64, left: F64, penalty: F64) -> F64:
    normal = matrix.T @ matrix / len(left) + penalty
    return np.asarray(np.linalg.solve(normal, matrix.T @ left / len(left)))


def _held_out(matrix: F64, left: F64, fold: NDArray[np.int64], penalty: F64) -> float:
    """Mean square of what is left, each stroke by a fit to those of other folds [N^2]."""
    energy = 0.0
    for held in range(FOLDS):
        out: BoolArray = fold == held
        if out.all() or not out.any():
            return float(left @ left) / len(left)
        found = _solved(matrix[~out], left[~out], penalty)
        energy += float(np.square(left[out] - matrix[out] @ found).sum())
    return energy / len(left)


def _folds(motion: Motion) -> NDArray[np.int64]:
    """The fold of each sample's stroke, int64[P]."""
    fold = np.zeros(len(motion.recording), dtype=np.int64)
    for block in split_moves(motion.recording, motion.period):
        fold[block.start : block.stop] = (block.number // 2) % FOLDS
    return fold
