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
"""Phases of an axis: its offsets are sent as planned; before its first sample; observed; a value
was not finite, the correction stays as it is."""
RAMP_FROM, RAMP_TO, GAIN = range(3)
"""Vectors of a model, as in `ObserverModel`."""
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
Records = NDArray[np.void]

AXIS_DTYPE = np.dtype(
    [
        ("spread", "f8"),
        ("correction_gain", "f8"),
        ("kept", "f8"),
        ("limit", "f8"),
        ("increment", "f8"),
        ("unit", "f8"),
        ("saturation", "f8"),
        ("first_tick", "f8"),
        ("usual_step", "f8"),
        ("period", "f8"),
    ],
    align=True,
)
"""Figures of an axis: sigma of a sample around its prediction [m]; g over force ratio; share of the
correction kept, 1 - g; limit of the correction [N]; units of position [m] and force [N]; force from
which the drive counts as saturated [1/1000 rated]; Tc/Ts, the share of a step of the demand that is
made when the sample is taken; `USUAL` and Ts [ns]."""
NOW_DTYPE = np.dtype(
    [
        ("phase", "i8"),
        ("correction", "f8"),
        ("acting", "f8"),
        ("acting_before", "f8"),
        ("carried", "f8"),
        ("target", "i8"),
        ("target_before", "i8"),
        ("position", "i8"),
        ("force", "i8"),
        ("usual_arrival", "f8"),
    ],
    align=True,
)
"""State of an axis: phase; correction [N]; offset sent less planned, in this period and the one
before [N]; what rounding has left [1/1000 rated]; target sent last and the one before [increments];
sample before [increments, 1/1000 rated]; usual arrival [ns], negative before the first."""


class Observers(NamedTuple):
    """The observers of n axes, with N states each; read only.

    Attributes:
        axes: records of `AXIS_DTYPE`, (n,).
        transition: (n, N, N).
        vectors: `RAMP_FROM`, `RAMP_TO` and `GAIN`, (n, 3, N).
    """

    axes: Records
    transition: F64
    vectors: F64


class State(NamedTuple):
    """State of the observers.

    Attributes:
        axes: records of `NOW_DTYPE`, (n,).
        estimate: prediction for the next sample, (n, N).
        trial: estimate being computed, (2, N).
    """

    axes: Records
    estimate: F64
    trial: F64


def make_observers(axes: int, states: int) -> Observers:
    """Observers whose figures are still to be set."""
    return Observers(
        np.zeros(axes, AXIS_DTYPE), np.zeros((axes, states, states)), np.zeros((axes, 3, states))
    )


def make_state(axes: int, states: int) -> State:
    """The state of observers that are off."""
    state = State(np.zeros(axes, NOW_DTYPE), np.zeros((axes, states)), np.zeros((2, states)))
    state.axes["phase"], state.axes["usual_arrival"] = OFF, -1.0
    return state


@kernel()
def step(observers, state, targets, planned, row, periods, doubt, sample, sent):  # type: ignore[no-untyped-def]
    """Choose the force offsets of one row (9 arguments, so that a SYNC needs one call).

    Args:
        observers: `Observers`.
        state: `State`, changed in place.
        targets: of the stream, int64[K, n] [increments].
        planned: force offsets of the stream, float64[K, n] [1/1000 rated].
        row: that is sent next.
        periods: from the SYNC of the row before the last one to that of the last one.
        doubt: how far that SYNC was off its place on the grid, over Ts.
        sample: of that SYNC, int64[n, 4].
        sent: written, int64[n]: force offsets of the row [1/1000 rated].
    """
    for a in range(len(sent)):
        now = state.axes[a]
        if now.phase == OFF:
            sent[a] = within_integer16(planned[row, a])
            continue
        if periods > LOST and now.phase == RUNNING:
            now.phase = FRESH
        if now.phase != FAILED:
            observe(observers, state, a, periods, doubt, sample)
        unit = observers.axes[a].unit
        wanted = planned[row, a] + now.correction / unit + now.carried
        sent[a] = within_integer16(wanted)
        now.carried = min(max(wanted - sent[a], -0.5), 0.5)
        now.acting_before = now.acting
        now.acting = (sent[a] - planned[row, a]) * unit
        now.target_before = now.target
        now.target = targets[row, a]


@kernel()
def within_integer16(value):  # type: ignore[no-untyped-def]
    """The nearest INTEGER16."""
    return int(min(max(np.rint(value), -32768.0), 32767.0))


@kernel()
def observe(observers, state, a, periods, doubt, sample):  # type: ignore[no-untyped-def]
    """Take in the sample of axis `a`, predict to the next SYNC, move the correction.

    Arguments as those of `step`.
    """
    own, now = observers.axes[a], state.axes[a]
    estimate, trial = state.estimate[a], state.trial
    position, force = sample[a, POSITION], sample[a, MEASURED_FORCE]
    valid = sample[a, VALID] != 0
    begins = now.phase == FRESH
    if begins and not valid:
        return
    going = now.target - now.target_before
    deviation = (position - (now.target_before + own.first_tick * going)) * own.increment
    saturated = valid and abs(force) >= own.saturation
    stale = position == now.position and force == now.force and abs(going) > STALE
    doubt = abs(doubt)
    if valid:
        doubt += unpunctuality(own, now, sample[a, ARRIVAL])
    late = abs(going) * doubt * own.increment > PUNCTUAL * own.spread
    now.position, now.force = position, force
    lacking = estimate[LACK]
    if begins or saturated:  # nothing else is known: what was lacking still is
        trial[0] = 0.0
        trial[0, 0], trial[0, LACK] = deviation, lacking
    else:
        trial[0] = estimate
        for _ in range(periods - 1):
            predict(observers, a, now.acting_before, now.acting_before, trial)
        if valid and not stale and not late:
            trial[0] += observers.vectors[a, GAIN] * (deviation - trial[0, 0])
    predict(observers, a, now.acting_before, now.acting, trial)
    if saturated:
        trial[0, LACK] = lacking
    for value in trial[0]:
        if not math.isfinite(value):
            now.phase = FAILED
            return
    now.phase = RUNNING
    estimate[:] = trial[0]
    if not saturated and not late:
        moved = own.kept * now.correction + own.correction_gain * estimate[LACK]
        now.correction = min(max(moved, -own.limit), own.limit)


@kernel()
def unpunctuality(own, now, arrival):  # type: ignore[no-untyped-def]
    """How far a sample may be off its instant by the arrival of its frame [ns], over Ts.

    A drive samples when SYNC reaches it, and its answer follows; both may have been delayed. `own`
    and `now` are the axis' records.
    """
    if now.usual_arrival < 0.0:
        now.usual_arrival = arrival
    off = arrival - now.usual_arrival
    now.usual_arrival += min(max(off, -own.usual_step), own.usual_step)
    return abs(off) / own.period


@kernel()
def predict(observers, a, start, end, trial):  # type: ignore[no-untyped-def]
    """Advance the state in `trial`'s first row, (2, N), by a period of axis `a`.

    The offset goes from `start` to `end` [N].
    """
    transition, vectors = observers.transition[a], observers.vectors[a]
    states = trial.shape[1]
    for i in range(states):
        total = vectors[RAMP_FROM, i] * start + vectors[RAMP_TO, i] * end
        for k in range(states):
            total += transition[i, k] * trial[0, k]
        trial[1, i] = total
    trial[0] = trial[1]
