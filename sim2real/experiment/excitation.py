"""A recipe that tells effects apart, made from the limits of the machine alone.

Each part separates what the others confuse. Slow sweeps show forces and friction over position
without inertia. Strokes at several speeds show viscous friction, drag and differences between the
directions. Small reversals at several places show presliding and hysteresis. Chirps show the loop's
dead time, current bandwidth and resonances.
"""

from __future__ import annotations

from collections.abc import Mapping

from hil_sim.settings import AxisSettings, StageSettings
from sim2real.experiment.sequences import MICRO_LIMITS, Move, Reach, candidate_sequences
from sim2real.findings import NextExperiment

PARTS = ("a slow sweep there and back", "strokes at several speeds", "small reversals")
"""Of `candidate_sequences`, in this order."""
_TRAVEL, _LIMITS = 0.6, 0.6
"""Shares of the travel and of the limits that are used."""
_LONGEST = 0.1
"""Longest stroke [m]: longer ones only take time."""
_CHIRP = {"amplitude": 50e-6, "duration": 8.0}
_ACCELERATION, _VELOCITY = 0.3, 0.1
"""Shares of the limits for chirps, which last."""
_LOWEST, _HIGHEST = 2.0, 0.2
"""Lowest frequency [Hz], and highest in SYNC frequencies."""
_LARGEST = 400.0
"""Highest frequency whatever the SYNC [Hz]: encoder and loop show nothing beyond."""


def excite_axes(settings: StageSettings, axes: tuple[str, ...] = ()) -> NextExperiment:
    """Moves that excite these axes one after the other.

    Args:
        settings: of the machine file.
        axes: names; none for all.
    """
    macro = {
        key: _LIMITS * min(getattr(a, key) for a in settings.axes)
        for key in ("velocity", "acceleration", "jerk")
    }
    reach = {a.name: _reach(a, macro) for a in settings.axes}
    micro = {
        key: min(value, *(_LIMITS * getattr(a, key) for a in settings.axes))
        for key, value in MICRO_LIMITS.items()
    }
    moves: list[Move] = []
    for axis in settings.axes:
        if axes and axis.name not in axes:
            continue
        parts = dict(candidate_sequences(settings, axis.name, reach))
        for part in PARTS:
            moves += parts[part]
        moves += _chirps(axis, reach, settings)
    return NextExperiment("they tell effects apart", tuple(moves), macro, micro)


def _reach(axis: AxisSettings, macro: Mapping[str, float]) -> Reach:
    low, high = axis.travel
    middle, half = 0.5 * (low + high), 0.5 * min(_TRAVEL * (high - low), _LONGEST)
    return Reach(middle - half, middle + half, macro["velocity"], macro["acceleration"])


def _chirps(axis: AxisSettings, reach: Mapping[str, Reach], settings: StageSettings) -> list[Move]:
    """A chirp at the middle and one near an end: resonances may depend on the position."""
    highest = min(_HIGHEST / settings.sync_period, _LARGEST)
    names = [a.name for a in settings.axes]
    moves: list[Move] = []
    for share in (0.5, 0.9):
        at = {n: 0.5 * (r.low + r.high) for n, r in reach.items()}
        own = reach[axis.name]
        at[axis.name] = own.low + share * (own.high - own.low)
        moves += [
            {"to": [round(at[n], 6) for n in names]},
            {"dwell": 0.2},
            {
                "excite": axis.name,
                **_CHIRP,
                "band": [_LOWEST, highest],
                "velocity": _VELOCITY * axis.velocity,
                "acceleration": _ACCELERATION * axis.acceleration,
                "jerk": axis.jerk,
            },
            {"dwell": 0.3},
        ]
    return moves
