"""One step of the observers of all axes, between two SYNCs, compiled.

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

from estimation.observer.filter import READ, predict, take_in
from estimation.observer.made_when_sampled import made_when_sampled
from estimation.observer.model import LACK
from estimation.observer.watch import (
    FIGURES_DTYPE,
    OUT,
    STEADY,
    WATCH_DTYPE,
    WATCHING,
    watch,
)
from stagedata import F64
from stagedata.compiled import kernel
from stagedata.fields import of_type

POSITION, MEASURED_FORCE, VALID, ARRIVAL = range(4)
"""Columns of a sample: [increments], [1/1000 rated], 1 or 0, time of its frame after SYNC [ns]."""
OFF, FRESH, RUNNING, FAILED = range(4)
"""Phases of an axis: its offsets are sent as planned; before its first sample; observed; a value
was not finite, the correction stays as it is."""
USUAL = 1e-3
"""The usual arrival of a frame, and its usual distance from that, follow the actual ones by so much
of Ts at most, per SYNC: outliers do not count for more."""
STALE = 20
"""Setpoints moved by more than so many increments, yet the sample repeats the one before: stale."""
ROOM = 2.0
"""Times the bound at rest: what the drive's integrator holds beyond is taken over on the way."""
LOST = 20
"""After so many periods without a row the estimate begins anew."""

Records = NDArray[np.void]

AXIS_DTYPE = np.dtype(
    [
        *of_type("f8", "noise", "walk", "jump", "correction_gain", "kept", "limit", "bound",
            "accelerated", "forgets", "leak", "most_leak", "unwinds", "increment", "unit",
            "saturation", "first_tick", "usual_step", "period",
        ),
        *of_type("i8", "ends"),
    ],
    align=True,
)  # fmt: skip
"""Figures of an axis.

- noise, walk: variance of a sample [m^2] and of a period's step of the disturbance [N^2]; jump:
  innovation that no force brings about [m];
- correction_gain: g over force ratio; kept: share of the correction kept, 1 - g;
- limit: of the correction's change in a move [N]; bound: the same while the demand does not
  accelerate, and accelerated: more of it per increment of the demand's second difference [N], of
  whose largest value a share forgets is kept per SYNC;
- leak: share of that change per SYNC that goes to the drive's integrator; most_leak: at the bound
  [N]; unwinds: share per SYNC of what the integrator holds too much, in motion, up to so many SYNCs
  before its end: ends;
- increment, unit: of position [m] and force [N]; saturation: force from which the drive counts as
  saturated [1/1000 rated]; first_tick: Tc/Ts, the share of a step of the demand that is made when
  the sample is taken; usual_step: `USUAL`; period: Ts [ns].
"""
NOW_DTYPE = np.dtype(
    [
        *of_type("i8", "phase", "sent", "target", "target_before", "position", "force"),
        *of_type("f8", "correction", "base", "acting", "acting_before", "carried", "bend",
            "deviation", "own", "usual_arrival", "usual_distance",
        ),
        *of_type("?", "goes_on"),
    ],
    align=True,
)  # fmt: skip
"""State of an axis.

- phase; correction, and base: what it was at rest before the present move [N]; acting,
  acting_before: offset sent less planned, in this period and the one before [N]; carried: what
  rounding has left, sent: offset sent last [1/1000 rated];
- own: the drive's own force of late [N]; goes_on: the demand moves, and will for some time; bend:
  the largest second difference of the demand of late [increments]; deviation: the last [m];
- target, target_before: sent last, and the one before [increments]; position, force: the sample
  before [increments, 1/1000 rated];
- usual_arrival: negative before the first, usual_distance: from it [ns].
"""


class Observers(NamedTuple):
    """The observers of n axes, with N states each; read only.

    Attributes:
        axes: records of `AXIS_DTYPE`, (n,).
        watching: records of `estimation.observer.watch.FIGURES_DTYPE`, (n,).
        transition: (n, N, N).
        vectors: of `estimation.observer.filter`, (n, 3, N).
        steady: covariance of the prediction with punctual samples, (n, N, N).
    """

    axes: Records
    watching: Records
    transition: F64
    vectors: F64
    steady: F64


class State(NamedTuple):
    """State of the observers.

    Attributes:
        axes: records of `NOW_DTYPE`, (n,).
        watched: records of `estimation.observer.watch.WATCH_DTYPE`, (n,).
        estimate: prediction for the next sample, (n, N).
        covariance: of it, (n, N, N).
        rooms: estimate being computed, then scratch, (N + 2, N).
    """

    axes: Records
    watched: Records
    estimate: F64
    covariance: F64
    rooms: F64


def make_observers(axes: int, states: int) -> Observers:
    """Observers, their figures not yet set."""
    square = (axes, states, states)
    return Observers(
        np.zeros(axes, AXIS_DTYPE), np.zeros(axes, FIGURES_DTYPE), np.zeros(square),
        np.zeros((axes, 3, states)), np.zeros(square),
    )  # fmt: skip


def make_state(axes: int, states: int) -> State:
    """The state of observers that are off."""
    state = State(
        np.zeros(axes, NOW_DTYPE), np.zeros(axes, WATCH_DTYPE), np.zeros((axes, states)),
        np.zeros((axes, states, states)), np.zeros((states + 2, states)),
    )  # fmt: skip
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
    steady = True
    for a in range(len(sent)):
        now = state.axes[a]
        bend = abs(targets[row, a] - 2 * now.target + now.target_before)
        now.bend = max(float(bend), observers.axes[a].forgets * now.bend)
        if bend > STEADY:
            steady = False
    for a in range(len(sent)):
        now = state.axes[a]
        watched = state.watched[a]
        watched.clock += periods
        later = min(row + observers.axes[a].ends, targets.shape[0] - 1)
        now.goes_on = later > row and targets[later, a] != targets[later - 1, a]
        if now.phase == OFF:
            sent[a] = within_integer16(planned[row, a])
            now.target_before = now.target
            now.target = targets[row, a]
            continue
        if periods > LOST and now.phase == RUNNING:
            now.phase = FRESH
        if now.phase != FAILED:
            observe(observers, state, a, periods, doubt, sample, targets[row, a])
        unit = observers.axes[a].unit
        if now.phase == RUNNING and sample[a, VALID] != 0:
            force = sample[a, MEASURED_FORCE] * unit
            own_force = force - now.sent * unit
            now.own += (1.0 - observers.axes[a].forgets) * (own_force - now.own)
            watch(
                observers.watching[a], watched, now, now.deviation, own_force, force,
                bound_of(observers.axes[a], now), steady, now.target != now.target_before,
            )  # fmt: skip
        wanted = planned[row, a] + now.correction / unit + now.carried
        sent[a] = within_integer16(wanted)
        now.carried = min(max(wanted - sent[a], -0.5), 0.5)
        now.sent = sent[a]
        now.acting_before = now.acting
        now.acting = (sent[a] - planned[row, a]) * unit
        now.target_before = now.target
        now.target = targets[row, a]


@kernel()
def within_integer16(value):  # type: ignore[no-untyped-def]
    """The nearest INTEGER16."""
    return int(min(max(np.rint(value), -32768.0), 32767.0))


@kernel()
def observe(observers, state, a, periods, doubt, sample, coming):  # type: ignore[no-untyped-def]
    """Take in the sample of axis `a`, predict to the next SYNC, move the correction.

    `coming` is the next setpoint; other arguments as those of `step`.
    """
    own, now = observers.axes[a], state.axes[a]
    estimate, covariance = state.estimate[a], state.covariance[a]
    trial = state.rooms[0]
    position, force = sample[a, POSITION], sample[a, MEASURED_FORCE]
    valid = sample[a, VALID] != 0
    begins = now.phase == FRESH
    if begins and not valid:
        return
    going = now.target - now.target_before
    made = made_when_sampled(going, coming - now.target, own.first_tick)
    deviation = (position - now.target_before - made) * own.increment
    saturated = valid and abs(force) >= own.saturation
    stale = position == now.position and force == now.force and abs(going) > STALE
    off = doubt**2
    if valid:
        off += unpunctuality(own, now, sample[a, ARRIVAL])
    shaken = off * (going * own.increment) ** 2
    now.position, now.force = position, force
    now.deviation = deviation
    lacking = estimate[LACK]
    trial[:] = estimate
    if begins or saturated:  # nothing else is known: what was lacking still is
        trial[:] = 0.0
        trial[READ], trial[LACK] = deviation, lacking
        covariance[:] = observers.steady[a]
        take_in(trial, covariance, 0.0, own.noise + shaken)
    else:
        for _ in range(periods - 1):
            advance(observers, state, a, now.acting_before, now.acting_before, shaken)
        if valid and not stale:
            innovation = deviation - trial[READ]
            if abs(innovation) > own.jump:
                shaken = max(shaken, innovation**2)
            take_in(trial, covariance, innovation, own.noise + shaken)
    advance(observers, state, a, now.acting_before, now.acting, shaken)
    if saturated:
        trial[LACK] = lacking
    for value in trial:
        if not math.isfinite(value):
            now.phase = FAILED
            return
    now.phase = RUNNING
    estimate[:] = trial
    mode = state.watched[a].mode
    if mode == WATCHING and not saturated:
        bound = bound_of(own, now)
        moved = own.kept * now.correction + own.correction_gain * estimate[LACK]
        # where the bound comes down with the demanded acceleration, the correction follows slowly
        bound = max(bound, abs(now.correction - now.base) - observers.watching[a].out_leak)
        moved -= own.leak * (moved - now.base)
        wound = abs(now.own) - ROOM * own.bound
        if now.goes_on and wound > 0.0:
            moved += math.copysign(own.unwinds * wound, now.own)
        now.correction = min(max(moved, now.base - bound), now.base + bound)
    elif mode == OUT:
        now.correction = leaked(now.correction, observers.watching[a].out_leak)


@kernel()
def bound_of(own, now):  # type: ignore[no-untyped-def]
    """Largest correction for what is demanded now [N]."""
    return min(own.bound + own.accelerated * now.bend, own.limit)


@kernel()
def leaked(correction, leak):  # type: ignore[no-untyped-def]
    """A correction [N] that has moved towards 0 by a leak [N]."""
    return math.copysign(max(abs(correction) - leak, 0.0), correction)


@kernel()
def unpunctuality(own, now, arrival):  # type: ignore[no-untyped-def]
    """How far a sample may be off its instant by the arrival of its frame [ns]: square, over Ts.

    A drive samples when SYNC reaches it, and its answer follows; both may have been delayed. Where
    arrivals scatter, one at the usual time is no better than they usually are. `own` and `now` are
    the axis' records.
    """
    if now.usual_arrival < 0.0:
        now.usual_arrival = arrival
    off = arrival - now.usual_arrival
    now.usual_arrival += min(max(off, -own.usual_step), own.usual_step)
    further = abs(off) - now.usual_distance
    now.usual_distance += min(max(further, -own.usual_step), own.usual_step)
    return (off**2 + now.usual_distance**2) / own.period**2


@kernel()
def advance(observers, state, a, start, end, shaken):  # type: ignore[no-untyped-def]
    """Predict the estimate in `rooms` and its covariance over a period of axis `a`.

    The offset goes from `start` to `end` [N]; `shaken` as in `predict`.
    """
    covariance = state.covariance[a]
    predict(
        observers.transition[a], observers.vectors[a], (start, end), shaken, state.rooms[0],
        covariance, state.rooms[1:],
    )  # fmt: skip
    covariance[LACK, LACK] += observers.axes[a].walk
