"""Samples of a trajectory, compiled."""

from __future__ import annotations

from stagedata.compiled import kernel


@kernel()
def sample_pieces(pieces, duration, target, time, position, velocity, acceleration):  # type: ignore[no-untyped-def]
    """Position [m], velocity [m/s] and acceleration [m/s^2], shape (K,), written.

    Args:
        pieces: start, position, velocity, acceleration and jerk of a trajectory's pieces, (n,).
        duration: of it [s].
        target: of it [m].
        time: of the samples [s], shape (K,); fastest in ascending order.
        position: shape (K,).
        velocity: shape (K,).
        acceleration: shape (K,).
    """
    start, places, speeds, rates, jerks = pieces
    piece, last = 0, start.shape[0] - 1
    for k in range(time.shape[0]):
        now = time[k]
        while piece < last and start[piece + 1] <= now:
            piece += 1
        while piece > 0 and start[piece] > now:
            piece -= 1
        t = max(now - start[piece], 0.0)
        j, a, v = jerks[piece], rates[piece], speeds[piece]
        if now >= duration:
            position[k], velocity[k], acceleration[k] = target, 0.0, 0.0
        elif now < 0.0:
            position[k], velocity[k], acceleration[k] = places[piece], 0.0, 0.0
        else:
            position[k] = places[piece] + t * (v + t * (a / 2 + t * j / 6))
            velocity[k] = v + t * (a + t * j / 2)
            acceleration[k] = a + t * j
