"""Batch simulation: the closed-loop response of a stage to whole demands, without a bus.

It uses the same compiled mechanics that the virtual drives step.

What it computes: docs/reference/reference-stage.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hil_sim.effects.ports import EffectPorts
from hil_sim.plant.arrays import Arrays
from hil_sim.plant.mechanics import run_demands
from hil_sim.plant.noise import Noise
from hil_sim.settings import SUBSTEPS, StageSettings
from stagedata import F64

_BLOCK = 8192  # SYNC periods simulated at once


@dataclass(frozen=True, slots=True)
class Response:
    """What the drives report at each SYNC, float64[K, axes].

    Attributes:
        position: position actual value [m].
        force: force actual value, rounded to 1/1000 of the rated force [N].
    """

    position: F64
    force: F64


def simulate(
    settings: StageSettings,
    demand: F64,
    offset: F64,
    seed: int | None,
    rest_force: Sequence[float] | None = None,
    *,
    level: F64 | None = None,
    substeps: int = SUBSTEPS,
    rounded: bool = True,
) -> Response:
    """Simulate the closed loop from rest at the first target.

    The kernel releases the interpreter lock, so that threads run in parallel. An axis that does not
    depend on another one (`needs_all_axes`) may be simulated alone, with its settings and columns
    only; several variants of one axis: `simulate_variants`.

    Args:
        settings: of the stage.
        demand: target positions for SYNC k [m], float64[K, axes].
        offset: force offsets for SYNC k [N], float64[K, axes].
        seed: of encoder noise and friction wander; None for the noise-free response (encoder and
            force remain rounded).
        rest_force: motor force of each axis in the initial rest [N], balanced by its friction
            elements in equal parts (each at most its static limit); default 0.
        level: factor on Fc at each SYNC, float64[K, axes], linear between them; default 1.
        substeps: plant steps per control tick. 5 is the reference; 1 is several times faster and
            within a few nm and mN of it (`hil_sim.plant.coarse`); more than 5 is finer.
        rounded: False reports the force without rounding (the encoder stays rounded, in the loop).

    Raises:
        ValueError: shapes do not match, or effects are impossible.
    """
    demand = np.ascontiguousarray(demand, dtype=np.float64)
    offset = np.ascontiguousarray(offset, dtype=np.float64)
    _check_shapes(len(settings.axes), demand, offset, level)
    if len(demand) == 0:
        return Response(np.empty_like(demand), np.empty_like(demand))
    settings = settings.reaching(demand)
    duration = len(demand) * settings.sync_period
    running = Simulation(
        settings, (demand[0], offset[0]), seed, rest_force, duration, level, substeps
    )
    return running.run(demand, offset, rounded)


def _check_shapes(count: int, demand: F64, offset: F64, level: F64 | None) -> None:
    if demand.ndim != 2 or demand.shape[1] != count or demand.shape != offset.shape:
        raise ValueError(
            f"demand and offset must both have shape (K, {count}), "
            f"have {demand.shape} and {offset.shape}"
        )
    if len(demand) and level is not None and level.shape != demand.shape:
        raise ValueError(f"level must have shape {demand.shape}, has {level.shape}")


class Simulation:
    """The closed loop of a stage from rest at the first target, simulated part after part.

    Args:
        settings: of the stage.
        start: demand and force offset of the first SYNC, float64[axes] each [m, N].
        seed, rest_force, substeps: as of `simulate`.
        duration: of all parts together [s]; None: without end.
        level: as of `simulate`, for all parts together.

    Raises:
        ValueError: effects are impossible.
    """

    def __init__(
        self,
        settings: StageSettings,
        start: tuple[F64, F64],
        seed: int | None,
        rest_force: Sequence[float] | None = None,
        duration: float | None = None,
        level: F64 | None = None,
        substeps: int = SUBSTEPS,
    ) -> None:
        demand, offset = start
        self._settings, self._is_noisy = settings, seed is not None
        arrays = Arrays(settings, demand.tolist(), duration, substeps, level)
        for name in ("offset", "from_force", "to_force"):
            arrays.loop[name] = offset
        arrays.loop["powered"] = True
        for a, held in enumerate(() if rest_force is None else rest_force):
            if held != 0.0:  # at 0 friction holds nothing, even if effects pull
                arrays.balance(a, held, settings.axes[a])
        self._noise = Noise(len(settings.axes), seed)
        arrays.state["wander"] = self._noise.draw_initial_wander(settings)
        self._mechanics = arrays.mechanics

    def run(self, demand: F64, offset: F64, rounded: bool = True) -> Response:
        """What the drives report at the next P SYNCs.

        Args:
            demand: target positions, float64[P, axes], C-contiguous [m].
            offset: force offsets, likewise [N].
            rounded: as of `simulate`.
        """
        ticks = self._settings.ticks
        unit = np.array([rounded * a.control.rated_force / 1000.0 for a in self._settings.axes])
        position, force = np.empty_like(demand), np.empty_like(demand)
        for first in range(0, len(demand), _BLOCK):  # noise of all of it would not fit into memory
            block = slice(first, first + _BLOCK)
            normals = self._noise.draw(len(demand[block]) * ticks if self._is_noisy else 0)
            setpoints, response = (demand[block], offset[block]), (position[block], force[block])
            run_demands(self._mechanics, normals, unit, setpoints, response)
        return Response(position, force)


def needs_all_axes(settings: StageSettings) -> bool:
    """Whether an effect couples the axes, so that none can be simulated alone."""
    return any(
        EffectPorts.filled(axis, settings.sync_period, 0.0).involves_another
        for axis in settings.axes
    )


def simulate_variants(
    variants: StageSettings,
    demand: F64,
    offset: F64,
    rest_force: float = 0.0,
    *,
    substeps: int = 1,
    rounded: bool = True,
) -> Response:
    """Simulate several variants of one axis for the same demand, noise-free.

    Nearly twice as fast per variant as one after the other: the processor interleaves their steps.
    Four variants at a time are enough.

    Args:
        variants: a stage whose axes are the variants; no effect may involve another axis.
        demand: target position for SYNC k [m], float64[K].
        offset: force offset for SYNC k [N], float64[K].
        rest_force: motor force in the initial rest [N], as in `simulate`.
        substeps: as in `simulate`; coarse by default.
        rounded: as in `simulate`.

    Returns:
        One column per variant.

    Raises:
        ValueError: shapes do not match, or effects are impossible or involve another axis.
    """
    if needs_all_axes(variants):
        raise ValueError("variants of one axis cannot have effects that involve another one")
    count = len(variants.axes)
    shape = (len(demand), count)
    return simulate(
        variants,
        np.broadcast_to(np.asarray(demand)[:, None], shape),
        np.broadcast_to(np.asarray(offset)[:, None], shape),
        None,
        [rest_force] * count,
        substeps=substeps,
        rounded=rounded,
    )
