"""The interface of a friction law: a module with the functions below, compiled, and three names.

- `Constants`, a named tuple of what is not estimated, with at least stribeck_velocity [m/s] and
  stribeck_shape;
- `make_constants(elements, stribeck_velocity, stribeck_shape)`, which returns them;
- `count_states(elements)`: how many internal forces the law has.

A law keeps internal forces whose sum is the friction force without its viscous part, and carries
the derivatives of that sum along. The functions below dispatch on the type of the `Constants`: a
kernel that takes constants is compiled once for each law it is called with, and knows nothing of
its insides. `gms` and `coulomb` are laws; `LAWS` in `estimation.friction.model` names them.

`law` is an instance of the law's `Constants`, `trace` the record that `make_trace` makes. Forces
are in N, and `forces` (with `slips`: which of them slide) the n internal ones.
"""

from __future__ import annotations

import math
from types import ModuleType
from typing import Any, NamedTuple

from stagedata.compiled import KernelByType, kernel

# Rows of a trace's total: friction force [N] and its derivatives by Fc [-], sigma0 [m], C/Fc [N s],
# alpha [N], and by an offset of all internal forces [-] at rest before the move, since the last
# turn, and where zone A begins.
FORCE, BY_COULOMB, BY_STIFFNESS, BY_RATE, BY_ALPHA, BY_REST, BY_TURN, BY_SLIP = range(8)
ROWS = 8

FAR_ABOVE = 12.0
"""exp(-12) of the Stribeck rise is left: far below any sensor."""
NO_SUBSTEPS = 4.0
"""Above this many Stribeck velocities the curve is straight enough within a sample."""


class Figures(NamedTuple):
    """Friction figures at which a law is evaluated.

    Attributes:
        coulomb: Fc [N].
        stiffness: sigma0 [N/m].
        rate: C/Fc [1/s].
        alpha: static ratio, (Fs - Fc)/Fc.
        period: of the samples [s].
        retained: share of a deviation from the sliding force that is left after one period, far
            above the Stribeck velocity.
    """

    coulomb: float
    stiffness: float
    rate: float
    alpha: float
    period: float
    retained: float


_modules: dict[type, ModuleType] = {}


def register(module: ModuleType) -> ModuleType:
    """Make a law known to the compiled calls; returns it."""
    _modules[module.Constants] = module
    return module


def _dispatched(name: str) -> Any:
    """A function that calls the one of this name of the law whose constants it is given."""
    return KernelByType(
        name, lambda: {kind: getattr(module, name) for kind, module in _modules.items()}
    )


retained = _dispatched("retained")
"""(law, rate, period): share of a deviation from the sliding force left after `period` [s]; rate
C/Fc [1/s]."""
has_presliding = _dispatched("has_presliding")
"""(law): whether it predicts the force before everything slides; else only zone A is solved."""
breakaway_travel = _dispatched("breakaway_travel")
"""(law, coulomb, stiffness, alpha): displacement from relaxed to all sliding, at most [m]."""
stick_range = _dispatched("stick_range")
"""(law, forces, known, coulomb): change of the friction force, down and up, within which nothing
begins to slide. `forces` were known under the Coulomb force `known`; they scale with it."""
correct = _dispatched("correct")
"""(law, forces, static, total): at-rest correction: make `forces` add up to `total`, as far as Fs =
`static` allows."""
make_trace = _dispatched("make_trace")
"""(law): workspace of a pass over a move: an array of one record, with at least these fields.

total, shape (ROWS,): the rows above. sliding: share of the law's states that slide, 0 to 1.
spring: stiffness of what sticks [N/m]. The record itself is the `trace` of the other functions; it
does not keep the array alive.
"""
begin = _dispatched("begin")
"""(law, figures, trace, forces, known, total): start a pass at rest; at-rest correction of
`forces`, known under Fc = `known`."""
resume = _dispatched("resume")
"""(law, figures, trace, forces, slips): start a pass in any state, without derivatives by what was
before."""
slide = _dispatched("slide")
"""(law, figures, trace, direction): start a pass with everything sliding, as after a long way in
`direction` (+1, -1)."""
begin_zone = _dispatched("begin_zone")
"""(law, trace): zone A begins: an offset of all internal forces is an unknown from here on
(BY_SLIP)."""
leap = _dispatched("leap")
"""(law, figures, trace, travel, direction, fast): take a whole period at once, if that is exact;
else leave all as it is and return False.

`travel` [m] in `direction` (0 at rest); `fast`: the Stribeck rise is nil.
"""
step = _dispatched("step")
"""(law, figures, trace, travel, direction, before, rise, time): one displacement in one direction
at one point of the Stribeck curve.

`travel` [m] within `time` [s]; `rise` is exp(-|v/vs|^delta) in this step, `before` in the one
before it. Returns the share of the states that begin to slide in it, and how far a position's error
moves the force at which they do [N/m].
"""
release = _dispatched("release")
"""(law, figures, trace, direction): the motion in `direction` has ended: everything sticks.

Returns how far the force is from where it would relax to at zero speed.
"""
finish = _dispatched("finish")
"""(law, trace, forces, slips): write the internal forces, and which of them slide, at the end of a
pass."""


@kernel()
def stribeck_rise(ratio, shape):  # type: ignore[no-untyped-def]
    """exp(-ratio^shape): what is left of the Stribeck rise at `ratio` = |v|/vs."""
    if shape != 1.0:
        ratio = ratio**shape
    return math.exp(-ratio) if ratio < 40.0 else 0.0
