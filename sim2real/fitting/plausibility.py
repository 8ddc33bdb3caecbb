"""Which values of an effect are plausible, and which effects are within tolerance."""

from __future__ import annotations

import math

from hil_sim.effects.ports import EffectPorts
from hil_sim.settings import AxisSettings
from sim2real.fitting.axis_model import MAX_SIGMAS, Term

_TENTH, _MOST_TENTHS = 0.1, 5.0
"""Unit in which `implausibility` counts, as a share of the plausible range, and its maximum per
parameter, in that unit."""


def implausibility(term: Term, axis: AxisSettings) -> float:
    """How far an effect's sizes and shapes lie beyond their plausible ranges.

    In units of a tenth of the range, added up over the parameters. A size may lie anywhere between
    its range and its neutral value. Each parameter counts `_MOST_TENTHS` at most. Where any size is
    plausible (`Effect.any_size`) it is 0.
    """
    total = 0.0
    if term.effect.any_size:
        return total
    for parameter, value, near in zip(
        term.effect.parameters, term.values, clip_to_plausible(term, axis).values, strict=True
    ):
        if value == near:
            continue
        ranges = parameter.ranges(axis)
        low, high = min(r[0] for r in ranges), max(r[1] for r in ranges)
        if parameter.log:
            away = abs(math.log(value / near)) / math.log(high / low)
        else:
            away = abs(value - near) / (high - low)
        total += min(away / _TENTH, _MOST_TENTHS)
    return total


def clip_to_plausible(term: Term, axis: AxisSettings) -> Term:
    """The effect with sizes and shapes clipped to their plausible ranges, where it has any."""
    if term.effect.any_size:
        return term
    turned = any(p.role == "phase" for p in term.effect.parameters)
    values = []
    for parameter, value in zip(term.effect.parameters, term.values, strict=True):
        if parameter.role not in ("size", "shape"):
            values.append(value)
            continue
        ranges = parameter.ranges(axis)
        low, high = min(r[0] for r in ranges), max(r[1] for r in ranges)
        if parameter.role == "size":
            neutral = parameter.neutral_on(axis)
            none = low if neutral is None else neutral
            low, high = min(low, none), max(high, none)
            if turned:  # half a turn changes the sign
                low = min(low, -high)
        values.append(min(max(value, low), high))
    return Term(term.effect, tuple(values))


def is_coulomb_level(term: Term, axis: AxisSettings) -> bool:
    """Whether an effect changes the Coulomb level, in total, over time or over position."""
    ports = term.ports(axis)
    tables = (ports.time_coulomb, ports.position_coulomb)
    courses = bool(ports.decays) or any(table is not None for table in tables)
    return courses or ports.coulomb != 1.0


def is_coulomb_drift(term: Term, axis: AxisSettings) -> bool:
    """Whether an effect is a Coulomb level that changes with time."""
    ports = term.ports(axis)
    return bool(ports.decays) or ports.time_coulomb is not None


_PLAIN = ("mass", "coulomb", "viscous", "stiffness", "static_ratio")
"""Ports that are figures of the plant."""


def is_within_tolerance(term: Term, axis: AxisSettings, tolerance: float) -> bool:
    """Whether an effect is no more than a plant figure within the machine file's tolerance.

    A deviation beyond `MAX_SIGMAS` is an effect (docs/formats/gap-report.md).

    Args:
        term: the effect.
        axis: of the machine file.
        tolerance: relative standard deviation of the plant's figures.
    """
    if len(term.values) != 1:
        return False
    plain, ports = EffectPorts(axis, 1e-3, 1.0), term.ports(axis)
    pairs = [(float(getattr(plain, name)), float(getattr(ports, name))) for name in _PLAIN]
    largest = max(abs(now - was) / was if was else abs(now) for was, now in pairs)
    return 0.0 < largest < MAX_SIGMAS * tolerance
