"""Random sequences of macro- and micro-moves of two axes, like those of an inspection table.

Jerk-limited demands: a trapezoidal velocity in closed form, sampled at SYNC, then a moving average
whose length limits the jerk. The force offset is the nominal mass times the demanded acceleration
(second central difference); both are rounded as they are on the bus.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hil_sim.settings import StageSettings
from sim2real.experiment import stroke
from stagedata import F64, Move

POSITION_UNIT = 1e-9
"""Unit of target positions on the bus [m]."""
FORCE_UNITS = 1000.0
"""Units per rated force on the bus."""
MACRO_SPEED, MACRO_ACCELERATION = 0.5, 3.0
"""Highest velocity and acceleration of macro-moves [m/s, m/s^2]."""
MICRO_SPEED, MICRO_ACCELERATION, MICRO_REACH = 0.01, 0.2, 80e-6
"""Highest velocity and acceleration of micro-moves [m/s, m/s^2], and their largest distance [m]."""
MACRO_JERK, MICRO_JERK = (100.0, 400.0), (10.0, 40.0)
"""Range of the jerk [m/s^3]."""
REST = (0.05, 0.3)
"""Shortest and longest rest between moves [s]."""
REACH = (0.03, 0.07)
"""Range of the largest distance of a recording's sites from the middle of the travel [m]."""
STILL = 0.1
"""Rest before the first move [s]."""


@dataclass(frozen=True, slots=True, eq=False)
class Demands:
    """What a host sends for a whole sequence of moves of K SYNCs.

    Attributes:
        position: target positions of every SYNC, float64[K, axes] [m].
        offset: force offsets, float64[K, axes] [N].
        moves: in order.
    """

    position: F64
    offset: F64
    moves: tuple[Move, ...]


def draw_demands(
    rng: np.random.Generator, settings: StageSettings, duration: float = 10.0
) -> Demands:
    """Draw a sequence of moves, in each of which all axes move together.

    A large move to a site, then mostly a small one there. Speeds, accelerations, jerk, rests and
    the part of the table that is used differ from sequence to sequence.

    Args:
        rng: random generator.
        settings: of the stage: names, travel, rated force and nominal mass of its axes.
        duration: no move begins later [s].
    """
    period = settings.sync_period
    axes = settings.axes
    reach = rng.uniform(*REACH)
    middle = [0.5 * (axis.travel[0] + axis.travel[1]) for axis in axes]
    slower = 1.0 if rng.uniform() < 0.6 else rng.uniform(0.5, 1.0)
    gentler = 1.0 if rng.uniform() < 0.6 else rng.uniform(0.5, 1.0)
    jerk = {"macro": _log(rng, MACRO_JERK), "micro": _log(rng, MICRO_JERK)}
    micro_share = rng.uniform(0.6, 1.0)
    at = np.array([m + rng.uniform(-reach, reach) for m in middle])
    parts = [np.tile(at, (round(STILL / period), 1))]
    moves = []
    now = len(parts[0])
    kind = "macro"
    while now * period < duration:
        if kind == "macro":
            to = np.array([m + rng.uniform(-reach, reach) for m in middle])
            limits = (slower * MACRO_SPEED, gentler * MACRO_ACCELERATION)
        else:
            to = at + rng.uniform(-MICRO_REACH, MICRO_REACH, len(axes))
            limits = (slower * MICRO_SPEED, gentler * MICRO_ACCELERATION)
        to = np.round(to / POSITION_UNIT) * POSITION_UNIT
        each = [stroke(b - a, *limits, jerk[kind], period) for a, b in zip(at, to, strict=True)]
        length = max(len(values) for values in each)
        rest = round(rng.uniform(*REST) / period)
        part = np.empty((length + rest, len(axes)))
        for a, values in enumerate(each):
            part[: len(values), a] = at[a] + values
            part[len(values) :, a] = to[a]
        parts.append(part)
        names = [axis.name for axis in axes]
        moves.append(
            Move(
                kind,
                now,
                now + length,
                dict(zip(names, at.tolist(), strict=True)),
                dict(zip(names, to.tolist(), strict=True)),
            )
        )
        now += len(part)
        at = to
        kind = "micro" if kind == "macro" and rng.uniform() < micro_share else "macro"
    return _rounded_demands(np.concatenate(parts), moves, settings)


def _rounded_demands(position: F64, moves: Sequence[Move], settings: StageSettings) -> Demands:
    """Demands as they go over the bus; positions float64[K, axes] [m]."""
    period, axes = settings.sync_period, settings.axes
    acceleration = np.zeros_like(position)
    acceleration[1:-1] = np.diff(position, 2, axis=0) / period**2
    offset = acceleration * np.array([axis.mass for axis in axes])
    unit = np.array([axis.control.rated_force / FORCE_UNITS for axis in axes])
    return Demands(
        np.round(position / POSITION_UNIT) * POSITION_UNIT,
        np.round(offset / unit) * unit,
        tuple(moves),
    )


def _log(rng: np.random.Generator, interval: Sequence[float]) -> float:
    low, high = np.log(interval)
    return float(np.exp(rng.uniform(low, high)))
