"""The edge of a map: the convex hull of its sites, and the nearest point inside it.

Andrew's monotone chain (A. M. Andrew, Information Processing Letters 9, 1979). One place, or all on
a line, make a hull of no area.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stagedata import F64


@dataclass(frozen=True, slots=True, eq=False)
class Hull:
    """A convex polygon.

    Attributes:
        corners: counter-clockwise, shape (c, 2) [m]; one for a point, two for a line.
    """

    corners: F64

    @classmethod
    def of(cls, places: F64) -> Hull:
        """Of places [m], shape (n, 2), n >= 1."""
        points = sorted({(float(x), float(y)) for x, y in places})
        if len(points) <= 2:
            return cls(np.array(points))
        chain: list[tuple[float, float]] = []
        for half in (points, points[::-1]):
            begin = len(chain)
            for point in half:
                while len(chain) - begin >= 2 and _turn(chain[-2], chain[-1], point) <= 0.0:
                    chain.pop()
                chain.append(point)
            chain.pop()  # the first of the other half
        return cls(np.array(chain))

    def clamp(self, places: F64, margin: float = 0.0) -> tuple[F64, F64]:
        """The nearest points of the hull grown by `margin` [m], and how far they are [m].

        Args:
            places: [m], shape (m, 2).
            margin: by which the hull is grown.

        Returns:
            points, shape (m, 2); distances, shape (m,), 0 inside.
        """
        nearest = self._nearest(places)
        away = places - nearest
        distance = np.hypot(away[:, 0], away[:, 1])
        share = np.minimum(1.0, margin / np.maximum(distance, 1e-300))
        outside = np.maximum(distance - margin, 0.0)
        outside[outside < 1e-12] = 0.0
        return nearest + away * share[:, None], outside

    def _nearest(self, places: F64) -> F64:
        corners = self.corners
        if len(corners) == 1:
            return np.repeat(corners, len(places), axis=0)
        begin = corners if len(corners) > 2 else corners[:1]
        end = np.roll(corners, -1, axis=0) if len(corners) > 2 else corners[1:]
        along = end - begin  # (e, 2)
        offset = places[:, None, :] - begin[None]  # (m, e, 2)
        share = np.einsum("mek,ek->me", offset, along) / np.einsum("ek,ek->e", along, along)
        foot = begin[None] + np.clip(share, 0.0, 1.0)[..., None] * along[None]
        distance = np.linalg.norm(places[:, None, :] - foot, axis=2)
        result: F64 = foot[np.arange(len(places)), distance.argmin(axis=1)].copy()
        if len(corners) > 2:
            left = along[None, :, 0] * offset[..., 1] - along[None, :, 1] * offset[..., 0]
            inside = (left >= 0.0).all(axis=1)
            result[inside] = places[inside]
        return result


def _turn(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    """> 0 where a, b, c turn left."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
