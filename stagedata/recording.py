"""A recording of a run in memory: the samples of every axis and the moves they belong to.

For each SYNC k it holds the setpoint pair sent (0x607A, 0x60B2) and the actual values sampled
(0x6064, 0x6077, 0x6041), in SI units, on the timing of docs/reference/reference-stage.md. Files are
read and written by `stagectl.store`. Homing and jogging are not part of the samples.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]
StatusArray = npt.NDArray[np.uint16]

MOVE_KINDS = ("macro", "micro", "creep", "home", "other")


@dataclass(frozen=True, slots=True, eq=False)
class AxisSignals:
    """The signals of one axis; sample k belongs to SYNC k.

    Attributes:
        position_demand: float64[K], target position r_k sent for SYNC k [m].
        force_offset: float64[K], force offset f_k sent for SYNC k [N].
        position_actual: float64[K], sampled at SYNC k [m].
        force_actual: float64[K], sampled at SYNC k [N].
        statusword: uint16[K], or None in foreign recordings.
        valid: bool[K], False where the TPDO of SYNC k was missed and the last value stands.
        missing: channels that were not logged: the smoothed position stands for `position_demand`
            of a foreign recording, the target for that of drives which moved by their own profiles,
            zeros for `force_actual`.

    Raises:
        ValueError: the arrays are not one-dimensional or differ in length.
    """

    position_demand: FloatArray
    force_offset: FloatArray
    position_actual: FloatArray
    force_actual: FloatArray
    statusword: StatusArray | None
    valid: BoolArray
    missing: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        shape = self.position_demand.shape
        if len(shape) != 1:
            raise ValueError(f"position_demand: must have one dimension, has shape {shape}")
        for name in ("force_offset", "position_actual", "force_actual", "statusword", "valid"):
            values = getattr(self, name)
            if values is not None and values.shape != shape:
                raise ValueError(f"{name}: shape {values.shape}, position_demand has {shape}")

    def __len__(self) -> int:
        return len(self.position_demand)


@dataclass(frozen=True, slots=True)
class Move:
    """One demanded move of all axes together.

    Attributes:
        kind: one of `MOVE_KINDS`.
        start: first sample of the demand's motion.
        end: one past the last sample of the demand's motion.
        origin: axis -> position before the move [m].
        target: axis -> position after it [m].
        site: counted from 1, or None where the move belongs to no site.
    """

    kind: str
    start: int
    end: int
    origin: Mapping[str, float]
    target: Mapping[str, float]
    site: int | None = None

    def distance(self, axis: str) -> float:
        """Signed length of the move on `axis` [m]."""
        return self.target[axis] - self.origin[axis]


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """One run: its samples and what they were made with.

    Attributes:
        machine: text of the machine file (YAML) that the host used.
        recipe: text of the recipe, "" where there was none.
        started: ISO 8601 time with zone.
        time: float64[K], host time of SYNC k since the first [s].
        axes: axis name -> signals, all of length K, in the machine's order.
        moves: in order of time.
        source: where it came from (a file name), for messages.

    Raises:
        ValueError: no axis, lengths that differ, or a move outside the samples.
    """

    machine: str
    recipe: str
    started: str
    time: FloatArray
    axes: Mapping[str, AxisSignals]
    moves: tuple[Move, ...]
    source: str

    def __post_init__(self) -> None:
        if not self.axes:
            raise ValueError("axes: none")
        for name, signals in self.axes.items():
            if len(signals) != len(self.time):
                raise ValueError(f"axes/{name}: {len(signals)} samples, time has {len(self.time)}")
        for i, move in enumerate(self.moves):
            if not 0 <= move.start <= move.end <= len(self.time):
                raise ValueError(
                    f"moves[{i}]: samples {move.start}..{move.end} are not within "
                    f"0..{len(self.time)}"
                )
            if set(move.origin) != set(self.axes) or set(move.target) != set(self.axes):
                raise ValueError(f"moves[{i}]: origin and target must name the axes")

    def __len__(self) -> int:
        return len(self.time)

    def rest_end(self, move: int) -> int:
        """One past the last sample of move number `move` (from 0) and the rest after it.

        That is the start of the next move, or K for the last one.
        """
        return self.moves[move + 1].start if move + 1 < len(self.moves) else len(self.time)


def aligned_demand(signals: AxisSignals, ratio: float) -> FloatArray:
    """Demand inside the drive at the instants the actual values are sampled.

    d_k = r_{k-1} + (r_k - r_{k-1}) ratio, r_{-1} = r_0 (docs/reference/reference-stage.md, Timing).

    Args:
        signals: of one axis, K samples.
        ratio: Tc/Ts, control period over SYNC period.

    Returns:
        float64[K] [m].
    """
    demand = signals.position_demand
    previous = np.concatenate((demand[:1], demand[:-1]))
    # At rest the sum is exactly r_k: no rounding may hide that the demand has arrived.
    return previous + (demand - previous) * ratio
