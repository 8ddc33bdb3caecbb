"""Dead time and lag of an axis' current loop, as weights over the plant's steps."""

from __future__ import annotations

import math

import numpy as np

from hil_sim.effects.ports import EffectPorts
from hil_sim.plant.ports.records import Arena
from stagedata import F64


def write_delay(
    record: np.void, ports: EffectPorts, arena: Arena, period: float, substeps: int
) -> None:
    """Write the dead time: whole ticks, and per substep the weight of the earlier output.

    The current loop is a first-order lag: a step of its input within a substep acts like a
    weighted mean of both values over the whole substep.
    """
    record["history"] = record["delay_share"] = -1
    if ports.delay <= 0.0:
        return
    ticks = ports.delay / period
    whole = math.floor(ticks + 1e-9)
    step = max(0.0, ticks - whole) * substeps  # substeps until the output steps
    share = _shares_before(step, decay_of(ports, period, substeps), substeps)
    record["delay_ticks"] = whole
    record["history_depth"] = whole + 2
    record["history"] = arena.add(np.zeros(whole + 2))
    record["delay_share"] = arena.add(share)


def decay_of(ports: EffectPorts, period: float, steps: int) -> float:
    """2 pi bandwidth times the step: the current loop's exponent over one of `steps` steps.

    Args:
        ports: of the axis.
        period: Tc [s].
        steps: number of steps in it.
    """
    return 2.0 * math.pi * ports.current_bandwidth * period / steps


def _shares_before(step: float, decay: float, count: int) -> F64:
    """Weight of the earlier input in each of `count` integration steps, float64[count].

    Args:
        step: time at which the input changes, in integration steps.
        decay: 2 pi bandwidth times the integration step.
        count: number of integration steps.
    """
    before = np.clip(step - np.arange(count), 0.0, 1.0)
    old = (1.0 - np.exp(-decay * before)) * np.exp(-decay * (1.0 - before))
    return np.asarray(old / (1.0 - math.exp(-decay)))


def write_coarse_weights(record: np.void, ports: EffectPorts, period: float, fine: float) -> None:
    """Write the weights of coarse steps (`motor_weights`).

    Args:
        record: of the axis.
        ports: of the axis.
        period: Tc [s], a coarse step.
        fine: number of fine steps that it replaces; weights of a fraction are interpolated.
    """
    few = math.floor(fine)
    weights = _coarse_weights(ports, period, few)
    if fine > few:
        share = (1.0 / few - 1.0 / fine) / (1.0 / few - 1.0 / (few + 1))
        weights = weights + share * (_coarse_weights(ports, period, few + 1) - weights)
    for name, (old, start) in zip(("end", "mean", "early"), weights, strict=True):
        record[f"{name}_old"], record[f"{name}_start"] = old, start
    record["coarse_share"] = (fine + 1.0) / (2.0 * fine)


def _coarse_weights(ports: EffectPorts, period: float, fine: int) -> F64:
    decay = decay_of(ports, period, fine)
    ticks = ports.delay / period
    step = max(0.0, ticks - math.floor(ticks + 1e-9)) * fine
    return motor_weights(decay, _shares_before(step, decay, fine))


def motor_weights(decay: float, share: F64) -> F64:
    """Weights by which outputs and initial force make up the motor force in one coarse step.

    A coarse step is one of `hil_sim.plant.coarse`.

    Args:
        decay: 2 pi bandwidth times the fine step.
        share: weight of the earlier output in each fine step, float64[n].

    Returns:
        float64[3, 2]: rows for the force at the end, its mean in the velocity and its mean in the
        displacement; columns for the earlier output and the force at the start. The present output
        has the remaining weight, to 1 or, for the displacement, to (n + 1)/(2n).
    """
    count = len(share)
    gain = 1.0 - math.exp(-decay)
    end = np.array([0.0, 1.0])
    velocity, displacement = np.zeros(2), np.zeros(2)
    for i, before in enumerate(share):
        end = end + gain * (np.array([before, 0.0]) - end)
        velocity += end / count
        displacement += end * (count - i) / count**2
    return np.array([end, velocity, displacement])
