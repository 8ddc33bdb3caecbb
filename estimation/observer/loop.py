"""An axis in its drive's position loop, linear, from control tick to control tick and SYNC to SYNC.

In error coordinates: what is followed is the deviation from the demand inside the drive, so that
demand and planned force offset drop out, and what they do not cover is a disturbance. The drive's
law is that of docs/reference/reference-stage.md ("The drive, each control tick"), the mechanics
between ticks are exact (matrix exponential): no code and no integration step is shared with the
simulator.

Not modelled: rounding, clamping, and the kinks of a demand that the drive interpolates.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from stagedata import F64

DEVIATION, VELOCITY, FORCE, SLOPE, INTEGRAL = range(5)
"""First states of an axis: position less demand [m], its rate [m/s], motor force [N], memory of the
derivative's low-pass [m/s], integrator [N]. Then come two for each mode, and outputs on their way
[N], the youngest first."""


class Mode(NamedTuple):
    """An oscillator that takes part in the motion.

    Attributes:
        mass_ratio: hung on the carriage: its mass over the moved mass, of which it is a part;
            base: moved mass over the base's.
        frequency: of the free-free mode; of the base on its isolators [Hz].
        damping: ratio of that mode.
    """

    mass_ratio: float
    frequency: float
    damping: float


@dataclass(frozen=True, slots=True)
class DriveLoop:
    """PID position loop and current loop of a drive.

    Attributes:
        kp, ki, kd: gains [N/m, N/(m s), N s/m].
        derivative_time: of the derivative's low-pass [s].
        current_bandwidth: of the current loop, a first-order lag [Hz].
        control_period: Tc [s].
        delay: of the output before the current loop [s].
        force_ratio: motor force over output.
    """

    kp: float
    ki: float
    kd: float
    derivative_time: float
    current_bandwidth: float
    control_period: float
    delay: float = 0.0
    force_ratio: float = 1.0


@dataclass(frozen=True, slots=True)
class Carriage:
    """What the drive moves, about a place where friction sticks as a spring or slips.

    Attributes:
        mass: moved [kg].
        stiffness: of what sticks [N/m]; 0 where all slips.
        viscous: coefficient [N s/m].
        hung: parts of the mass on springs.
        base: the stage's base; None where it is rigid.
    """

    mass: float
    stiffness: float
    viscous: float
    hung: tuple[Mode, ...] = ()
    base: Mode | None = None


class PeriodMaps(NamedTuple):
    """One SYNC period of n control ticks, from state (S,) to state.

    In it the force offset goes from one value [N] to another as the drive ramps it.

    Attributes:
        transition: of the state, (S, S).
        ramp_from, ramp_to: effect of the two offsets, (S,).
        noise: effect of what the encoder reads too much in each tick [m], (S, n).
        disturbance: effect of a constant force against the motion [N], (S,).
        error: following error in each tick by the state, (n, S).
        error_from, error_to: by the two offsets, (n,).
        error_noise: by the noise of each tick, (n, n).
    """

    transition: F64
    ramp_from: F64
    ramp_to: F64
    noise: F64
    disturbance: F64
    error: F64
    error_from: F64
    error_to: F64
    error_noise: F64


def ticks_of(drive: DriveLoop, period: float) -> int:
    """Control ticks in a SYNC period [s]."""
    return round(period / drive.control_period)


def period_maps(drive: DriveLoop, carriage: Carriage, period: float) -> PeriodMaps:
    """The loop over one SYNC period [s]."""
    tick = _tick(drive, carriage)
    ticks, states = ticks_of(drive, period), len(tick.offset)
    a, noise = np.eye(states), np.zeros((states, ticks))
    start, end, push = np.zeros(states), np.zeros(states), np.zeros(states)
    rows = {name: np.zeros((ticks, width)) for name, width in (("a", states), ("n", ticks))}
    error_from, error_to = np.zeros(ticks), np.zeros(ticks)
    for j in range(ticks):
        rows["a"][j], rows["n"][j] = -a[DEVIATION], -noise[DEVIATION]
        error_from[j], error_to[j] = -start[DEVIATION], -end[DEVIATION]
        rows["n"][j, j] -= 1.0
        share = (j + 1) / ticks
        a, noise = tick.transition @ a, tick.transition @ noise
        start = tick.transition @ start + tick.offset * (1.0 - share)
        end = tick.transition @ end + tick.offset * share
        push = tick.transition @ push + tick.disturbance
        noise[:, j] += tick.noise
    return PeriodMaps(a, start, end, noise, push, rows["a"], error_from, error_to, rows["n"])


class _Tick(NamedTuple):
    transition: F64
    offset: F64
    noise: F64
    disturbance: F64


def _tick(drive: DriveLoop, carriage: Carriage) -> _Tick:
    """One control tick; what acts are force offset [N], noise [m] and disturbance [N]."""
    tc = drive.control_period
    late = drive.delay / tc
    whole = math.floor(late + 1e-9)
    part = late - whole if late - whole > 1e-9 else 0.0
    a, b = _mechanics(drive, carriage)
    mechanical = 5 + len(a) - 3
    kept = whole + (part > 0.0)
    states = mechanical + kept
    moved = [DEVIATION, VELOCITY, FORCE, *range(5, mechanical)]
    low_pass = tc / (drive.derivative_time + tc)
    # output = row @ state - gain noise + offset; the error is -(deviation + noise)
    gain = drive.kp + drive.kd * low_pass / tc
    row = np.zeros(states)
    row[DEVIATION], row[SLOPE], row[INTEGRAL] = -gain, drive.kd, 1.0
    transition = np.zeros((states, states))
    offset, noise, disturbance = np.zeros(states), np.zeros(states), np.zeros(states)
    now = np.zeros((len(a), states + 3))  # by state, offset, noise, disturbance
    now[range(len(a)), moved] = 1.0
    for duration, lag in ((part * tc, whole + 1), ((1.0 - part) * tc, whole)):
        if duration <= 0.0:
            continue
        step = expm(np.block([[a, b], [np.zeros((2, len(a) + 2))]]) * duration)
        output = np.zeros(states + 3)
        if lag == 0:
            output[:states], output[states], output[states + 1] = row, 1.0, -gain
        else:
            output[mechanical + lag - 1] = 1.0
        now = step[: len(a), : len(a)] @ now + np.outer(step[: len(a), -2], output)
        now[:, -1] += step[: len(a), -1]
    transition[moved], offset[moved], noise[moved], disturbance[moved] = (
        now[:, :states], now[:, states], now[:, states + 1], now[:, states + 2],
    )  # fmt: skip
    transition[SLOPE, SLOPE] = 1.0 - low_pass
    transition[SLOPE, DEVIATION] = noise[SLOPE] = low_pass**2 / tc
    transition[INTEGRAL, INTEGRAL] = 1.0
    transition[INTEGRAL, DEVIATION] = noise[INTEGRAL] = -drive.ki * tc
    for k in range(kept):
        if k == 0:
            transition[mechanical], offset[mechanical], noise[mechanical] = row, 1.0, -gain
        else:
            transition[mechanical + k, mechanical + k - 1] = 1.0
    return _Tick(transition, offset, noise, disturbance)


def _mechanics(drive: DriveLoop, carriage: Carriage) -> tuple[F64, F64]:
    """Rates of deviation, velocity, force and modes by themselves, (M, M); by output and push."""
    size = 3 + 2 * len(carriage.hung) + 2 * (carriage.base is not None)
    a, b = np.zeros((size, size)), np.zeros((size, 2))
    pole = 2.0 * math.pi * drive.current_bandwidth
    a[2, 2], b[2, 0] = -pole, pole
    a[0, 1] = 1.0
    net = np.zeros(size + 2)  # force on the carriage by the states, output and push
    net[0], net[1], net[2], net[-1] = -carriage.stiffness, -carriage.viscous, drive.force_ratio, -1
    reaction = net.copy()
    rigid = carriage.mass * (1.0 - sum(mode.mass_ratio for mode in carriage.hung))
    springs = []
    for i, mode in enumerate(carriage.hung):
        at, hung = 3 + 2 * i, carriage.mass * mode.mass_ratio
        omega, reduced = 2.0 * math.pi * mode.frequency, hung * rigid / (hung + rigid)
        spring = np.zeros(size + 2)
        spring[at] = omega**2 * reduced
        spring[at + 1] = 2.0 * mode.damping * omega * reduced
        net += spring
        springs.append((at, spring / hung))
    rate = net / rigid
    if carriage.base is not None:
        base, at = carriage.base, size - 2
        omega = 2.0 * math.pi * base.frequency
        swing = -base.mass_ratio / carriage.mass * reaction
        swing[at] -= omega**2
        swing[at + 1] -= 2.0 * base.damping * omega
        a[at, at + 1] = 1.0
        a[at + 1], b[at + 1] = swing[:size], swing[size:]
        rate = rate - swing
    a[1], b[1] = rate[:size], rate[size:]
    for at, pull in springs:
        a[at, at + 1] = 1.0
        swing = -rate - pull
        a[at + 1], b[at + 1] = swing[:size], swing[size:]
    return a, b
