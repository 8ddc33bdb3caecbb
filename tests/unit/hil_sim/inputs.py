"""What tests of the plant put in: a smooth random demand, an effect written in one line."""

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.effects import Effect

MASS = 8.0
"""Of axis x [kg]."""
both_steps = pytest.mark.parametrize("substeps", [5, 1])


def effect_of(write):
    """An effect without parameters that calls `write(ports)`."""

    class Own(Effect):
        """Of a test."""

        name, group, parameters = "own", "force", ()
        equation = enters = remedy = ""

        def apply(self, ports, parameters):
            write(ports)

    return Own().at()


def change_axes(stage, friction=None, control=None, **changes):
    """The stage with these figures of friction, control and settings on every axis."""
    axes = (
        replace(
            axis,
            friction=replace(axis.friction, **friction or {}),
            control=replace(axis.control, **control or {}),
            **changes,
        )
        for axis in stage.axes
    )
    return replace(stage, axes=tuple(axes))


OPEN = {"kp": 1e-9, "ki": 0.0, "kd": 0.0}
"""Control of a loop that is open: the motor gets the force offset, nothing else."""


def smooth_demand(seed, rows=600):
    rng = np.random.default_rng(seed)
    walk = np.cumsum(rng.normal(0.0, 1.0, (rows, 2)), axis=0)
    smooth = np.apply_along_axis(np.convolve, 0, walk, np.hanning(41), "same")
    return 1e-6 * (smooth - smooth[0])
