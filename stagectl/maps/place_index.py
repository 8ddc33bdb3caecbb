"""Places near a place, found by the square of the table that they are in.

A lookup costs the same however many places there are, and places may be added in between.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence

from stagectl.history import Pair


class PlaceIndex:
    """Places, numbered from 0 in the order in which they were added.

    Args:
        radius: within which places count as near [m].
        places: to begin with [m].
    """

    def __init__(self, radius: float, places: Iterable[Pair] = ()) -> None:
        self._radius = radius
        # Places one radius apart, after rounding, are in neighbouring squares.
        self._side = radius * (1.0 + 1e-9)
        self._places: list[Pair] = []
        self._squares: dict[tuple[int, int], list[int]] = {}
        for place in places:
            self.add(place)

    def add(self, place: Pair) -> int:
        """Add a place [m]; its number."""
        number = len(self._places)
        self._places.append(place)
        self._squares.setdefault(self._square(place), []).append(number)
        return number

    def near(self, place: Sequence[float]) -> list[int]:
        """Numbers of the places within the radius, the earliest first."""
        i, j = self._square(place)
        at = (place[0], place[1])
        return sorted(
            number
            for square in itertools.product((i - 1, i, i + 1), (j - 1, j, j + 1))
            for number in self._squares.get(square, ())
            if math.dist(self._places[number], at) <= self._radius
        )

    def _square(self, place: Sequence[float]) -> tuple[int, int]:
        return math.floor(place[0] / self._side), math.floor(place[1] / self._side)
