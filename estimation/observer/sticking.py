"""Whether friction of an axis sticks: at rest the force on it changes, and the axis does not move.

Presliding friction is a spring: an axis at rest gives way to every change of force. Where it does
not, there is no spring. The observer that assumes one takes for friction's pull what has to be sent
while the axis slides, overshoots by it, and the axis sticks anew beyond its target.

See docs/reference/observer.md, model.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimation.observer.design import Design, design_observer
from stagedata import F64

Flags = NDArray[np.bool_]

SPAN = 0.02
"""Time over which force and position are compared [s]."""
LEAST_FORCE = 1.0 / 3.0
"""Of the Coulomb force: smaller changes of force say nothing."""
STIFFER = 100.0
"""Times presliding stiffness and proportional gain together: no spring that is merely stiffer than
believed; base motion and vibrations, which change the force and hardly move the axis, reach 10."""


def sticks(design: Design, position: F64, force: F64, still: Flags) -> bool:
    """Whether an axis stuck somewhere in a stretch of its samples.

    Args:
        design: of its observer.
        position: one per SYNC [m], shape (K,).
        force: measured [N], shape (K,).
        still: valid samples while no axis was to move, shape (K,).
    """
    own = design.figures
    span = round(SPAN / own.period)
    spring = STIFFER * (own.drive.kp + own.carriage.stiffness)
    for end in range(len(position), span - 1, -span):  # the last one first
        block = slice(end - span, end)
        if still[block].all():
            # A coarse encoder does not show small motions.
            moved = np.ptp(position[block]) + own.noise
            if np.ptp(force[block]) > max(LEAST_FORCE * own.coulomb, spring * moved):
                return True
    return False


def without_presliding(design: Design) -> Design:
    """The observer of an axis whose friction is no spring."""
    own = design.figures
    return design_observer(replace(own, carriage=replace(own.carriage, stiffness=0.0)))
