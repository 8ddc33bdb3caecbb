"""What the sequencer asks of whoever knows how friction differs over the table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from estimation.online import Estimate

F64 = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Expectation:
    """The Coulomb force of one axis at a place.

    Attributes:
        coulomb: Fc there [N].  sigma: its standard deviation [N].
        level: the wander w as it is now and its standard deviation; None: not known.
    """

    coulomb: float
    sigma: float
    level: tuple[float, float] | None = None


class Places(Protocol):
    """Knows the Coulomb force of every axis over the table, and learns of it from moves.

    Axes are numbered in the machine's order; positions are those of all axes.
    """

    def depart(self, target: Sequence[float], time: float) -> Sequence[Expectation | None] | None:
        """Before a move: what to expect at its target, or None where it stays at its place.

        Of an axis that nothing is known of, the entry is None.

        Args:
            target: [m].
            time: of the stage [s].
        """

    def relief(self, axis: int, path: F64) -> F64:
        """Fc on the way relative to that at the last departure's target, minus 1, shape (K,).

        Args:
            axis: whose.
            path: positions [m], shape (K, n).
        """

    def teaches(self, kind: str) -> bool:
        """Whether a move of this kind can be learned from: is friction on its way known?"""

    def arrived(self, axis: int, kind: str, estimate: Estimate, time: float) -> Expectation | None:
        """After a move: what it has shown. An answer replaces what is believed of the place.

        Args:
            axis: whose.
            kind: of the move.
            estimate: what the estimator made of it.
            time: of the stage [s].
        """
