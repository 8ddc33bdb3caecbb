"""The virtual stage: one plant with all axes, and a virtual drive for each of them.

Does no input or output of its own: attached to a `lockstep.World` it lives in virtual time,
`server.serve` runs it in real time on any python-can bus.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hil_sim.drive import Drive
from hil_sim.ports import CanSegment, PlantPort
from hil_sim.settings import StageSettings

START_RANGE = 5e-3  # a stage is switched on within this distance of its index marks [m]
_START_STREAM = 0x5354  # keeps the start positions apart from the plant's noise of the same seed


def start_positions(settings: StageSettings, seed: int | None) -> tuple[float, ...]:
    """Where the axes stand at power-on, true coordinates [m], on whole encoder increments."""
    generator = np.random.default_rng((_START_STREAM, 0 if seed is None else seed))
    drawn = generator.uniform(-START_RANGE, START_RANGE, len(settings.axes))
    return tuple(
        round(float(x) / axis.increment) * axis.increment
        for x, axis in zip(drawn, settings.axes, strict=True)
    )


class VirtualStage:
    """Plant and drives, switched on when attached to a bus.

    Args:
        settings: of the stage.
        seed: of encoder noise, repeatability and start positions; None: noise-free.
        start: true positions at power-on [m], one per axis; None: drawn from the seed.
        plant: anything that behaves like the plant; None: the simulated one.

    Attributes:
        plant: the plant of all axes.
        drives: one per axis, in their order; empty until `attach`.

    Raises:
        ValueError: two axes with the same node id, or `start` of another length than the axes.
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
            raise ValueError(f"node: every axis needs its own, are {nodes}")
        if start is not None and len(start) != len(nodes):
            raise ValueError(f"start: one position per axis ({len(nodes)}), are {len(start)}")
        self.settings = settings
        if plant is None:
            from hil_sim.plant import Plant  # compiles: only where it is needed

            plant = Plant(
                settings, seed, start_positions(settings, seed) if start is None else start
            )
        self.plant = plant
        self.drives: tuple[Drive, ...] = ()

    def attach(self, segment: CanSegment | Sequence[CanSegment]) -> None:
        """Switch the drives on, on this bus.

        Args:
            segment: of all drives, or one for each: its own connection to the bus.

        Raises:
            ValueError: they are on a bus already.
        """
        if self.drives:
            raise ValueError("stage: is attached to a bus already")
        count = len(self.settings.axes)
        segments = segment if isinstance(segment, Sequence) else (segment,) * count
        self.drives = tuple(
            Drive(self.settings, axis, self.plant, own)
            for axis, own in zip(range(count), segments, strict=True)
        )
