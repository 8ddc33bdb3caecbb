"""The force that no effect explains, described by curves: over position, direction and velocity.

A description, not a cause: nothing says that it holds elsewhere than where the axis has been. It is
a sum of curves, each linear between its nodes,

    F = a(x) + c(x) sgn(v) + h(v),   h(0) = 0,

and over motor force or the path since a reversal where the missing force depends on these; or what
an encoder reads too much over position. It is fitted along the measured motion by least squares
with a penalty on second differences, judged on strokes that took no part, and limited to what
effects can represent. In those c(x) is a factor on the model's Coulomb force, so it cannot reverse
friction, and it is 0 where that force is below the floor of the gap.

Source: docs/decisions/0019-rivals.md.
"""

from __future__ import annotations

import math
from collections.abc import Sequence, Set
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from hil_sim.effects.ports import EffectPorts
from hil_sim.effects.residual_table import ResidualTable
from hil_sim.settings import AxisSettings
from sim2real.empirical_force import EmpiricalForce
from sim2real.findings import Unlisted
from sim2real.gap import NO_GAP_BELOW
from sim2real.open_loop import MotionLoop
from sim2real.rivals.coordinates import Coordinate, as_curve
from sim2real.rivals.decision import MOST
from sim2real.rivals.grouped_fit import bends
from sim2real.rivals.screen import Screen
from stagedata import F64

_PLACES = 13
"""Nodes over the travelled length, unless the missing force is known to need more."""
_LEAST = 0.1
"""Share of the gap below which a description says nothing."""
_BEYOND = 1.5
"""How far a curve over velocity or force goes on beyond those recorded: friction and drag do."""
_ONE_WAY = 0.1
"""Share of the top speed in one direction up to which the other one counts as not recorded."""
_SLOW = (0.5, 0.14, 0.03)
"""Shares of the top speed on each side of zero below which nodes over velocity are left out."""
_SMALL = 1e-3
"""Weight of each height beside that of the bends."""
_FEWEST = 130
"""Samples in motion that a description needs."""
_FURTHER = {
    "force": Coordinate("force", "force"),
    "history": Coordinate("force", "force", "history"),
    "reversal_path": Coordinate("reversal_path", "path"),
    "gain": Coordinate("position", "position", "force"),
    "reading": Coordinate("position", "position", "reading"),
}
_CURVES = ("position", "position_direction", "velocity", *_FURTHER)
"""Curves of a description, the last ones only where a coordinate is known that asks for them."""
_FIELDS = {
    "force": ("motor_force", "lost"),
    "history": ("turned", "lagging"),
    "reversal_path": ("path", "resistance"),
    "gain": ("gain_at", "gain"),
    "reading": ("reading", "misread"),
}
"""Curve -> fields of `EmpiricalForce`: nodes, heights."""
_BY_TIMES = {"history": "history", "force": "gain", "reading": "reading"}
"""`Unlisted.times` -> curve."""
_LEAST_GAIN = 0.1
"""Smallest factor on the motor force."""


@dataclass(frozen=True, slots=True, eq=False)
class Description:
    """What is left of the force of an axis.

    Attributes:
        force: fitted to all moves.
        folds: fitted to all moves but those of each of `GROUPS`.
    """

    force: EmpiricalForce
    folds: tuple[EmpiricalForce, ...]


def describe_force(loop: MotionLoop, unlisted: Sequence[Unlisted] = ()) -> tuple[Description, ...]:
    """Descriptions of what a model leaves of an axis' force, the simplest first.

    They differ by their curves, over the coordinates that are known or over all, and by the nodes
    at low velocities: along the motion these tell little, in the closed loop they may tell much.
    Those that the simulator would refuse as too steep are left out. None, where a description
    closes nothing, the force depends on what no twin has, such as time (over position it would be
    another one in the next run), or along the motion it does not show on what it depends.

    Args:
        loop: the axis under the model.
        unlisted: coordinates that the missing force is known to depend on.
    """
    if any(u.seen_in or (not _curve(u) and not _is_level(u)) for u in unlisted):
        return ()
    unlisted = [u for u in unlisted if u.gap_closed >= MOST and _curve(u)]
    screen = Screen(loop)
    nothing = np.empty((int(screen.samples), 0))
    opened = screen.together(nothing, bends(0, 0), 0.0, np.empty(0, np.bool_)).energy
    if screen.samples < _FEWEST or opened < NO_GAP_BELOW * screen.floor:
        return ()
    known, every = {_curve(u) for u in unlisted}, set(_CURVES)
    tried = [(known, slow) for slow in (_SLOW if "velocity" in known else _SLOW[:1]) if known]
    tried += [(every, slow) for slow in _SLOW]
    described = (_Fit(screen, unlisted, *each).description(opened) for each in tried)
    return tuple(
        found
        for found in described
        if found.force.gap_closed >= _LEAST
        and all(
            ResidualTable().refusal(force.table(), loop.axis) is None
            for force in (found.force, *found.folds)
        )
    )


def _curve(found: Unlisted) -> str:
    """Which of `_CURVES` a coordinate asks for; "" where a twin has none."""
    curve = _BY_TIMES.get(found.times, "") if found.times else found.over
    is_other = curve in _FURTHER and _FURTHER[curve].over != found.over
    return "" if is_other or curve not in _CURVES else curve


def _is_level(found: Unlisted) -> bool:
    """Whether it is no more than another level of friction: over position it is the same."""
    return found.over in ("force", "acceleration") and "position_direction" in found.alike


def _nodes(screen: Screen, coordinate: Coordinate) -> F64:
    at = screen.nodes(coordinate)
    return np.empty(0) if at is None else at


class _Fit:
    """All curves of a description, fitted together.

    Args:
        screen: the axis under the model.
        unlisted: as `describe_force`.
        over: coordinates whose curves are fitted; the others stay at 0.
        slow: share of the top speed below which nodes over velocity are left out.
    """

    def __init__(
        self, screen: Screen, unlisted: Sequence[Unlisted], over: Set[str], slow: float
    ) -> None:
        loop = screen.loop
        self._name, self._over = loop.name, over
        self._period = max((u.period for u in unlisted), default=0.0)
        low, high = screen.extent("position")
        step = (high - low) / (_PLACES - 1)
        steps = {_curve(u): min(u.curve.at[1] - u.curve.at[0], step) for u in unlisted}
        coordinates = {
            over: Coordinate(over, "position", times, steps.get(over, step))
            for over, times in (("position", ""), ("position_direction", "friction"))
        }
        speeds = Coordinate("velocity", "velocity")
        needs_more = any(
            u.over == "velocity" and len(u.curve.at) > len(_nodes(screen, speeds)) for u in unlisted
        )
        coordinates["velocity"] = replace(speeds, close=needs_more)
        for curve, further in _FURTHER.items():
            if curve in steps:
                coordinates[curve] = replace(further, step=steps[curve])
        self._at: dict[str, tuple[Coordinate, F64]] = {}
        columns, bent, held = [], [], []
        for curve, coordinate in coordinates.items():
            at = _nodes(screen, coordinate)
            if len(at) < 2:
                continue
            if curve == "velocity":
                at = at[(at <= slow * at[0]) | (at == 0.0) | (at >= slow * at[-1])]
            self._at[curve] = coordinate, at
            columns.append(float(curve in over) * screen.columns(coordinate, at))
            size = columns[-1].shape[1]
            bent.append(bends(size if coordinate.is_curve else 0, size))
            held.append(np.full(size, coordinate.is_held))
        self._level = _coulomb_level(
            loop.axis, loop.settings.sync_period, self._at["position_direction"][1]
        )
        floor = float(np.mean([m.floor.rms[loop.name]["force"] for m in loop.measured]))
        self._level[self._level < math.sqrt(2.0) * floor] = 0.0  # a `MotionLoop` halves its square
        columns[1] = columns[1] * (self._level > 0.0)
        self._edges = np.cumsum([0, *(own.shape[1] for own in columns)])
        self._screen = screen
        # Friction over position and over velocity share a constant.
        self._prediction = screen.together(
            np.hstack(columns), block_diag(*bent), _SMALL, np.concatenate(held)
        )

    def description(self, opened: float) -> Description:
        """The fits as forces; `opened`: energy of the gap that is described."""
        floor = self._screen.floor
        closed = (opened - self._prediction.energy) / (opened - floor)
        force, *folds = (
            self._as_force(values, min(closed, 1.0))
            for values in (self._prediction.values, *self._prediction.folds)
        )
        return Description(force, tuple(folds))

    def _as_force(self, values: F64, closed: float) -> EmpiricalForce:
        parts: dict[str, tuple[F64, F64]] = {}
        for number, (curve, (coordinate, at)) in enumerate(self._at.items()):
            heights = values[self._edges[number] : self._edges[number + 1]]
            heights = np.where(curve in self._over, heights, 0.0)
            if curve in ("reversal_path", "history"):  # element by element: no curve
                kept = heights != 0.0 if curve == "history" else heights > 0.0
                parts[curve] = at[kept], heights[kept]
            else:
                _, places, forces, _ = as_curve(coordinate, at, heights, 0.0 * heights)
                parts[curve] = places, forces
        level = self._level
        where, against = parts["position_direction"]
        against = np.where(level > 0.0, np.maximum(against, -level), 0.0)
        factor = 1.0 + np.divide(against, level, out=np.zeros(len(level)), where=level > 0.0)
        places = np.union1d(where, parts["position"][0])
        always = np.interp(places, *parts["position"])
        against, factor = (np.interp(places, where, heights) for heights in (against, factor))
        velocity = _both_ways(*parts["velocity"])
        speeds, over_velocity = _continued(*velocity, self._screen.loop.axis.velocity)
        if "force" in parts:
            limit = self._screen.loop.axis.control.peak_force
            parts["force"] = _continued(*_increasing(*parts["force"]), limit)
        if "gain" in parts:  # the curve is over the force that the model needs
            nodes, missing = parts["gain"]
            gain = 1.0 / np.maximum(1.0 + missing / self._screen.force_rms, _LEAST_GAIN)
            parts["gain"] = nodes, np.maximum(gain, _LEAST_GAIN)
        further = {"coulomb": factor}
        for curve in parts.keys() & _FIELDS.keys():
            further |= dict(zip(_FIELDS[curve], parts[curve], strict=True))
        lists = [places, always, against, speeds, over_velocity]
        given: dict[str, Any] = {key: tuple(part.tolist()) for key, part in further.items()}
        return EmpiricalForce(
            self._name, closed, *(tuple(part.tolist()) for part in lists),
            period=self._period, **given,
        )  # fmt: skip


def _increasing(at: F64, heights: F64) -> tuple[F64, F64]:
    """A curve without nodes that noise in its heights has moved behind an earlier one."""
    kept = at > np.concatenate(([-np.inf], np.maximum.accumulate(at)[:-1]))
    return at[kept], heights[kept]


def _both_ways(at: F64, forces: F64) -> tuple[F64, F64]:
    """A curve over velocity, odd where one direction was recorded: what resists, resists both."""
    if min(-at[0], at[-1]) > _ONE_WAY * max(-at[0], at[-1]):
        return at, forces
    own = at > 0.0 if at[-1] > -at[0] else at < 0.0
    both = np.concatenate((-at[own], [0.0], at[own]))
    order = np.argsort(both)
    return both[order], np.concatenate((-forces[own], [0.0], forces[own]))[order]


def _continued(at: F64, forces: F64, limit: float) -> tuple[F64, F64]:
    """A curve over velocity or force that goes on straight, up to the axis' limit at most."""
    low = min(max(-limit, _BEYOND * at[0]), at[0])
    high = max(min(limit, _BEYOND * at[-1]), at[-1])
    slopes = np.diff(forces)[[0, -1]] / np.diff(at)[[0, -1]]
    ends = (forces[0] + slopes[0] * (low - at[0]), forces[-1] + slopes[1] * (high - at[-1]))
    inside = (at > low) & (at < high)
    return (
        np.concatenate(([low], at[inside], [high])),
        np.concatenate(([ends[0]], forces[inside], [ends[1]])),
    )


def _coulomb_level(axis: AxisSettings, sync_period: float, places: F64) -> F64:
    """Coulomb force of the model at places, float64[n] [N]."""
    ports = EffectPorts.filled(axis, sync_period, 0.0)
    level = np.full(len(places), axis.friction.coulomb * ports.coulomb)
    if ports.position_coulomb is not None:
        level = level * np.interp(places, ports.positions, ports.position_coulomb)
    return np.asarray(level)
