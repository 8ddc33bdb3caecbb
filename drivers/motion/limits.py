"""Checks of setpoints against the limits of an axis, before anything is sent.

Source: CiA 402-2, modes 1, 8, 9 and 10: 0x607A, 0x60FF, 0x6071 and 0x60B2.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers import objects as od
from drivers.drive import counts, dimension, unit
from drivers.errors import LimitError, shown
from drivers.settings import AxisSettings
from stagedata import F64


@dataclass(frozen=True, slots=True)
class Setpoint:
    """One target of a drive's own profile (pp).

    Attributes:
        target: absolute, or with `relative` from the previous target [increments].
        end: absolute position that it leads to [increments].
        duration: of the profile [s].
        relative: controlword bit 6.
    """

    target: int
    end: int
    duration: float
    relative: bool = False


def checked_positions(
    position: F64,
    offset: F64,
    axes: Sequence[AxisSettings],
    last: Sequence[int],
    period: float,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Checks positions (csp), then rounds them to the bus' integers.

    Args:
        position: float64[K, n] [m].
        offset: float64[K, n] force offsets [N].
        axes: settings of the n axes.
        last: target sent last, per axis [increments], from which row 0 starts.
        period: Ts [s].

    Returns:
        int64[K, n] target positions [increments], int64[K, n] force offsets [1/1000 rated],
        clipped to INTEGER16.

    Raises:
        LimitError: wrong shape, not finite, outside the travel, or above the velocity limit; names
            axis, limit and row.
    """
    position, offset = _checked_shape(position, offset, len(axes))
    for j, axis in enumerate(axes):
        at = position[:, j]
        _check_finite(at, axis, od.TARGET_POSITION, "m")
        _check_finite(offset[:, j], axis, od.FORCE_OFFSET, "N")
        row = _first_outside(at, axis, axis.increment / 2)  # rounding may exceed the travel
        if row is not None:
            raise beyond_travel(axis, at[row], f"row {row}: target {at[row]:.9g} m is")
        speed = np.abs(np.diff(at, prepend=last[j] * axis.increment)) / period
        fast = speed > axis.velocity + 1.5 * axis.increment / period
        if fast.any():
            row = int(fast.argmax())
            raise LimitError(
                f"row {row}: {speed[row]:.6g} m/s from the previous setpoint exceeds the velocity "
                f"limit {axis.velocity:g} m/s",
                axis=axis.name, obj=od.TARGET_POSITION,
            )  # fmt: skip
    return _counts(position, axes, od.TARGET_POSITION), _force_counts(offset, axes, od.FORCE_OFFSET)


def checked_velocities(
    velocity: F64,
    offset: F64,
    axes: Sequence[AxisSettings],
    start: Sequence[float],
    period: float,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Checks velocities (csv), then rounds them to the bus' integers.

    Args:
        velocity: float64[K, n] [m/s], from rest to rest: the last row is 0.
        offset: float64[K, n] force offsets [N].
        axes: settings of the n axes.
        start: actual positions [m].
        period: Ts [s].

    Returns:
        int64[K, n] target velocities [increments/s], int64[K, n] force offsets [1/1000 rated].

    Raises:
        LimitError: wrong shape, not finite, above the velocity or acceleration limit, leaves the
            travel, or a last row that is not 0; names axis, limit and row.
    """
    velocity, offset = _checked_shape(velocity, offset, len(axes))
    for j, axis in enumerate(axes):
        v = velocity[:, j]
        _check_finite(v, axis, od.TARGET_VELOCITY, "m/s")
        _check_finite(offset[:, j], axis, od.FORCE_OFFSET, "N")
        _within(np.abs(v), axis.velocity, "velocity", "m/s", axis, od.TARGET_VELOCITY)
        change = np.abs(np.diff(v, prepend=0.0)) / period
        _within(change, axis.acceleration, "acceleration", "m/s^2", axis, od.TARGET_VELOCITY)
        _ends_at_zero(v, axis, od.TARGET_VELOCITY)
        path = start[j] + np.cumsum(v) * period
        row = _first_outside(path, axis, axis.increment)
        if row is not None:
            raise beyond_travel(axis, path[row], f"row {row}: leads to {path[row]:.9g} m,")
    return _counts(velocity, axes, od.TARGET_VELOCITY), _force_counts(offset, axes, od.FORCE_OFFSET)


def checked_forces(force: F64, axes: Sequence[AxisSettings]) -> NDArray[np.int64]:
    """Checks forces (cst), then rounds them to the bus' integers.

    Args:
        force: float64[K, n] [N]; the last row is 0.
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
    return _force_counts(force, axes, od.TARGET_FORCE)


def checked_profile(
    axis: AxisSettings,
    start: float,
    positions: Sequence[float],
    velocity: float,
    acceleration: float,
    relative: bool,
) -> list[Setpoint]:
    """Checks targets of a drive's own profile (pp) and makes setpoints of them.

    Args:
        axis: settings of the axis.
        start: actual position [m].
        positions: targets in order [m], with `relative` each from the previous one.
        velocity: of the profile [m/s].
        acceleration: of the profile [m/s^2].
        relative: see positions.

    Raises:
        LimitError: no target, a target outside the axis' limits, or as `check_profile`.
    """
    check_profile(axis, velocity, acceleration)
    if not positions:
        raise LimitError("no target given", axis=axis.name, obj=od.TARGET_POSITION)
    setpoints, at = [], start
    for number, position in enumerate(positions):
        end = at + position if relative else position
        if not axis.travel[0] <= end <= axis.travel[1]:
            which = f"target {number + 1}: " if len(positions) > 1 else ""
            raise beyond_travel(axis, end, f"{which}target {shown(end)} m is")
        duration = abs(end - at) / velocity + velocity / acceleration
        target, last = (counts(axis, od.TARGET_POSITION, value) for value in (position, end))
        setpoints.append(Setpoint(target, last, duration, relative))
        at = end
    return setpoints


def check_profile(axis: AxisSettings, velocity: float, acceleration: float) -> None:
    """Checks velocity [m/s] and acceleration [m/s^2] of a drive's own profile (pp).

    Raises:
        LimitError: outside the axis' limits, or less than half a unit of the drive, which it would
            be told as 0.
    """
    for value, limit, ref in (
        (velocity, axis.velocity, od.PROFILE_VELOCITY),
        (acceleration, axis.acceleration, od.PROFILE_ACCELERATION),
    ):
        if not 0 < value <= limit:
            raise LimitError(f"{shown(value)} is not in (0, {limit:g}]", axis=axis.name, obj=ref)
        if counts(axis, ref, value) < 1:
            one = f"{unit(axis, ref):g} {dimension(axis, ref)}"
            raise LimitError(
                f"{shown(value)} is nothing in steps of {one}", axis=axis.name, obj=ref
            )


def beyond_travel(axis: AxisSettings, position: float, what: str) -> LimitError:
    """The error of a `position` outside the travel [m], `what` being the start of its message."""
    low, high = axis.travel
    side, limit, ref = ("above", high, od.SOFT_LIMIT_HIGH)
    if position < low:
        side, limit, ref = ("below", low, od.SOFT_LIMIT_LOW)
    return LimitError(f"{what} {side} the limit {limit:g} m", axis=axis.name, obj=ref)


def _first_outside(position: F64, axis: AxisSettings, margin: float) -> int | None:
    """The first row outside the travel by more than `margin` [m]; None: there is none."""
    low, high = axis.travel
    outside = (position < low - margin) | (position > high + margin)
    return int(outside.argmax()) if outside.any() else None


def _checked_shape(values: F64, offset: F64, n: int) -> tuple[F64, F64]:
    values = np.asarray(values, dtype=np.float64)
    offset = np.asarray(offset, dtype=np.float64)
    if values.ndim != 2 or values.shape[1] != n or offset.shape != values.shape:
        raise LimitError(
            f"setpoints and their offsets must be [K, {n}], "
            f"are {list(values.shape)} and {list(offset.shape)}"
        )
    return values, offset


def _counts(values: F64, axes: Sequence[AxisSettings], ref: od.ObjectRef) -> NDArray[np.int64]:
    """SI values [K, n] in the axes' units of an object."""
    return np.rint(values / np.array([unit(axis, ref) for axis in axes])).astype(np.int64)


def _force_counts(force: F64, axes: Sequence[AxisSettings], ref: od.ObjectRef) -> NDArray[np.int64]:
    units = np.array([unit(axis, ref) for axis in axes])
    return np.clip(np.rint(force / units), -32768, 32767).astype(np.int64)


def _check_finite(values: F64, axis: AxisSettings, ref: od.ObjectRef, unit: str) -> None:
    _refuse(~np.isfinite(values), axis, ref, lambda row: f"{values[row]} {unit} is not finite")


def _within(
    values: F64, limit: float, what: str, unit: str, axis: AxisSettings,
    ref: od.ObjectRef,
) -> None:  # fmt: skip
    exceeds = f"{unit} exceeds the {what} limit {limit:g} {unit}"
    _refuse(values > limit * (1 + 1e-9), axis, ref, lambda row: f"{values[row]:.6g} {exceeds}")


def _refuse(
    bad: NDArray[np.bool_], axis: AxisSettings, ref: od.ObjectRef, why: Callable[[int], str]
) -> None:
    """Raises a `LimitError` that names the first bad row; where there is none, does nothing."""
    if bad.any():
        row = int(bad.argmax())
        raise LimitError(f"row {row}: {why(row)}", axis=axis.name, obj=ref)


def _ends_at_zero(values: F64, axis: AxisSettings, ref: od.ObjectRef) -> None:
    if len(values) and values[-1] != 0:
        raise LimitError(
            f"row {len(values) - 1}: the last setpoint must be 0, since none follows",
            axis=axis.name, obj=ref,
        )  # fmt: skip
