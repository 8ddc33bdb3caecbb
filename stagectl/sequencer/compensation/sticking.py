"""Friction that turns out to have no presliding, and an observer that assumes none from then on."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from estimation.observer import Design, sticks, without_presliding
from stagedata import F64


class Sticking:
    """Watches one axis for friction without presliding, once `watch` has been called.

    Attributes:
        found: friction has no presliding.
    """

    def __init__(self) -> None:
        self.found = False
        self._design: Design | None = None

    @property
    def watches(self) -> bool:
        """Whether samples are wanted."""
        return self._design is not None and not self.found

    def watch(self, design: Design, redesign: Callable[[Design], object]) -> None:
        """From now on an observer of this design corrects the offsets.

        Args:
            design: of the observer; one that assumes no presliding is left as it is.
            redesign: called once with the one for an axis that sticks.
        """
        if design.assumed_stiffness:
            self._design, self._redesign = design, redesign
            rest = np.zeros(1)  # compiled, or loaded, before anything moves
            sticks(design, rest, rest, np.zeros(1, np.bool_))

    def stop(self) -> None:
        """Watch no more."""
        self._design = None

    def judge(self, position: F64, force: F64, still: NDArray[np.bool_]) -> None:
        """Look whether the axis has stuck; arguments as those of `sticks`.

        Where it has, the new design takes some milliseconds, once in a run, at rest.
        """
        if self._design is not None and sticks(self._design, position, force, still):
            self.found = True
            other = without_presliding(self._design)
            if other.gain:
                self._redesign(other)
