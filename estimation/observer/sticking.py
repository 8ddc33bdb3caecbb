"""Whether friction of an axis sticks: at rest the force on it changes, and the axis does not move.

Presliding friction is a spring: an axis at rest gives way to every change of force. Where it does
not, there is no spring. The observer that assumes one takes for friction's pull what has to be sent
while the axis slides, overshoots by it, and the axis sticks anew beyond its target.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimation.observer.design import Design, design_observer
from stagedata.compiled import kernel

F64 = NDArray[np.float64]
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
    spring = own.drive.kp + own.carriage.stiffness
    position, force = np.ascontiguousarray(position), np.ascontiguousarray(force)
    return bool(
        holds_on(
            position, force, still, round(SPAN / own.period), own.noise,
            LEAST_FORCE * own.coulomb, STIFFER * spring,
        )
    )  # fmt: skip


@kernel()
def holds_on(position, force, still, span, noise, least, spring):  # type: ignore[no-untyped-def]
    """Whether force changes and position does not in any block of still samples, the last first.

    Args:
        position: one per SYNC [m], (K,).
        force: measured [N], (K,).
        still: as of `sticks`, (K,).
        span: samples of a block.
        noise: of the position [m]: a coarse encoder does not show small motions.
        least: change of force that says anything [N].
        spring: least stiffness of what holds on [N/m].
    """
    for end in range(position.shape[0], span - 1, -span):
        block = slice(end - span, end)
        if not still[block].all():
            continue
        changed = force[block].max() - force[block].min()
        moved = position[block].max() - position[block].min() + noise
        if changed > max(least, spring * moved):
            return True
    return False


def without_presliding(design: Design) -> Design:
    """The observer of an axis whose friction is no spring."""
    own = design.figures
    return design_observer(replace(own, carriage=replace(own.carriage, stiffness=0.0)))
