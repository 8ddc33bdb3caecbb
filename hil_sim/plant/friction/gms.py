"""Generalized Maxwell-slip friction of the simulated plant, in steps of a few microseconds.

Equations: docs/reference/reference-stage.md, "The plant".

Element i sticks:  dF_i/dt = k_i sigma0 v, until F_i reaches nu_i s(v) Fc in the direction of v.
Element i slips, until v goes through zero:  F_i <- F_inf + (F_i - F_inf) exp(-C dt/(s(v) Fc)),
F_inf = sgn(v) nu_i s(v) Fc.  Viscous friction is the plant's business.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from stagedata import F64
from stagedata.compiled import kernel


def element_shares(count: int) -> F64:
    """float64[N], nu_i = 2i/(N(N+1)): each element's share in the Coulomb force; they add to 1."""
    return 2.0 * np.arange(1, count + 1) / (count * (count + 1))


def balance(elements: int, static: float, force: float) -> F64:
    """Forces of elements at rest that add up to `force`, as far as they can hold it.

    Args:
        elements: how many, N.
        static: Fs [N].
        force: to be held [N], in equal parts where the limits allow.

    Returns:
        F_i [N], shape (N,).
    """
    limits = element_shares(elements) * static
    forces = np.zeros(elements)
    for _ in range(elements):
        free = np.abs(forces) < limits
        missing = force - float(forces.sum())
        if abs(missing) < 1e-12 or not free.any():
            break
        forces[free] += missing / free.sum()
        np.clip(forces, -limits, limits, out=forces)
    return forces


class Slip(NamedTuple):
    """The sliding in a step.

    Attributes:
        direction: sign of the velocity, +1 or -1.
        displacement: [m].
        level: s(v) Fc [N], what may scale Fc included.
        decay: exp(-C dt/(s(v) Fc)).
    """

    direction: float
    displacement: float
    level: float
    decay: float


@kernel(inline="always")
def slip_step(
    forces: F64,
    slipping: NDArray[np.bool_],
    shares: F64,
    slip: Slip,
    element_stiffness: float,
    count: int,
    first: int = 0,
) -> float:
    """Advance all elements by one step; return their total force.

    Args:
        forces: F_i [N], shape (>= count,), changed in place.
        slipping: slip flags, same shape, changed in place.
        shares: nu_i, same shape.
        slip: of this step.
        element_stiffness: k_i sigma0 [N/m], the same for all elements.
        count: elements in use.
        first: number of the first element, where several axes share the arrays. (A slice for each
            axis would count references at every step, which takes longer than the step.)
    """
    total = 0.0
    begin = np.uint64(first)  # an index without sign is not checked for counting from the end
    for i in range(begin, begin + np.uint64(count)):
        limit = shares[i] * slip.level
        force = forces[i]
        if not slipping[i]:
            stretched = force + element_stiffness * slip.displacement
            if stretched * slip.direction >= limit:
                slipping[i] = True
                # A limit that fell below the force at higher speed is approached, not jumped to.
                force = slip.direction * max(limit, force * slip.direction)
            else:
                force = stretched
        if slipping[i]:
            goal = slip.direction * limit
            force = goal + (force - goal) * slip.decay
        forces[i] = force
        total += force
    return total


@kernel(inline="always")
def slide(p, s, forces, slipping, shares, slip):  # type: ignore[no-untyped-def]
    """Advance the elements of an axis by one step; all stick where its direction has changed.

    Args:
        p: record of the axis.
        s: state of the axis, whose `friction` is set.
        forces: F_i of all axes [N], as of `slip_step`.
        slipping: slip flags, likewise.
        shares: nu_i, likewise.
        slip: of this step.
    """
    if slip.direction != s.direction:
        s.direction = slip.direction
        for i in range(p.first_element, p.first_element + p.elements):
            slipping[i] = False
    s.friction = slip_step(
        forces, slipping, shares, slip, p.element_stiffness, p.elements, p.first_element
    )
