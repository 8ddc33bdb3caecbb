"""Which moves would tell most next: short sequences on which two models of an axis differ most.

Two models that the recordings leave open are run, noise-free and in closed loop, through a handful
of sequences that excite different things; the one on which they part most, in floors, is told as
moves of a recipe. Range, speed and acceleration are those of the recordings, so that the machine
can do them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil_sim.plant.simulate import simulate
from hil_sim.settings import StageSettings
from sim2real.experiment.strokes import stroke
from sim2real.fitting import AxisModel, composed
from sim2real.gap import Measured
from sim2real.report import NextExperiment

F64 = NDArray[np.float64]

_CREEP = 0.06
"""Share of the highest speed of slow sweeps."""
_SHARES = (0.1, 0.4, 1.0)
"""Shares of the highest speed of strokes at several speeds."""
_MICRO = (10e-6, 30e-6, 90e-6)
"""Reaches of small reversals [m]."""
_SMALL = {"velocity": 0.01, "acceleration": 0.2, "jerk": 20.0}
"""Of small reversals (SI)."""
_REST, _LONG_REST = 0.1, 3.0
"""Between moves; between strokes that are to show what changes with time [s]."""
_JERK = 100.0
"""Of the other moves [m/s^3]."""
_DIGITS = 4
"""Decimals of targets [m]."""

Move = Mapping[str, Any]
"""As under `moves` of a recipe."""


@dataclass(frozen=True, slots=True)
class Reach:
    """What an axis did in the recordings, and so what the machine can do.

    Attributes:
        low, high: positions [m].
        speed, acceleration: largest demanded [m/s, m/s^2].
    """

    low: float
    high: float
    speed: float
    acceleration: float


def next_experiment(
    why: str,
    one: Mapping[str, AxisModel],
    other: Mapping[str, AxisModel],
    axis: str,
    measured: Sequence[Measured],
    settings: StageSettings,
) -> NextExperiment | None:
    """The sequence on which two models differ most; None where none differs more than a floor.

    Args:
        why: what is open, the beginning of a sentence.
        one: axis -> model.
        other: likewise.
        axis: that the question is about.
        measured: recordings, with their floors.
        settings: of the machine file.
    """
    reach = {a.name: _reach(measured, a.name) for a in settings.axes}
    stages = [composed(settings, models) for models in (one, other)]
    before = _difference(measured[0].replay.demand, measured[0].replay.offset, stages, measured)
    macro = {
        "velocity": min(r.speed for r in reach.values()),
        "acceleration": min(r.acceleration for r in reach.values()),
        "jerk": _JERK,
    }
    best, most, said = None, 1.0, ""
    for name, moves in _sequences(settings, axis, reach):
        demand = _demand(moves, settings, macro)
        acceleration = np.zeros_like(demand)
        acceleration[1:-1] = np.diff(demand, 2, axis=0) / settings.sync_period**2
        offset = acceleration * np.array([a.mass for a in settings.axes])
        apart = _difference(demand, offset, stages, measured)
        if apart > most:
            best, most, said = moves, apart, name
    if best is None:
        return None
    return NextExperiment(
        f"{why}: the two differ by {before:.2g} floors in these recordings, and by {most:.2g} in "
        f"{said}",
        tuple(best),
        macro,
        _SMALL,
    )


def _difference(
    demand: F64, offset: F64, stages: Sequence[StageSettings], measured: Sequence[Measured]
) -> float:
    """Root mean square over floor of what two stages do differently, over all signals."""
    one, other = (
        simulate(stage, demand, offset, None, substeps=stage.quick_substeps) for stage in stages
    )
    total = []
    for a, axis in enumerate(stages[0].axes):
        for signal in ("position", "force"):
            apart = getattr(one, signal)[:, a] - getattr(other, signal)[:, a]
            floor = max(measured[0].floor.rms[axis.name][signal], 1e-12)
            total.append(float(np.mean(np.square(np.nan_to_num(apart, nan=1.0)))) / floor**2)
    return float(np.sqrt(np.mean(total)))


def _reach(measured: Sequence[Measured], axis: str) -> Reach:
    low, high, speed, acceleration = np.inf, -np.inf, 0.0, 0.0
    for m in measured:
        demand = m.replay.demand[:, m.replay.names.index(axis)]
        velocity = np.diff(demand) / m.replay.period
        low, high = min(low, float(demand.min())), max(high, float(demand.max()))
        speed = max(speed, float(np.abs(velocity).max()))
        # Over ten periods: setpoints are rounded.
        steep = np.abs(velocity[10:] - velocity[:-10]) / (10 * m.replay.period)
        acceleration = max(acceleration, float(steep.max()) if len(steep) else 0.0)
    # A hair inside, for setpoints are rounded.
    return Reach(_up(low), -_up(-high), -_up(-speed), -_up(-0.99 * acceleration))


def _up(value: float) -> float:
    """Rounded to ten thousandths, and never below."""
    return float(math.ceil(value * 1e4 - 1e-6) / 1e4)


def _sequences(
    settings: StageSettings, axis: str, reach: Mapping[str, Reach]
) -> list[tuple[str, list[Move]]]:
    """What to try, each with its name: some seconds long."""
    own = reach[axis]
    names = [a.name for a in settings.axes]
    middle = {n: round(0.5 * (reach[n].low + reach[n].high), _DIGITS) for n in names}

    def to(target: float, which: str = axis, **more: Any) -> list[Move]:
        where = {**middle, which: target}
        return [{"to": [round(where[name], 6) for name in names], **more}, {"dwell": _REST}]

    def between(share: float) -> float:
        return round(own.low + share * (own.high - own.low), _DIGITS)

    def slow(share: float) -> float:
        return -_up(-share * own.speed)

    long = [*to(own.high), *to(own.low)]
    speeds = [
        move
        for share in _SHARES
        for end in (own.high, own.low)
        for move in to(end, velocity=slow(share))
    ]
    sweep = [*to(own.high, velocity=slow(_CREEP)), *to(own.low, velocity=slow(_CREEP))]
    short = [move for i in range(8) for move in to(between(3 * i % 8 / 8))]
    small = []
    for share in (0.25, 0.5, 0.75):
        small += to(between(share))
        for size in (size * sign for size in _MICRO for sign in (1.0, -1.0)):
            small += to(between(share) + size, kind="micro")
    rests = [{"dwell": _LONG_REST}, *to(own.high), {"dwell": _LONG_REST}, *to(own.low)]
    found = [
        ("long strokes at full speed", long * 4),
        ("strokes at several speeds", speeds),
        ("a slow sweep there and back", sweep),
        ("short strokes at full acceleration", short),
        ("small reversals", small),
        ("strokes with long rests", rests * 2),
    ]
    found = [(name, [*to(own.low), *moves]) for name, moves in found]
    for name in names:
        if name != axis:
            low, high = reach[name].low, reach[name].high
            moves = [*to(low, name), *([*to(high, name), *to(low, name)] * 4)]
            found.append((f"strokes of {name} alone", moves))
    return found


def _demand(moves: Sequence[Move], settings: StageSettings, macro: Mapping[str, float]) -> F64:
    """Setpoints of a sequence, float64[K, axes] [m]; `macro` as in a recipe."""
    period = settings.sync_period
    at = np.array(moves[0]["to"])
    parts = [np.tile(at, (round(_REST / period), 1))]
    for move in moves[1:]:
        if "dwell" in move:
            parts.append(np.tile(at, (round(move["dwell"] / period), 1)))
            continue
        to = np.array(move["to"])
        each = []
        for a in range(len(settings.axes)):
            limits = _SMALL if move.get("kind") == "micro" else macro
            speed = move.get("velocity", limits["velocity"])
            each.append(
                stroke(to[a] - at[a], speed, limits["acceleration"], limits["jerk"], period)
            )
        length = max(len(values) for values in each)
        part = np.tile(to, (length, 1))
        for a, values in enumerate(each):
            part[: len(values), a] = at[a] + values
        parts.append(part)
        at = to
    return np.concatenate(parts)
