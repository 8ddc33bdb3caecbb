"""A table whose friction varies over XY and falls as it warms up; and its oracle."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator

from hil_sim.effects.friction_map import field_factor
from stagectl.config.machine import Machine
from stagectl.config.machine.file import parse_machine
from stagectl.sequencer import Expectation

F64 = NDArray[np.float64]
SWING, LENGTH, WARM, TAU = 0.25, 0.04, 0.3, 120.0
SPOT, SPOT_WIDTH = (0.0, 0.0), 6e-3


@cache
def _field(seed: int) -> Callable[[F64], F64]:
    """The field of one axis over (own, other) position, on nodes as the simulator has it."""
    nodes = np.linspace(-0.07, 0.07, 141)
    values = field_factor(SWING, LENGTH, seed, nodes[:, None], nodes[None, :])
    return RegularGridInterpolator((nodes, nodes), values)  # type: ignore[no-any-return]


class Table:
    """The truth.

    Args:
        seed: of the fields.
        time: of the shift when the stage's own time is 0 [s]; infinite: warm.
        spot: how much higher the level is at the spot; 0 where there is none.
    """

    def __init__(self, machine: Machine, seed: int, time: float, spot: float) -> None:
        self.machine, self.seed, self.time, self.spot = machine, seed, time, spot
        self._place: F64 | None = None

    def truth(self) -> Machine:
        """As a machine file for the virtual stage."""
        warm = WARM * math.exp(-self.time / TAU)
        lines, axis = [], ""
        for line in self.machine.text.splitlines():
            lines.append(line)
            if line.strip() in ("x:", "y:"):
                axis = line.strip()[0]
            if not line.strip().startswith("repeatability:"):
                continue
            effects = [
                f"{{effect: friction_map, amplitude: {SWING}, length: {LENGTH}, "
                f"seed: {self._field('xy'.index(axis))}}}"
            ]
            if warm > 1e-6:
                effects.append(
                    f"{{effect: thermal_drift, amplitude: {warm!r}, time_constant: {TAU}}}"
                )
            if self.spot and axis == "x":
                effects.append(
                    f"{{effect: friction_spot, amplitude: {self.spot}, center: {SPOT[0]}, "
                    f"other: {SPOT[1]}, width: {SPOT_WIDTH}}}"
                )
            lines.append(f"    effects: [{', '.join(effects)}]")
        return parse_machine("\n".join(lines), "the truth")

    def _field(self, axis: int) -> int:
        return 2 * self.seed + axis

    def level(self, axis: int, path: F64) -> F64:
        """Factor on Fc at positions, shape (K, 2), warm."""
        factor = _field(self._field(axis))(path[:, [axis, 1 - axis]])
        if self.spot and axis == 0:
            away = ((path - np.array(SPOT)) ** 2).sum(axis=1)
            factor = factor * (1.0 + self.spot * np.exp(-0.5 * away / SPOT_WIDTH**2))
        return factor

    # As `Places`: an oracle.

    def expected_at(self, target: Sequence[float], time: float) -> Sequence[Expectation] | None:
        """The true level at the target."""
        place = np.array([target])
        if self._place is not None and np.linalg.norm(place - self._place) < 2e-3:
            return None
        self._place = place
        warm = 1.0 + WARM * math.exp(-(self.time + time) / TAU)
        return [
            Expectation(
                axis.plant.friction.coulomb * warm * float(self.level(a, place)[0]), 1e-6
            )
            for a, axis in enumerate(self.machine.axes.values())
        ]  # fmt: skip

    def coulomb_variation(self, axis: int, path: F64) -> F64:
        """The true variation along a path."""
        assert self._place is not None
        return self.level(axis, path) / float(self.level(axis, self._place)[0]) - 1.0

    def knows_path(self, kind: str) -> bool:
        """It knows every path."""
        return True

    def learn(self, *_: object) -> None:
        """It knows everything already."""
