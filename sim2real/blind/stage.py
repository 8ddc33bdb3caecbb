"""The recording of a trial's stage, with finer integration steps than the diagnosis takes.

Where the model of a diagnosis takes 5 plant steps per control tick, this stage takes more. It has
as many friction elements as the machine file says, unless a check sets another number.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hil_sim.plant import simulate
from hil_sim.settings import StageSettings
from sim2real.blind.moves import Demands
from stagedata import AxisSignals, Recording

SUBSTEPS = (8, 10)
"""Plant steps per control tick; a stage has one of these."""
_OPERATIONAL = 0x1237


def record_stage(
    stage: StageSettings, demands: Demands, seed: int, substeps: int, machine: str, source: str
) -> Recording:
    """A recording of a stage.

    Args:
        stage: with everything that is wrong with it.
        demands: sent to it.
        seed: of encoder noise and friction wander.
        substeps: plant steps per control tick.
        machine: text of the machine file that the host believes in.
        source: name of the recording.
    """
    response = simulate(stage, demands.position, demands.offset, seed, substeps=substeps)
    count = len(demands.position)
    axes = {
        axis.name: AxisSignals(
            demands.position[:, a].copy(),
            demands.offset[:, a].copy(),
            response.position[:, a].copy(),
            response.force[:, a].copy(),
            np.full(count, _OPERATIONAL, dtype=np.uint16),
            np.ones(count, dtype=np.bool_),
        )
        for a, axis in enumerate(stage.axes)
    }
    time = np.arange(count, dtype=np.float64) * stage.sync_period
    return Recording(machine, "", "1970-01-01T00:00:00+00:00", time, axes, demands.moves, source)


def with_elements(stage: StageSettings, elements: int) -> StageSettings:
    """The stage with another number of friction elements, which the diagnosis cannot know."""
    return replace(
        stage,
        axes=tuple(
            replace(axis, friction=replace(axis.friction, elements=elements)) for axis in stage.axes
        ),
    )
