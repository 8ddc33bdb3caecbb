"""What the observers of all axes do between two SYNCs, compiled.

At SYNC k the drive sampled its position and took over the setpoints of row k. Now the rows' next
one is due: `step` corrects the prediction by the sample, predicts to the next SYNC with the offset
that was really sent, moves the correction towards what the axis lacks, and rounds the sum. What
rounding leaves goes into the next row, so that steps of the offset average out.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from estimation.compiled import kernel
from estimation.observer.model import LACK

POSITION, MEASURED_FORCE, VALID, ARRIVAL = range(4)
"""Columns of a sample: [increments], [1/1000 rated], 1 or 0, time of its frame after SYNC [ns]."""
OFF, FRESH, RUNNING, FAILED = range(4)
"""Of an axis: its offsets are sent as planned; before its first sample; observed; a value was not
finite, the correction stays as it is."""
PUNCTUAL = 1.0
"""A sample says nothing where what is not known of its instant is worth more than so many sigma of
its prediction at the speed of the demand."""
USUAL = 1e-3
"""The usual arrival of a frame follows the actual one by so much of Ts at most, per SYNC."""
STALE = 20
"""Setpoints moved by more than so many increments, yet the sample repeats the one before: stale."""
LOST = 20
"""After so many periods without a row the estimate begins anew."""

F64 = NDArray[np.float64]
I64 = NDArray[np.int64]


class Observers(NamedTuple):
    """The observers of n axes, with N states each; read only.

    Attributes:
        transition: (n, N, N); ramp_from, ramp_to, gain: (n, N), as in `ObserverModel`.
        spread: of a sample around its prediction, 1 sigma, (n,) [m].
        correction_gain: g / force ratio, (n,); share: of the correction kept, 1 - g, (n,).
        limit: of the correction, (n,) [N].
        increment: one unit of positions, (n,) [m].
        unit: one unit of forces, (n,) [N].
        saturation: force from which the drive counts as saturated, (n,) [1/1000 rated].
        period: Ts [ns].
        first_tick: share of a step of the demand that is made when the sample is taken, Tc/Ts.
    """

    transition: F64
    ramp_from: F64
    ramp_to: F64
    gain: F64
    spread: F64
    correction_gain: F64
    share: F64
    limit: F64
    increment: F64
    unit: F64
    saturation: F64
    period: float
    first_tick: float


class State(NamedTuple):
    """State of the observers.

    Attributes:
        phase: `OFF`, `FRESH`, `RUNNING` or `FAILED`, (n,).
        estimate: prediction for the next sample, (n, N).
        correction: of the force offset, (n,) [N].
        acting: offset sent less planned, in this period and the one before, (n, 2) [N].
        carried: what rounding has left, (n,) [1/1000 rated].
        target: sent last, and the one before, (n, 2) [increments].
        before: position and force of the sample before, (n, 2).
        usual: arrival of the frames, (n,) [ns]; negative before the first.
        trial: estimate being computed, (2, N).
    """

    phase: I64
    estimate: F64
    correction: F64
    acting: F64
    carried: F64
    target: I64
    before: I64
    usual: F64
    trial: F64


@kernel()
def step(observers, state, targets, planned, row, periods, doubt, sample, sent):  # type: ignore[no-untyped-def]
    """Choose the force offsets of one row (9 arguments, so that a SYNC needs one call).

    Args:
        observers: `Observers`.
        state: `State`, changed in place.
        targets: of the stream, int64[K, n] [increments].
        planned: force offsets of the stream, float64[K, n] [1/1000 rated].
        row: that is sent next.
        periods: from the last SYNC that had a row to the one of this row.
        doubt: how far that SYNC was off its place on the grid, over Ts.
        sample: of that SYNC, int64[n, 4].
        sent: written, int64[n]: force offsets of the row [1/1000 rated].
    """
    for a in range(len(sent)):
        if state.phase[a] == OFF:
            sent[a] = within_integer16(planned[row, a])
            continue
        if periods > LOST and state.phase[a] == RUNNING:
            state.phase[a] = FRESH
        if state.phase[a] != FAILED:
            observe(observers, state, a, periods, doubt, sample)
        unit = observers.unit[a]
        wanted = planned[row, a] + state.correction[a] / unit + state.carried[a]
        sent[a] = within_integer16(wanted)
        state.carried[a] = min(max(wanted - sent[a], -0.5), 0.5)
        state.acting[a, 1] = state.acting[a, 0]
        state.acting[a, 0] = (sent[a] - planned[row, a]) * unit
        state.target[a, 1] = state.target[a, 0]
        state.target[a, 0] = targets[row, a]


@kernel()
def within_integer16(value):  # type: ignore[no-untyped-def]
    """The nearest INTEGER16."""
    return int(min(max(np.rint(value), -32768.0), 32767.0))


@kernel()
def observe(observers, state, a, periods, doubt, sample):  # type: ignore[no-untyped-def]
    """Take in the sample of axis `a`, predict to the next SYNC, move the correction.

    Arguments as those of `step`.
    """
    estimate, trial = state.estimate[a], state.trial
    position, force = sample[a, POSITION], sample[a, MEASURED_FORCE]
    valid = sample[a, VALID] != 0
    begins = state.phase[a] == FRESH
    if begins and not valid:
        return
    going = state.target[a, 0] - state.target[a, 1]
    demand = state.target[a, 1] + observers.first_tick * going
    deviation = (position - demand) * observers.increment[a]
    saturated = valid and abs(force) >= observers.saturation[a]
    stale = position == state.before[a, 0] and force == state.before[a, 1] and abs(going) > STALE
    if valid:
        doubt = abs(doubt) + unpunctuality(observers, state, a, sample[a, ARRIVAL])
    late = abs(going) * doubt * observers.increment[a] > PUNCTUAL * observers.spread[a]
    state.before[a, 0], state.before[a, 1] = position, force
    before, now = state.acting[a, 1], state.acting[a, 0]
    trial[0] = estimate
    if begins or saturated:  # nothing else is known: what was lacking still is
        trial[0] = 0.0
        trial[0, 0], trial[0, LACK] = deviation, estimate[LACK]
    else:
        for _ in range(periods - 1):
            predict(observers, a, before, before, trial)
        if valid and not stale and not late:
            trial[0] += observers.gain[a] * (deviation - trial[0, 0])
    predict(observers, a, before, now, trial)
    if saturated:
        trial[0, LACK] = estimate[LACK]
    for value in trial[0]:
        if not math.isfinite(value):
            state.phase[a] = FAILED
            return
    state.phase[a] = RUNNING
    estimate[:] = trial[0]
    if not saturated:
        moved = observers.share[a] * state.correction[a]
        moved += observers.correction_gain[a] * estimate[LACK]
        state.correction[a] = min(max(moved, -observers.limit[a]), observers.limit[a])


@kernel()
def unpunctuality(observers, state, a, arrival):  # type: ignore[no-untyped-def]
    """How far the sample of axis `a` may be off its instant by the arrival of its frame, over Ts.

    A drive samples when SYNC reaches it, and its answer follows; both may have been delayed.
    """
    if state.usual[a] < 0.0:
        state.usual[a] = arrival
    most = USUAL * observers.period
    off = arrival - state.usual[a]
    state.usual[a] += min(max(off, -most), most)
    return abs(off) / observers.period


@kernel()
def predict(observers, a, start, end, trial):  # type: ignore[no-untyped-def]
    """Advance the state in `trial`'s first row, (2, N), by a period of axis `a`.

    The offset goes from `start` to `end` [N].
    """
    states = trial.shape[1]
    for i in range(states):
        total = observers.ramp_from[a, i] * start + observers.ramp_to[a, i] * end
        for k in range(states):
            total += observers.transition[a, i, k] * trial[0, k]
        trial[1, i] = total
    trial[0] = trial[1]


def make_state(axes: int, states: int) -> State:
    """The state of observers that are off."""
    return State(
        np.full(axes, OFF, np.int64),
        np.zeros((axes, states)),
        np.zeros(axes),
        np.zeros((axes, 2)),
        np.zeros(axes),
        np.zeros((axes, 2), np.int64),
        np.zeros((axes, 2), np.int64),
        np.full(axes, -1.0),
        np.zeros((2, states)),
    )
