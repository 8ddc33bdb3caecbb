"""Whether the correction feeds what it should remove: watched from SYNC to SYNC, compiled.

An axis counts in blocks of samples, each some time constants of the correction long, while the
demands of all axes rest or move at a constant speed. Nothing that the host knows tells an
oscillation that the observer feeds from a vibration that comes from elsewhere: from the position to
the offset it answers both alike. What tells them apart is an experiment: where a deviation in the
band in which the loop can oscillate has more power than a motion or a push may leave, the
correction is frozen at its mean, which opens the loop, until the power without it is known. If the
oscillation has died, the observer fed it, and it stays out; otherwise it goes on. Friction makes an
oscillation wax and wane, and moves interrupt it: only a quiet block ends a suspicion, and an
experiment goes on after a move.

An offset that acts the other way makes a deviation grow, faster than blocks can tell. Where the
correction works, it is at most a time constant behind a disturbance: what it has moved by brings
the deviation back. A deviation that is at a new peak after the correction has moved by half of its
bound against it, at a demand that has been steady for a block, so that friction neither begins nor
turns, is one that the correction drives.

A position that is not the one that the drive holds (old, filtered) makes no oscillation: correction
and integrator work against each other until the correction is at its limit. Two signs tell: the
deviation stands at a constant speed, where the integrator would remove it; or it is so large that
the drive would answer with a multiple of the correction's limit, and the measured force does not.

Blocks with so many half-waves are short; the idea to count what stays above a limit from one half
of a wave to the next is Hägglund's (Control Engineering Practice 3, 1995).
"""

from __future__ import annotations

import math

import numpy as np

from stagedata.compiled import kernel
from stagedata.fields import of_type

WATCHING, TRYING, OUT = range(3)
"""What the watchdog does with an axis: the correction acts; it is frozen, for an experiment; it is
out, and leaks away."""
NOTHING, SUSPECTED, FED, ELSEWHERE, STANDS, UNANSWERED, GROWS = range(7)
"""What it has found last: an oscillation, frozen to see; one that the observer fed; one that goes
on without it; a deviation that stands; one that the drive does not answer; one that grows although
the correction pushes against it."""

BLOCK = 4.0
"""Length of a block, in time constants of the correction: most of a period of the slowest
oscillation that it can feed."""
SLOWEST = 2.5
"""Time constant of the high-pass on the deviation, likewise: slower ones are the drive's to remove,
and the observer settles within it."""
STRIKES = 4
"""Blocks with too much power, and changes of sign, without a quiet block between them."""
ROUNDING = 3.0
"""Times what is unavoidable, rms: rounding of the offset makes such waves of a period per block or
less, and the drive alone makes them likewise."""
PERSISTS = 0.5
"""Of the largest power, from one block to the next: what a motion or a push may leave. With a peak
sensitivity of 2 a deviation loses more in a half-wave."""
DIES = 0.25
"""Of the power with the observer, without it: it was fed."""
GOES_ON = 0.5
"""The same: it comes from elsewhere. By design the observer makes a vibration at most 1.4 times as
large as the drive alone (peaks 2 and 1.4)."""
TRIES = 4
"""Blocks of an experiment after the first, which the opening of the loop disturbs: at least, for
what comes from elsewhere;"""
LONGEST = 16
"""at most: what is neither then has not stayed as it was."""
STANDING_BLOCKS = 3
"""Blocks in which a mean deviation has to stand."""
STEADY = 2
"""Increments by which a step of a demand that goes on at a constant speed may differ from the one
before: both are rounded."""
PUSHED = 0.5
"""Of the bound: a correction that has moved by as much against a deviation that still grows."""
STANDING = 0.8
"""Of a mean deviation, from one block to the next: the drive's integrator removes more."""
ANSWER = 2.0
"""Times the limit of the correction: a proportional force that must show in the measured one,"""
LEAST_ANSWER = 1.0 / 3.0
"""by this much at least: gains may be off by 2."""

FIGURES_DTYPE = np.dtype(
    [
        *of_type("f8", "high_pass", "floor", "stands", "kp", "out_leak"),
        *of_type("i8", "block"),
    ],
    align=True,
)  # fmt: skip
"""Figures of an axis: share kept by the high-pass; samples of a block; mean square of deviations
that are unavoidable [m^2]; deviation that the take-over from the integrator causes [m]; gain of the
drive [N/m]; leak per SYNC of a correction that is out [N]."""
WATCH_DTYPE = np.dtype(
    [
        *of_type("i8", "mode", "finding", "findings", "clock", "found_at", "count", "crossings",
            "wait", "strikes", "turns", "turned_in", "stands", "tries", "any_count", "limited",
            "unanswered",
        ),
        *of_type("f8", "rms", "frequency", "before", "passed", "power", "sum", "allowed",
            "last_error", "last_strike", "closed_power", "opened", "known_power", "any_error",
            "any_own", "any_force", "any_correction", "mean", "peak", "pushed_from",
        ),
    ],
    align=True,
)  # fmt: skip
"""State of an axis.

- mode; finding: the last one; findings: how many; clock: SYNCs so far; found_at: when the
  correction was frozen; rms, frequency: of the oscillation found [m, 1/SYNC];
- before, passed: deviation of the sample before, and high-passed [m];
- of the block under way, at a steady demand: count; power, sum: of squares and of the deviation
  [m^2, m]; crossings: changes of sign; wait: blocks not to judge;
- allowed: power that a motion or a push may have left [m^2]; last_error: of the block before;
  strikes, stands: blocks with too much power, in which a deviation stood; turns: changes of sign
  since the last quiet block, turned_in: so many blocks; last_strike: power of the last block with
  too much, closed_power: of the last two, the larger; known_power: of what comes from elsewhere;
  tries, opened: blocks of an experiment, and the sum of their powers;
- of the block under way at any demand: any_count; sums of deviation, of the drive's own force, of
  the absolute measured force and of the correction [m, N]; limited: samples at the limit;
- unanswered: blocks that the drive did not answer; mean: correction of the block before [N];
- peak: largest deviation since it changed sign at a steady demand [m], and pushed_from: the
  correction then [N].
"""


@kernel()
def watch(figures, watched, now, deviation, own_force, force, bound, steady, moving):  # type: ignore[no-untyped-def]
    """Take in a sample of an axis (9 arguments: one call per SYNC).

    Args:
        figures: record of `FIGURES_DTYPE`.
        watched: record of `WATCH_DTYPE`, changed.
        now: state of the observer's axis, whose correction may be frozen here.
        deviation: from the demand [m].
        own_force: measured force less the offset that was sent [N].
        force: measured [N].
        bound: of the correction [N].
        steady: all demands rest or move at a constant speed.
        moving: this one moves.
    """
    passed = figures.high_pass * (watched.passed + deviation - watched.before)
    crossed = (passed > 0.0) != (watched.passed > 0.0)
    watched.before, watched.passed = deviation, passed
    if watched.mode == OUT:
        return
    watched.any_count += 1
    watched.any_error += deviation
    watched.any_own += own_force
    watched.any_force += abs(force)
    watched.any_correction += now.correction
    if abs(now.correction - now.base) >= 0.98 * bound:
        watched.limited += 1
    if steady:
        watched.count += 1
        watched.power += passed * passed
        watched.sum += deviation
        watched.crossings += crossed
    else:
        restart_block(watched)
        watched.wait = max(watched.wait, 1)
        watched.last_error = 0.0
    if watched.mode == WATCHING and grows(figures, watched, now, deviation, bound, steady):
        freeze(figures, watched, now, OUT)
        note(watched, GROWS, abs(deviation), 0.0)
        return
    limited = 2 * watched.limited >= watched.any_count
    if watched.count >= figures.block:
        judge_block(figures, watched, now, limited, moving)
        restart_block(watched)
    if watched.any_count >= figures.block:
        if watched.mode == WATCHING and limited:
            judge_answer(figures, watched, now, bound)
        else:
            watched.unanswered = 0
        watched.mean = watched.any_correction / watched.any_count
        watched.any_count = watched.limited = 0
        watched.any_error = watched.any_own = watched.any_force = watched.any_correction = 0.0


@kernel()
def grows(figures, watched, now, deviation, bound, steady):  # type: ignore[no-untyped-def]
    """Whether a deviation is at a new peak, the correction having moved far against it.

    A new peak is above the last by more than is unavoidable: an axis that sticks stays where it is.
    """
    if not steady or watched.wait > 0 or (deviation > 0.0) != (watched.peak > 0.0):
        watched.peak, watched.pushed_from = deviation, now.correction
        return False
    if abs(deviation) <= abs(watched.peak) + math.sqrt(figures.floor):
        return False
    watched.peak = deviation
    pushed = now.correction - watched.pushed_from
    return (pushed if deviation < 0.0 else -pushed) > PUSHED * bound


@kernel()
def restart_block(watched):  # type: ignore[no-untyped-def]
    """Begin a block at a steady demand."""
    watched.count = watched.crossings = 0
    watched.power = watched.sum = 0.0


@kernel()
def judge_block(figures, watched, now, limited, moving):  # type: ignore[no-untyped-def]
    """At the end of a block at a steady demand; `limited`: with the correction at its limit."""
    power = watched.power / watched.count
    error = watched.sum / watched.count
    allowed, error_before = PERSISTS * watched.allowed, watched.last_error
    watched.allowed, watched.last_error = max(power, allowed), error
    if watched.wait > 0:
        watched.wait -= 1
        return
    if watched.mode == TRYING:
        judge_experiment(watched, power)
        return
    standing = error * error_before > 0.0 and abs(error) > STANDING * abs(error_before)
    if limited and moving and standing and abs(error) > figures.stands:
        watched.stands += 1
    else:
        watched.stands = 0
    if watched.stands >= STANDING_BLOCKS:
        freeze(figures, watched, now, OUT)
        note(watched, STANDS, abs(error), 0.0)
        return
    if power <= max(figures.floor, watched.known_power / DIES):
        watched.strikes = watched.turns = watched.turned_in = 0
        watched.last_strike = 0.0
        return
    if watched.crossings <= 2 and power <= ROUNDING**2 * figures.floor:
        return
    watched.turns += watched.crossings
    watched.turned_in += 1
    if power > allowed:
        watched.strikes += 1
        watched.closed_power = max(power, watched.last_strike)
        watched.last_strike = power
    if min(watched.strikes, watched.turns) >= STRIKES:
        waves = 0.5 * watched.turns / (watched.turned_in * watched.count)
        freeze(figures, watched, now, TRYING)
        note(watched, SUSPECTED, math.sqrt(watched.closed_power), waves)


@kernel()
def judge_experiment(watched, power):  # type: ignore[no-untyped-def]
    """At the end of a block with the loop open."""
    watched.tries += 1
    watched.opened += power
    left = watched.opened / (watched.tries * watched.closed_power)
    if (watched.tries >= 2 and left < DIES) or watched.tries >= LONGEST:
        watched.mode = OUT
        note(watched, FED, watched.rms, watched.frequency)
    elif watched.tries >= TRIES and left >= GOES_ON:
        watched.mode = WATCHING
        watched.known_power = max(watched.known_power, watched.opened / watched.tries)
        note(watched, ELSEWHERE, math.sqrt(power), watched.frequency)


@kernel()
def judge_answer(figures, watched, now, bound):  # type: ignore[no-untyped-def]
    """At the end of a block with the correction at its limit: does the drive answer?"""
    error = watched.any_error / watched.any_count
    own = watched.any_own / watched.any_count
    pull = figures.kp * abs(error)
    answer = -own if error > 0.0 else own
    if pull > ANSWER * bound and answer < LEAST_ANSWER * pull and watched.any_force > 0.0:
        watched.unanswered += 1
    else:
        watched.unanswered = 0
    if watched.unanswered >= 2:
        freeze(figures, watched, now, OUT)
        note(watched, UNANSWERED, abs(error), 0.0)


@kernel()
def freeze(figures, watched, now, mode):  # type: ignore[no-untyped-def]
    """Hold the correction at its mean over the last blocks."""
    whole = watched.any_correction + figures.block * watched.mean
    now.correction = whole / (watched.any_count + figures.block)
    watched.mode, watched.strikes, watched.stands, watched.turns = mode, 0, 0, 0
    watched.tries, watched.turned_in, watched.opened = 0, 0, 0.0
    watched.wait, watched.found_at = 1, watched.clock


@kernel()
def note(watched, finding, rms, frequency):  # type: ignore[no-untyped-def]
    """Keep a finding for the host."""
    watched.finding, watched.rms, watched.frequency = finding, rms, frequency
    watched.findings += 1
