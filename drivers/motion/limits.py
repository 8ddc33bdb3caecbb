"""Setpoints against the axis' limits, on whole arrays, before anything is sent."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from drivers import objects as od
from drivers.errors import LimitError, shown
from drivers.motion.profile_position import Setpoint
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
    return targets, _force_counts(offset, axes)


def checked_velocities(
    velocity: NDArray[np.float64],
    offset: NDArray[np.float64],
    axes: Sequence[AxisSettings],
    start: Sequence[float],
    period: float,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rounds velocities (csv) to CAN integers after checking all of them.

    Args:
        velocity: float64[K, n] [m/s], from rest to rest: the last row is 0, nothing follows it.
        offset: float64[K, n] force offsets [N].
        axes: settings of the n axes.
        start: where the axes stand [m].
        period: Ts [s].

    Returns:
        int64[K, n] target velocities [increments/s], int64[K, n] force offsets [1/1000 rated].

    Raises:
        LimitError: wrong shape, not finite, faster than velocity or acceleration limit, out of the
            travel on the way, or a last row that is not 0; names axis, limit and row.
    """
    velocity, offset = _checked_shape(velocity, offset, len(axes))
    for j, axis in enumerate(axes):
        v = velocity[:, j]
        for values, ref, unit in (
            (v, od.TARGET_VELOCITY, "m/s"),
            (offset[:, j], od.FORCE_OFFSET, "N"),
        ):
            _check_finite(values, axis, ref, unit)
        _within(np.abs(v), axis.velocity, "velocity", "m/s", axis, od.TARGET_VELOCITY)
        change = np.abs(np.diff(v, prepend=0.0)) / period
        _within(change, axis.acceleration, "acceleration", "m/s^2", axis, od.TARGET_VELOCITY)
        _ends_at_zero(v, axis, od.TARGET_VELOCITY)
        low, high = axis.travel
        path = start[j] + np.cumsum(v) * period
        outside = (path < low - axis.increment) | (path > high + axis.increment)
        if outside.any():
            row = int(outside.argmax())
            below = path[row] < low
            raise LimitError(
                f"row {row}: leads to {path[row]:.9g} m, {'below' if below else 'above'} the limit "
                f"{low if below else high:g} m",
                axis=axis.name, obj=od.SOFT_LIMIT_LOW if below else od.SOFT_LIMIT_HIGH,
            )  # fmt: skip
    units = np.array([a.velocity_unit_si for a in axes])
    return np.rint(velocity / units).astype(np.int64), _force_counts(offset, axes)


def checked_forces(force: NDArray[np.float64], axes: Sequence[AxisSettings]) -> NDArray[np.int64]:
    """Rounds forces (cst) to CAN integers after checking all of them.

    Args:
        force: float64[K, n] [N]; the last row is 0, nothing follows it.
        axes: settings of the n axes.

    Returns:
        int64[K, n] target forces [1/1000 rated].

    Raises:
        LimitError: wrong shape, not finite, above the peak force, or a last row that is not 0.
    """
    force, _ = _checked_shape(force, force, len(axes))
    for j, axis in enumerate(axes):
        _check_finite(force[:, j], axis, od.TARGET_FORCE, "N")
        _within(np.abs(force[:, j]), axis.peak_force, "force", "N", axis, od.MAX_FORCE)
        _ends_at_zero(force[:, j], axis, od.TARGET_FORCE)
    return _force_counts(force, axes)


def checked_profile(
    axis: AxisSettings,
    start: float,
    positions: Sequence[float],
    velocity: float,
    acceleration: float,
    relative: bool,
) -> list[Setpoint]:
    """Set-points for the drive's own profile after checking all of them.

    Args:
        axis: settings of the axis.
        start: where it is [m].
        positions: targets one after the other [m]; with `relative` each from the one before.
        velocity: of the profile [m/s].
        acceleration: of the profile [m/s^2].
        relative: see positions.

    Raises:
        LimitError: no target, velocity, acceleration or a target outside the axis' limits.
    """
    for value, limit, ref in (
        (velocity, axis.velocity, od.PROFILE_VELOCITY),
        (acceleration, axis.acceleration, od.PROFILE_ACCELERATION),
    ):
        if not 0 < value <= limit:
            raise LimitError(f"{shown(value)} is not in (0, {limit:g}]", axis=axis.name, obj=ref)
    if not positions:
        raise LimitError("there is no target", axis=axis.name, obj=od.TARGET_POSITION)
    low, high = axis.travel
    setpoints, at = [], start
    for number, position in enumerate(positions):
        end = at + position if relative else position
        if not low <= end <= high:
            below = end < low
            which = f"target {number + 1}: " if len(positions) > 1 else ""
            raise LimitError(
                f"{which}target {shown(end)} m is {'below' if below else 'above'} the limit "
                f"{low if below else high:g} m",
                axis=axis.name, obj=od.SOFT_LIMIT_LOW if below else od.SOFT_LIMIT_HIGH,
            )  # fmt: skip
        duration = abs(end - at) / velocity + velocity / acceleration
        counts = round(position / axis.increment)
        setpoints.append(Setpoint(counts, round(end / axis.increment), duration, relative))
        at = end
    return setpoints


def _checked_shape(
    values: NDArray[np.float64], offset: NDArray[np.float64], n: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    values = np.asarray(values, dtype=np.float64)
    offset = np.asarray(offset, dtype=np.float64)
    if values.ndim != 2 or values.shape[1] != n or offset.shape != values.shape:
        raise LimitError(
            f"setpoints must be [K, {n}], also their offsets, "
            f"are {list(values.shape)} and {list(offset.shape)}"
        )
    return values, offset


def _force_counts(force: NDArray[np.float64], axes: Sequence[AxisSettings]) -> NDArray[np.int64]:
    unit = np.array([a.rated_force / 1000 for a in axes])
    return np.clip(np.rint(force / unit), -32768, 32767).astype(np.int64)


def _check_finite(
    values: NDArray[np.float64], axis: AxisSettings, ref: od.ObjectRef, unit: str
) -> None:
    bad = ~np.isfinite(values)
    if bad.any():
        row = int(bad.argmax())
        raise LimitError(f"row {row}: {values[row]} {unit} is no setpoint", axis=axis.name, obj=ref)


def _within(
    values: NDArray[np.float64], limit: float, what: str, unit: str, axis: AxisSettings,
    ref: od.ObjectRef,
) -> None:  # fmt: skip
    above = values > limit * (1 + 1e-9)
    if above.any():
        row = int(above.argmax())
        raise LimitError(
            f"row {row}: {values[row]:.6g} {unit} exceeds the {what} limit {limit:g} {unit}",
            axis=axis.name, obj=ref,
        )  # fmt: skip


def _ends_at_zero(values: NDArray[np.float64], axis: AxisSettings, ref: od.ObjectRef) -> None:
    if len(values) and values[-1] != 0:
        raise LimitError(
            f"row {len(values) - 1}: the last one must be 0, since nothing follows it",
            axis=axis.name, obj=ref,
        )  # fmt: skip


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
        _check_finite(values, axis, ref, unit)
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
