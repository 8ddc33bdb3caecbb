"""The incremental encoder of the simulated stage, compiled."""

from __future__ import annotations

from stagedata.compiled import kernel

_VELOCITY_TIME = 1e-3  # low-pass time constant of the velocity that 0x606C reports [s]


@kernel(inline="always")
def end_tick(p, s, normals, a, tick, period):  # type: ignore[no-untyped-def]
    """Let the friction of an axis wander, and read its encoder.

    Args:
        p: record of the axis.
        s: state of the axis.
        normals: as of `mechanics.advance`.
        a: number of the axis.
        tick: index in `normals`.
        period: Tc [s].
    """
    noisy = normals.shape[2] > 0
    misread, drawn = (normals[a, 0, tick], normals[a, 1, tick]) if noisy else (0.0, 0.0)
    s.wander = p.wander_keep * s.wander + p.wander * drawn
    read_encoder(p, s, period, misread)


@kernel()
def read_encoder(plant, state, period, normal):  # type: ignore[no-untyped-def]
    """Read the encoder of one axis, quantised and with noise, and filter its velocity.

    Sets `encoder` [m] and `speed` [m/s] of its state.

    Args:
        plant: record of the axis.
        state: state of the axis.
        period: Tc [s].
        normal: standard normal of this tick.
    """
    place = state.position
    if plant.misreading >= 0:
        place += state.misread + state.misread_slope * (place - state.place)
    if plant.on_load:
        place += state.deflection
    reading = round((place + plant.noise * normal) / plant.increment) * plant.increment
    state.speed += (
        period / (_VELOCITY_TIME + period) * ((reading - state.encoder) / period - state.speed)
    )
    state.encoder = reading
