"""The Kalman filter of one axis, compiled: its covariance follows what is known of each sample.

With punctual samples it is the steady filter of `ObserverModel`. A sample taken off its instant is
off in position by the speed of the demand times that time; the setpoints came with the same SYNC,
so the drive has seen the same error. Both are noise of that variance, and of none at rest.
"""

from __future__ import annotations

from stagedata.compiled import kernel

RAMP_FROM, RAMP_TO, KICK = range(3)
"""Vectors of a model, as in `ObserverModel`."""
READ = 0
"""The state that a sample reads."""


@kernel()
def take_in(estimate, covariance, innovation, variance):  # type: ignore[no-untyped-def]
    """Correct the estimate by a sample.

    Args:
        estimate: (N,), changed in place.
        covariance: of it, (N, N), changed in place.
        innovation: sample less prediction [m].
        variance: of the sample [m^2].
    """
    states = len(estimate)
    read = covariance[:, READ].copy()
    spread = read[READ] + variance
    for i in range(states):
        gain = read[i] / spread
        estimate[i] += gain * innovation
        for k in range(i + 1):
            covariance[i, k] -= gain * read[k]
            covariance[k, i] = covariance[i, k]


@kernel()
def predict(transition, vectors, offsets, shaken, estimate, covariance, rooms):  # type: ignore[no-untyped-def]
    """Advance estimate and covariance by a period, without the disturbance's walk.

    Args:
        transition: (N, N).
        vectors: `RAMP_FROM`, `RAMP_TO` and `KICK`, (3, N).
        offsets: force offset, from and to [N].
        shaken: variance of what the drive may have read too much in it [m^2].
        estimate: (N,), changed in place.
        covariance: (N, N), changed in place.
        rooms: scratch, (N + 1, N).
    """
    states = len(estimate)
    start, end = offsets
    for i in range(states):
        total = vectors[RAMP_FROM, i] * start + vectors[RAMP_TO, i] * end
        for k in range(states):
            total += transition[i, k] * estimate[k]
        rooms[states, i] = total
        for j in range(states):
            total = 0.0
            for k in range(states):
                total += transition[i, k] * covariance[k, j]
            rooms[i, j] = total
    estimate[:] = rooms[states]
    for i in range(states):
        for j in range(i + 1):
            total = shaken * vectors[KICK, i] * vectors[KICK, j]
            for k in range(states):
                total += rooms[i, k] * transition[j, k]
            covariance[i, j] = covariance[j, i] = total
