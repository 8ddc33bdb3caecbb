"""Moves of the independent closed-loop simulation, for tests of the estimator."""

from dataclasses import dataclass, replace

import numpy as np

from estimation.friction import FrictionState, count_states, follow
from estimation.move import MoveData
from estimation.noise import encoder_noise, quantisation
from estimation.online.estimator import EstimatorSettings
from estimation.trajectory import Limits, plan
from hil_sim.plant.simulate import simulate
from stagectl.config import load_machine, stage_settings
from stagedata import FrictionFigures

TS = 1e-3
MACRO, MICRO = Limits(0.5, 3.0, 200.0), Limits(0.01, 0.2, 20.0)
TRUE = FrictionFigures(10, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0)
SETTINGS = EstimatorSettings(
    mass=8.0,
    period=TS,
    position_noise=encoder_noise(1e-9, 1e-9),
    force_noise=quantisation(0.04),
)


def whole(position, force, time=1.0, rest_force=0.0):
    """A move without a sample missing."""
    return MoveData(position, force, np.ones(len(position), dtype=bool), time, rest_force)


def modelled_force(friction, mass, position, state=None, band=0.0):
    """Force of the model along its own samples, from relaxed rest; ends repeated."""
    velocity, acceleration = (position[2:] - position[:-2]) / (2 * TS), np.diff(position, 2) / TS**2
    state = state or FrictionState.relaxed(count_states(friction), float(position[0]))
    elements, _ = follow(friction, state, position[1:-1], velocity, TS, band=band)
    inner = elements + friction.viscous * velocity + mass * acceleration
    return np.concatenate([inner[:1], inner, inner[-1:]])


@dataclass
class Drive:
    """Samples of axis x over a sequence of moves, and where each begins."""

    position: np.ndarray
    force: np.ndarray
    starts: list[int]

    def move(self, number):
        begin = self.starts[number] - 2
        end = self.starts[number + 1] if number + 1 < len(self.starts) else len(self.position)
        return whole(
            self.position[begin:end].copy(), self.force[begin:end].copy(), begin * TS,
            float(self.force[begin - 3 : begin + 2].mean()),
        )  # fmt: skip


def only_x(wander=0.01):
    stage = stage_settings(load_machine())
    x = stage.axes[0]
    return replace(stage, axes=(replace(x, wander=wander),))


def drive(moves, stage=None, seed=1, mass=8.0):
    """Closed loop, force offset = mass times acceleration; rests of 150 ms."""
    at, demand, offset, starts = 0.0, [np.zeros(100)], [np.zeros(100)], []
    count = 100
    for target, limits in moves:
        motion = plan(at, target, limits)
        rows = int(motion.duration / TS) + 150
        x, _, a = motion.sample(np.arange(1, rows + 1) * TS)
        starts.append(count)
        demand.append(x)
        offset.append(mass * a)
        count += rows
        at = target
    response = simulate(
        stage or only_x(), np.concatenate(demand)[:, None], np.concatenate(offset)[:, None], seed
    )
    return Drive(response.position[:, 0], response.force[:, 0], starts)


SEQUENCE = [
    (25e-3, MACRO), (25.06e-3, MICRO), (0.0, MACRO), (-0.05e-3, MICRO), (20e-3, MACRO),
    (19.95e-3, MICRO), (45e-3, MACRO), (45.07e-3, MICRO),
]  # fmt: skip


def learn(estimator, data, numbers=None):
    estimator.at_rest(0.0, 0.0, 0.0)
    return [estimator.update(data.move(n)) for n in numbers or range(len(data.starts))]
