"""One axis of a map over the whole table, as it is drawn and summed up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stagectl.maps.model import MapAxis
from stagedata import F64

CELLS = 36
"""Cells along each axis."""


@dataclass(frozen=True, slots=True)
class Surface:
    """The field of one axis on a grid; nan outside of the map.

    Attributes:
        x, y: centres of the cells [m], shape (CELLS,).
        value: Coulomb force [N], shape (CELLS, CELLS).
        sigma: its relative standard deviation, same shape.
    """

    x: F64
    y: F64
    value: F64
    sigma: F64

    @property
    def known_to(self) -> float:
        """To how much the map is known: the median over the table of the relative 1 sigma.

        Sites alone are known better than what is between them.
        """
        return float(np.nanmedian(self.sigma))


def surface(axis: MapAxis) -> Surface:
    """The field of an axis over the rectangle of its sites and half a site spacing around it."""
    field = axis.field()
    low, high = field.places.min(axis=0) - field.edge, field.places.max(axis=0) + field.edge
    x, y = (np.linspace(a, b, CELLS) for a, b in zip(low, high, strict=True))
    found = field.at(np.stack(np.meshgrid(x, y, indexing="ij"), -1).reshape(-1, 2))
    value, sigma = (
        np.where(found.inside, figure, np.nan).reshape(CELLS, CELLS)
        for figure in (found.value, found.sigma)
    )
    return Surface(x, y, value, sigma)
