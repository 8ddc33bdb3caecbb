"""The move of section IV: one mass with Maxwell-slip friction under a sampled PID.

The friction is the simulator's (`hil_sim.plant`), not the estimator's. The controller runs at
the sample rate and holds its force; the mass is integrated at 200 kHz, velocity Verlet: its
accelerations belong to the instants of the positions. (Semi-implicit Euler would shift them by half
a step, 2.5 us, and sigma_v by 0.2 %.) No quantisation; encoder noise on request, inside the loop.

The estimator's signals are central differences through a Butterworth filter forward and backward,
over the whole record before the zones are cut from it. The force goes through the same filter;
otherwise sigma0 and C are wrong. Force "as logged" is the command of the sample, held until the
next one: on average it acts half a sample after the position. "Aligned" is the mean of the commands
before and after the sample.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.signal import butter, sosfiltfilt

from estimation.trajectory import Limits, Trajectory, plan
from hil_sim.plant import Slip, element_shares, slip_step, stribeck
from stagectl.paper import published
from stagectl.paper.case import PLANT_RATE, Case, Profile
from stagedata import F64
from stagedata.compiled import kernel

LEAD_IN = 0.05
"""Rest before the move [s], for the filter's transient."""
LEAD_OUT = 0.2
"""After the move [s]: settling, zone B, and the filter's transient."""
JERK = 150.0
"""Of the jerk-limited profile [m/s^3]: 3 m/s^2 within 20 ms."""


@dataclass(frozen=True, slots=True)
class Record:
    """The move as sampled; arrays of shape (K,).

    Attributes:
        rate: samples per second.
        time: since the demand started to move [s].
        demand: position demanded [m].
        position: measured at each sample [m].
        force: commanded at the sample, held until the next one [N].
        slipping: whether all elements of the plant slip.
    """

    rate: int
    time: F64
    demand: F64
    position: F64
    force: F64
    slipping: NDArray[np.bool_]


def gains(bandwidth: float) -> tuple[float, float, float]:
    """PID that puts three poles of the free mass at w0: kp [N/m], ki [N/(m s)], kd [N s/m].

    Args:
        bandwidth: where |T| of the closed loop falls through -3 dB [Hz].
    """
    s = 2j * math.pi * bandwidth

    def above(w0: float) -> float:
        closed = (3 * w0 * s**2 + 3 * w0**2 * s + w0**3) / (s + w0) ** 3
        return abs(closed) - math.sqrt(0.5)

    w0, mass = float(brentq(above, 0.02 * abs(s), abs(s))), published.MASS
    return 3 * mass * w0**2, mass * w0**3, 3 * mass * w0


def demand(profile: Profile, time: F64) -> tuple[F64, F64]:
    """Position [m] and acceleration [m/s^2] demanded at `time` [s], same shape.

    sine: one period of a sine as acceleration, amplitude 3 m/s^2; 0.229 s, peak 0.219 m/s.
    """
    if profile == "jerk-limited":
        position, _, acceleration = _jerk_limited().sample(time)
        return position, acceleration
    peak, end = published.ACCELERATION, duration(profile)
    w = 2 * math.pi / end
    inside = np.clip(time, 0.0, end)
    return peak / w * (inside - np.sin(w * inside) / w), peak * np.sin(w * inside)


def duration(profile: Profile) -> float:
    """From the demand's start to its end [s]."""
    if profile == "jerk-limited":
        return _jerk_limited().duration
    return math.sqrt(2 * math.pi * published.DISTANCE / published.ACCELERATION)


def _jerk_limited() -> Trajectory:
    limits = Limits(published.VELOCITY, published.ACCELERATION, JERK)
    return plan(0.0, published.DISTANCE, limits)


@lru_cache(maxsize=4)
def simulate(case: Case) -> Record:
    """The point-to-point move of section IV, from relaxed friction, with rest on both sides.

    Raises:
        ValueError: the position loop is not stable at this sample rate.
    """
    rate = case.rate
    end = duration(case.profile) + LEAD_OUT
    time = np.arange(-round(LEAD_IN * rate), round(end * rate)) / rate
    wanted, acceleration = demand(case.profile, time)
    offset = published.MASS * acceleration if case.feedforward else np.zeros_like(time)
    reference = published.REFERENCE
    figures = np.array(
        [
            published.MASS,
            reference["viscous"],
            reference["coulomb"],
            reference["attraction"] / reference["coulomb"],
            reference["stiffness"] / published.PLANT_ELEMENTS,
            published.STATIC_RATIO,
            published.STRIBECK_VELOCITY,
            published.STRIBECK_SHAPE,
        ]
    )
    misread = case.noise * np.random.default_rng(case.seed).standard_normal(len(time))
    sampled = np.empty((2, len(time)))
    slipping = np.zeros(len(time), dtype=np.bool_)
    _run(
        figures, element_shares(published.PLANT_ELEMENTS), np.array(gains(case.bandwidth)),
        1.0 / rate, PLANT_RATE // rate, np.stack([wanted, offset, misread]), sampled, slipping,
    )  # fmt: skip
    position, force = sampled
    if not np.abs(position - wanted).max() < published.DISTANCE:
        raise ValueError(f"{case.bandwidth:g} Hz at {rate} samples/s: the loop is unstable")
    return Record(rate, time, wanted, position, force, slipping)


@kernel(error_model="python")
def _run(
    figures: F64, shares: F64, pid: F64, period: float, substeps: int, wanted: F64, sampled: F64,
    slipping: NDArray[np.bool_],
) -> None:  # fmt: skip
    """Fill `sampled`, position and force, float64[2, K], and `slipping`, [K]; column k is sample k.

    `wanted`, float64[3, K]: demand [m], force offset [N], encoder noise [m].
    """
    mass, viscous, coulomb, rate, element_stiffness, alpha, vs, shape = figures
    kp, ki, kd = pid
    count = shares.shape[0]
    forces = np.zeros(count)
    slips = np.zeros(count, dtype=np.bool_)
    dt = period / substeps
    x, v, friction, direction = 0.0, 0.0, 0.0, 0.0
    integral, last = 0.0, wanted[0, 0]
    for k in range(wanted.shape[1]):
        reading = x + wanted[2, k]
        error = wanted[0, k] - reading
        integral += error * period
        u = kp * error + ki * integral + kd * (error - last) / period + wanted[1, k]
        last = error
        sampled[0, k], sampled[1, k], slipping[k] = reading, u, slips.all()
        for _ in range(substeps):
            half = v + 0.5 * dt / mass * (u - friction - viscous * v)
            dx = half * dt
            x += dx
            if half != 0.0:
                heading = math.copysign(1.0, half)
                if heading != direction:
                    direction = heading
                    slips[:] = False
                curve = stribeck(half, alpha, vs, shape)
                slip = Slip(direction, dx, coulomb * curve, math.exp(-rate * dt / curve))
                friction = slip_step(forces, slips, shares, slip, element_stiffness, count)
            v = (half + 0.5 * dt / mass * (u - friction)) / (1.0 + 0.5 * dt * viscous / mass)


@dataclass(frozen=True, slots=True)
class Move:
    """The samples of a move and its zones.

    Attributes:
        period: [s].
        time: since the demand started to move [s], shape (K,).
        demand [m], position [m], velocity [m/s], acceleration [m/s^2], force [N]: shape (K,).
        slide, turn, end: zone A is samples slide..turn-1, zone B turn..end-1.
    """

    period: float
    time: F64
    demand: F64
    position: F64
    velocity: F64
    acceleration: F64
    force: F64
    slide: int
    turn: int
    end: int


def prepare(case: Case) -> Move:
    """Simulate, differentiate, align, filter, and find the zones.

    Raises:
        ValueError: the move cannot be simulated, or has no zone A or B.
    """
    record = simulate(case)
    period = 1.0 / record.rate
    x, u = record.position, record.force
    velocity = (x[2:] - x[:-2]) / (2 * period)
    acceleration = (x[2:] - 2 * x[1:-1] + x[:-2]) / period**2
    force = u[1:-1] if case.force == "logged" else 0.5 * (u[:-2] + u[1:-1])
    if case.cut_off is not None and case.cut_off < record.rate / 2:
        sections = butter(case.order, case.cut_off, output="sos", fs=record.rate)
        velocity = sosfiltfilt(sections, velocity)
        acceleration = sosfiltfilt(sections, acceleration)
        if case.filter_force:
            force = sosfiltfilt(sections, force)
    time, demand, position = (v[1:-1] for v in (record.time, record.demand, x))
    # Noise at rest could look like motion, so the search begins once the stage has moved.
    travelled = position - x[0] > (1e-3 if case.onset is None else case.onset)
    began = travelled if case.onset is not None else travelled & record.slipping[1:-1]
    if not began.any():
        raise ValueError("the move has no zone A: not all elements slip")
    slide = int(np.argmax(began))
    back = velocity[slide:] <= 0
    if not back.any():
        raise ValueError("the move has no zone B: the velocity never goes through zero")
    turn = slide + int(np.argmax(back)) + round(case.shift * record.rate)
    end = turn + round(case.stick * record.rate)
    if not (slide + 4 < turn < end <= len(position)):
        raise ValueError(f"the zones leave the record: samples {slide}, {turn}, {end}")
    return Move(period, time, demand, position, velocity, acceleration, force, slide, turn, end)
