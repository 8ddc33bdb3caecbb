"""Setpoints against the axis' limits, on whole arrays, before anything is sent."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from drivers import objects as od
from drivers.errors import LimitError
from drivers.settings import AxisSettings


def checked_counts(
    position: NDArray[np.float64],
    offset: NDArray[np.float64],
    axes: Sequence[AxisSettings],
    last: Sequence[int],
    period: float,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rounds setpoints to CAN integers after checking all of them.

    Args:
        position: float64[K, n] [m].
        offset: float64[K, n] [N].
        axes: settings of the n axes.
        last: target sent last, per axis [increments]: where row 0 starts from.
        period: Ts [s].

    Returns:
        int64[K, n] target positions [increments], int64[K, n] force offsets [1/1000 rated],
        the latter clipped to INTEGER16.

    Raises:
        LimitError: wrong shape, not finite, outside the travel, or faster than the velocity
            limit; names axis, limit and row.
    """
    position = np.asarray(position, dtype=np.float64)
    offset = np.asarray(offset, dtype=np.float64)
    n = len(axes)
    if position.ndim != 2 or position.shape[1] != n or offset.shape != position.shape:
        raise LimitError(
            f"setpoints must be [K, {n}] for positions and offsets, "
            f"are {list(position.shape)} and {list(offset.shape)}"
        )
    increment = np.array([a.increment for a in axes])
    for j, axis in enumerate(axes):
        _check_axis(position[:, j], offset[:, j], axis, last[j], period)
    targets = np.rint(position / increment).astype(np.int64)
    unit = np.array([a.rated_force / 1000 for a in axes])
    offsets = np.clip(np.rint(offset / unit), -32768, 32767).astype(np.int64)
    return targets, offsets


def _check_axis(
    position: NDArray[np.float64],
    offset: NDArray[np.float64],
    axis: AxisSettings,
    last: int,
    period: float,
) -> None:
    for values, ref, unit in (
        (position, od.TARGET_POSITION, "m"),
        (offset, od.FORCE_OFFSET, "N"),
    ):
        bad = ~np.isfinite(values)
        if bad.any():
            row = int(bad.argmax())
            raise LimitError(
                f"row {row}: {values[row]} {unit} is no setpoint", axis=axis.name, obj=ref
            )
    low, high = axis.travel
    margin = axis.increment / 2  # rounding alone leaves no travel
    outside = (position < low - margin) | (position > high + margin)
    if outside.any():
        row = int(outside.argmax())
        below = position[row] < low
        raise LimitError(
            f"row {row}: target {position[row]:.9g} m is {'below' if below else 'above'} "
            f"the limit {low if below else high:g} m",
            axis=axis.name,
            obj=od.SOFT_LIMIT_LOW if below else od.SOFT_LIMIT_HIGH,
        )
    speed = np.abs(np.diff(position, prepend=last * axis.increment)) / period
    fast = speed > axis.velocity + 1.5 * axis.increment / period
    if fast.any():
        row = int(fast.argmax())
        raise LimitError(
            f"row {row}: {speed[row]:.6g} m/s from the setpoint before exceeds the velocity limit "
            f"{axis.velocity:g} m/s",
            axis=axis.name,
            obj=od.TARGET_POSITION,
        )
