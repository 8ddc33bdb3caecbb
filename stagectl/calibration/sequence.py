"""The sequence of moves at a calibration site, chosen for the information it yields.

Sliding both ways (Coulomb and viscous friction), reversals past presliding (stiffness), and a creep
(relaxation). The information is predicted before anything moves: the estimator runs on its own
model's response to the moves, and its final covariance hardly depends on the actual friction. The
shortest sequence that reaches the goals is chosen.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimation.friction import FrictionState, breakaway_travel, count_states, follow
from estimation.move import MoveData
from estimation.online import SplitHorizonEstimator
from estimation.trajectory import Limits, plan
from stagectl.config.machine import Axis, Machine
from stagectl.config.settings.host_model import estimator_settings
from stagectl.recipe import Excursion, Profile

GOALS = {"coulomb": 0.01, "viscous": 0.03, "stiffness": 0.01, "relaxation_rate": 0.035}
"""Relative standard deviations to reach."""
REST = 0.06
"""Rest after every move, at least [s]."""
REACH = 1.5e-3
"""How far from the site the sliding moves go [m]."""
START = {"coulomb": 0.3, "viscous": 0.3, "stiffness": 0.3, "relaxation_rate": 0.2}
"""Prior relative standard deviations, for the prediction."""


@dataclass(frozen=True, slots=True)
class Gain:
    """Information gained on one figure of one axis.

    Attributes:
        before, after: relative standard deviation.
    """

    before: float
    after: float

    @property
    def bits(self) -> float:
        """log2 of before over after."""
        return math.log2(self.before / self.after) if self.after > 0 else math.inf


@dataclass(frozen=True, slots=True)
class SiteSequence:
    """A sequence and its predicted gains.

    Attributes:
        excursions: moves at the site, the last one back onto it.
        duration: of the moves and their rests [s].
        gains: axis -> figure -> predicted gain.
    """

    excursions: tuple[Excursion, ...]
    duration: float
    gains: Mapping[str, Mapping[str, Gain]]

    def reaches(self, goals: Mapping[str, float] = GOALS) -> bool:
        """Whether the prediction reaches the goals for every figure of every axis."""
        return all(
            gains[name].after <= goal
            for gains in self.gains.values()
            for name, goal in goals.items()
            if name in gains
        )


def choose_sequence(machine: Machine, reach: float = REACH) -> SiteSequence:
    """The shortest sequence that reaches `GOALS`; if none does, the most informative one.

    Args:
        machine: as the host believes it to be.
        reach: of the sliding moves [m].
    """
    best: SiteSequence | None = None
    for rounds in (1, 2, 3):
        for creep in (0.0, 0.2e-3, 0.4e-3):
            made = _predicted(machine, _moves(machine, rounds, reach, creep))
            if made.reaches():
                return made
            if best is None or _bits(made) > _bits(best):
                best = made
    assert best is not None  # noqa: S101  the loops run
    return best


def _bits(sequence: SiteSequence) -> float:
    return sum(gain.bits for gains in sequence.gains.values() for gain in gains.values())


def _moves(machine: Machine, rounds: int, reach: float, creep: float) -> tuple[Excursion, ...]:
    """Offsets from the site, both axes at once."""
    # A low jerk: 20 us of uncertainty in when forces act, times mass and jerk, look like viscous
    # friction (3 % of it at 200 m/s^3).
    slide = _profile(machine, 0.5, 3.0, 50.0)
    fine = _profile(machine, 0.01, 0.2, 20.0)
    slow = _profile(machine, 0.001, 0.1, 10.0)
    # Twice the breakaway travel is certainly past presliding; a law may have none.
    figures = [axis.plant.friction.figures for axis in machine.axes.values()]
    turn = 2.0 * max(breakaway_travel(friction) for friction in figures)
    steps: list[tuple[float, str, Profile]] = []
    for _ in range(rounds):
        steps += [(reach, "other", slide), (0.0, "other", slide)]
        steps += [(-reach, "other", slide), (0.0, "other", slide)]
    if turn > 0.0:
        steps += [(turn, "micro", fine), (-turn, "micro", fine)]
        if creep:
            steps.append((creep, "creep", slow))
        steps.append((0.0, "micro", fine))
    return tuple(Excursion((offset, offset), kind, profile) for offset, kind, profile in steps)  # type: ignore[arg-type]


def _profile(machine: Machine, velocity: float, acceleration: float, jerk: float) -> Profile:
    """A profile within the limits of every axis."""
    limits = [axis.limits for axis in machine.axes.values()]
    return Profile(
        min(velocity, *(limit.velocity for limit in limits)),
        min(acceleration, *(limit.acceleration for limit in limits)),
        min(jerk, *(limit.jerk for limit in limits)),
    )


def _predicted(machine: Machine, excursions: Sequence[Excursion]) -> SiteSequence:
    gains: dict[str, dict[str, Gain]] = {}
    duration = 0.0
    for index, (name, axis) in enumerate(machine.axes.items()):
        gains[name], spent = _gain(axis, machine.bus.sync_period, excursions, index)
        duration = max(duration, spent)
    return SiteSequence(tuple(excursions), duration, gains)


def _gain(
    axis: Axis, period: float, excursions: Sequence[Excursion], index: int
) -> tuple[dict[str, Gain], float]:
    """Run the estimator on its own model's response to the moves of one axis.

    That is a stage on which nothing else acts, as its first sites will have shown.
    """
    friction = axis.plant.friction.figures
    settings = estimator_settings(axis, period, calibration=True)
    alone = replace(settings, belief=replace(settings.belief, unmodelled=0.0))
    estimator = SplitHorizonEstimator(friction, alone)
    values = {name: float(getattr(friction, name)) for name in START if friction.has(name)}
    estimator.believe({name: (value, START[name] * value) for name, value in values.items()})
    state = FrictionState.relaxed(count_states(friction), 0.0)
    state.forces[:] = 0.0
    estimator.expect(friction.coulomb, START["coulomb"] * friction.coulomb)  # as at a site
    at, time = 0.0, 0.0

    def move(target: float, profile: Profile) -> None:
        nonlocal at, time
        motion = plan(at, target, Limits(profile.velocity, profile.acceleration, profile.jerk))
        samples = math.ceil((motion.duration + REST) / period)
        moments = np.asarray(np.arange(samples) * period, np.float64)
        position, velocity, acceleration = motion.sample(moments)
        rest = state.total
        state.settle_at(float(position[0]))
        force, _ = follow(friction, state, position, velocity, period)
        force = force + friction.viscous * velocity + axis.plant.mass * acceleration
        estimator.update(MoveData(position, force, np.ones(samples, dtype=np.bool_), time, rest))
        at, time = target, time + samples * period

    # The arrival at the site, which leaves the elements as sliding does.
    move(-0.02, excursions[0].profile)
    move(0.0, excursions[0].profile)
    estimator.believe({name: (value, START[name] * value) for name, value in values.items()})
    begin = time
    for excursion in excursions:
        move(excursion.offset[index], excursion.profile)
    after = estimator.sigma_by_moves
    return {
        name: Gain(START[name], after[name] / value) for name, value in values.items()
    }, time - begin
