"""The interface of a friction law: a module with the names of `FrictionLaw`.

A law keeps internal forces whose sum is the friction force without its viscous part, and carries
the derivatives of that sum along. Its compiled functions are reached through those below, which
dispatch on the type of the law's `Constants`: a kernel that takes constants is compiled once for
each law it is called with, and knows nothing of its insides. `gms` and `coulomb` are laws; `LAWS`
in `estimation.friction.model` names them.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from stagedata.compiled import KernelByType, kernel

F64 = NDArray[np.float64]

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


class FrictionLaw(Protocol):
    """A friction law's functions; all but `make_constants` and `count_states` compiled.

    `law` is an instance of the law's `Constants`, `trace` the record that `make_trace` makes.
    Forces are in N, and `forces` (with `slips`: which of them slide) the n internal ones.

    Attributes:
        Constants: named tuple of what is not estimated, with at least stribeck_velocity [m/s] and
            stribeck_shape. Its type is what compiled calls are dispatched on.
    """

    Constants: Any

    @staticmethod
    def make_constants(elements: int, stribeck_velocity: float, stribeck_shape: float) -> Any:
        """Constants of the law; the Stribeck velocity in m/s."""

    @staticmethod
    def count_states(elements: int) -> int:
        """How many internal forces it has."""

    @staticmethod
    def retained(law: Any, rate: float, period: float) -> float:
        """Share of a deviation from the sliding force left after `period` [s]; rate C/Fc [1/s]."""

    @staticmethod
    def has_presliding(law: Any) -> bool:
        """Whether it predicts the force before everything slides; else only zone A is solved."""

    @staticmethod
    def breakaway_travel(law: Any, coulomb: float, stiffness: float, alpha: float) -> float:
        """Displacement from relaxed to all sliding, at most [m]."""

    @staticmethod
    def stick_range(law: Any, forces: F64, known: float, coulomb: float) -> tuple[float, float]:
        """Change of the friction force, down and up, within which nothing begins to slide.

        `forces` were known under the Coulomb force `known`; they scale with it.
        """

    @staticmethod
    def correct(law: Any, forces: F64, static: float, total: float) -> None:
        """At-rest correction: make `forces` add up to `total`, as far as Fs = `static` allows."""

    @staticmethod
    def make_trace(law: Any) -> Any:
        """Workspace of a pass over a move: an array of one record, with at least these fields.

        total, shape (ROWS,): the rows above. sliding: share of the law's states that slide, 0 to 1.
        spring: stiffness of what sticks [N/m]. The record itself is the `trace` of the other
        functions; it does not keep the array alive.
        """

    @staticmethod
    def begin(
        law: Any, figures: Figures, trace: Any, forces: F64, known: float, total: float
    ) -> None:
        """Start a pass at rest; at-rest correction of `forces`, known under Fc = `known`."""

    @staticmethod
    def resume(law: Any, figures: Figures, trace: Any, forces: F64, slips: Any) -> None:
        """Start a pass in any state, without derivatives by what was before."""

    @staticmethod
    def slide(law: Any, figures: Figures, trace: Any, direction: float) -> None:
        """Start a pass with everything sliding, as after a long way in `direction` (+1, -1)."""

    @staticmethod
    def begin_zone(law: Any, trace: Any) -> None:
        """Zone A begins: an offset of all internal forces is an unknown from here on (BY_SLIP)."""

    @staticmethod
    def leap(
        law: Any, figures: Figures, trace: Any, travel: float, direction: float, fast: bool
    ) -> bool:
        """Take a whole period at once, if that is exact; else leave all as it is and return False.

        `travel` [m] in `direction` (0 at rest); `fast`: the Stribeck rise is nil.
        """

    @staticmethod
    def step(
        law: Any, figures: Figures, trace: Any, travel: float, direction: float, before: float,
        rise: float, time: float,
    ) -> tuple[float, float]:  # fmt: skip
        """One displacement in one direction at one point of the Stribeck curve.

        `travel` [m] within `time` [s]; `rise` is exp(-|v/vs|^delta) in this step, `before` in the
        one before it. Returns the share of the states that begin to slide in it, and how far a
        position's error moves the force at which they do [N/m].
        """

    @staticmethod
    def release(law: Any, figures: Figures, trace: Any, direction: float) -> float:
        """The motion in `direction` has ended: everything sticks.

        Returns how far the force is from where it would relax to at zero speed.
        """

    @staticmethod
    def finish(law: Any, trace: Any, forces: F64, slips: Any) -> None:
        """Write the internal forces, and which of them slide, at the end of a pass."""


_modules: dict[type, FrictionLaw] = {}


def register(module: FrictionLaw) -> FrictionLaw:
    """Make a law known to the compiled calls; returns it."""
    _modules[module.Constants] = module
    return module


def _dispatched(name: str) -> Any:
    """A function that calls the one of this name of the law whose constants it is given."""
    return KernelByType(
        name, lambda: {kind: getattr(module, name) for kind, module in _modules.items()}
    )


retained = _dispatched("retained")
has_presliding = _dispatched("has_presliding")
breakaway_travel = _dispatched("breakaway_travel")
stick_range = _dispatched("stick_range")
correct = _dispatched("correct")
make_trace = _dispatched("make_trace")
begin = _dispatched("begin")
resume = _dispatched("resume")
slide = _dispatched("slide")
begin_zone = _dispatched("begin_zone")
leap = _dispatched("leap")
step = _dispatched("step")
release = _dispatched("release")
finish = _dispatched("finish")


@kernel()
def stribeck_rise(ratio, shape):  # type: ignore[no-untyped-def]
    """exp(-ratio^shape): what is left of the Stribeck rise at `ratio` = |v|/vs."""
    if shape != 1.0:
        ratio = ratio**shape
    return math.exp(-ratio) if ratio < 40.0 else 0.0
