"""The incremental encoder of the simulated stage, compiled."""

from __future__ import annotations

import numba

_SPEED_TIME = 1e-3  # low-pass of the encoder velocity that 0x606C reports [s]


@numba.njit(cache=True, error_model="numpy")
def read_encoder(plant, state, period, normal):  # type: ignore[no-untyped-def]
    """Take a reading of one axis: quantised, with noise; the speed the drive reports follows it.

    Sets `encoder` [m] and `speed` [m/s] of its state; `period` is Tc [s], `normal` a standard
    normal.
    """
    place = state.position
    if plant.misreading >= 0:
        place += state.misread + state.misread_slope * (place - state.place)
    reading = round((place + plant.noise * normal) / plant.increment) * plant.increment
    state.speed += (
        period / (_SPEED_TIME + period) * ((reading - state.encoder) / period - state.speed)
    )
    state.encoder = reading
