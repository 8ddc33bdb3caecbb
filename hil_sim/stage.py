"""The virtual stage: one plant with all axes, and a virtual drive for each of them.

It does no input or output of its own. Attached to a `bus.World` it lives in virtual time;
`bus.serve` runs it in real time on any python-can bus.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hil_sim.drive import Drive
from hil_sim.ports import CanSegment, PlantPort
from hil_sim.settings import StageSettings

START_RANGE = 5e-3
"""Largest distance of the axes from their index marks at power-on [m]."""
_START_STREAM = 0x5354  # random numbers apart from those of the plant's noise


def draw_start_positions(settings: StageSettings, seed: int | None) -> tuple[float, ...]:
    """True positions of the axes at power-on [m], on whole encoder increments."""
    generator = np.random.default_rng((_START_STREAM, 0 if seed is None else seed))
    drawn = generator.uniform(-START_RANGE, START_RANGE, len(settings.axes))
    return tuple(
        round(float(x) / axis.increment) * axis.increment
        for x, axis in zip(drawn, settings.axes, strict=True)
    )


class VirtualStage:
    """Plant and drives; the drives are switched on when attached to a bus.

    Args:
        settings: of the stage.
        seed: of encoder noise, friction wander and start positions; None: noise-free.
        start: true positions at power-on [m], one per axis; None: drawn from the seed.
        plant: used in place of the simulated one.

    Attributes:
        plant: the plant of all axes.
        drives: one per axis, in their order; empty until `attach`.

    Raises:
        ValueError: two axes with the same node id, or `start` has the wrong length.
    """

    def __init__(
        self,
        settings: StageSettings,
        seed: int | None,
        start: Sequence[float] | None = None,
        plant: PlantPort | None = None,
    ) -> None:
        nodes = [axis.node for axis in settings.axes]
        if len(set(nodes)) < len(nodes):
            raise ValueError(f"node: every axis needs its own, got {nodes}")
        if start is not None and len(start) != len(nodes):
            raise ValueError(f"start: needs one position per axis ({len(nodes)}), got {len(start)}")
        self.settings = settings
        if plant is None:
            from hil_sim.plant import Plant  # compiles: only where it is needed

            plant = Plant(
                settings, seed, draw_start_positions(settings, seed) if start is None else start
            )
        self.plant = plant
        self.drives: tuple[Drive, ...] = ()

    def attach(self, segment: CanSegment | Sequence[CanSegment]) -> None:
        """Switch the drives on.

        Args:
            segment: the bus of all drives, or one connection to it for each drive.

        Raises:
            ValueError: the stage is attached to a bus already.
        """
        if self.drives:
            raise ValueError("stage: is attached to a bus already")
        count = len(self.settings.axes)
        segments = segment if isinstance(segment, Sequence) else (segment,) * count
        self.drives = tuple(
            Drive(self.settings, axis, self.plant, own)
            for axis, own in zip(range(count), segments, strict=True)
        )
