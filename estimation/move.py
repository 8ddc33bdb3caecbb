"""One move of an axis, as it was sampled."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stagedata import F64

_KINDS = (
    ("position", np.float64), ("force", np.float64), ("valid", np.bool_), ("disturbed", np.bool_)
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class MoveData:
    """One axis over one move, from rest to rest (or to the last sample).

    Attributes:
        position: sampled [m], shape (K,); the first samples at rest.
        force: measured at the same instants [N], shape (K,).
        valid: samples to be used, shape (K,).
        time: of position[0] on the axis' clock [s].
        rest_force: force measured at rest before the move [N].
        disturbed: samples of which only the position counts, shape (K,): the drive was catching up
            with late setpoints, and its force changed within a sample period; None: none.
    """

    position: F64
    force: F64
    valid: NDArray[np.bool_]
    time: float
    rest_force: float
    disturbed: NDArray[np.bool_] | None = None

    @property
    def path(self) -> F64:
        """Positions with straight lines across samples that are not valid [m], shape (K,)."""
        if self.valid.all() or not self.valid.any():
            return self.position
        index = np.arange(len(self.valid))
        return np.interp(index, index[self.valid], self.position[self.valid])

    def __post_init__(self) -> None:
        """Convert samples of any type and layout: kernels are compiled for one alone."""
        for name, kind in _KINDS:
            if getattr(self, name) is not None:
                object.__setattr__(self, name, np.ascontiguousarray(getattr(self, name), kind))
