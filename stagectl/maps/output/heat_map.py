"""A figure over the table as SVG text: coloured cells, sites, a scale."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stagectl.report import ticks

F64 = NDArray[np.float64]

_LEFT, _RIGHT, _TOP, _BOTTOM = 52, 84, 26, 40
_MOST, _LEAST = 300.0, 60.0
"""Length of the longer side, and least length of the shorter one [px]."""
# viridis at nine points (S. van der Walt, N. Smith, 2015): uniform, safe for colour blindness.
_COLOURS = np.array(
    [
        (68, 1, 84), (72, 40, 120), (62, 74, 137), (49, 104, 142), (38, 130, 142),
        (31, 158, 137), (53, 183, 121), (110, 206, 88), (253, 231, 37),
    ],
    dtype=np.float64,
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class HeatMap:
    """One picture.

    Attributes:
        x, y: centres of the cells [m], evenly spaced, shapes (n,), (m,).
        values: of the cells, shape (n, m); nan is left blank.
        sites: marked places [m].
        title: above the picture.
        unit: beside the scale.
        scale: factor on the numbers of the scale.
        digits: of the scale.
        limits: lowest and highest value of the scale, for pictures that are compared; default:
            this one's.
    """

    x: F64
    y: F64
    values: F64
    sites: Sequence[tuple[float, float]]
    title: str
    unit: str
    scale: float = 1.0
    digits: int = 2
    limits: tuple[float, float] | None = None


def common_limits(values: Sequence[F64]) -> tuple[float, float]:
    """Lowest and highest of all values, nan aside: one scale for pictures that are compared."""
    return min(float(np.nanmin(v)) for v in values), max(float(np.nanmax(v)) for v in values)


def draw_heat_map(picture: HeatMap) -> str:
    """Draw the picture as an SVG element, to the table's proportions (long: one shape per line)."""
    dx = float(picture.x[1] - picture.x[0])
    dy = float(picture.y[1] - picture.y[0])
    x0, x1 = float(picture.x[0]) - dx / 2, float(picture.x[-1]) + dx / 2
    y0, y1 = float(picture.y[0]) - dy / 2, float(picture.y[-1]) + dy / 2
    scale = min(_MOST / (x1 - x0), _MOST / (y1 - y0))
    left, top = _LEFT, _TOP
    right = round(left + max(scale * (x1 - x0), _LEAST))
    bottom = round(top + max(scale * (y1 - y0), _LEAST))
    width, height = right + _RIGHT, bottom + _BOTTOM
    low, high = picture.limits or common_limits([picture.values])
    if not high > low:
        low, high = low - 0.5e-9, high + 0.5e-9

    def px(x: float) -> float:
        return left + (x - x0) / (x1 - x0) * (right - left)

    def py(y: float) -> float:
        return bottom - (y - y0) / (y1 - y0) * (bottom - top)

    cell_w, cell_h = (right - left) / len(picture.x) + 0.6, (bottom - top) / len(picture.y) + 0.6
    parts = [
        f'<svg viewBox="0 0 {width} {height}" width="{width}" height="{height}" role="img" '
        f'aria-label="{picture.title}" font-size="12" fill="currentColor">',
        f'<text x="{left}" y="{top - 10}" font-weight="600">{picture.title}</text>',
    ]
    for i, x in enumerate(picture.x.tolist()):
        for j, y in enumerate(picture.y.tolist()):
            value = float(picture.values[i, j])
            if not np.isnan(value):
                parts.append(
                    f'<rect x="{px(x - dx / 2):.1f}" y="{py(y + dy / 2):.1f}" '
                    f'width="{cell_w:.1f}" height="{cell_h:.1f}" '
                    f'fill="{_colour((value - low) / (high - low))}"/>'
                )
    for x, y in picture.sites:
        parts.append(
            f'<circle cx="{px(x):.1f}" cy="{py(y):.1f}" r="3" fill="none" stroke="#fff" '
            'stroke-width="1.5"/>'
        )
    for x in ticks(x0 * 1e3, x1 * 1e3, 5):
        parts.append(_text(px(x * 1e-3), bottom + 16, f"{x:g}", "middle"))
    for y in ticks(y0 * 1e3, y1 * 1e3, 5):
        parts.append(_text(left - 6, py(y * 1e-3) + 4, f"{y:g}", "end"))
    parts.append(_text((left + right) / 2, bottom + 34, "x, mm", "middle"))
    parts.append(
        f'<text transform="translate({left - 38},{(top + bottom) / 2:.0f}) rotate(-90)" '
        'text-anchor="middle">y, mm</text>'
    )
    bar = right + 14
    for k in range(40):
        y = bottom - (k + 1) * (bottom - top) / 40
        parts.append(
            f'<rect x="{bar}" y="{y:.1f}" width="14" height="{(bottom - top) / 40 + 0.6:.1f}" '
            f'fill="{_colour((k + 0.5) / 40)}"/>'
        )
    for share in (0.0, 0.5, 1.0):
        value = (low + share * (high - low)) * picture.scale
        y = bottom - share * (bottom - top)
        parts.append(_text(bar + 18, y + 4, f"{value:.{picture.digits}f}", "start"))
    parts.append(_text(bar, top - 10, picture.unit, "start"))
    return "".join([*parts, "</svg>"])


def _colour(share: float) -> str:
    place = min(max(share, 0.0), 1.0) * (len(_COLOURS) - 1)
    i = min(int(place), len(_COLOURS) - 2)
    red, green, blue = (_COLOURS[i] + (place - i) * (_COLOURS[i + 1] - _COLOURS[i])).round()
    return f"#{int(red):02x}{int(green):02x}{int(blue):02x}"


def _text(x: float, y: float, text: str, anchor: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{text}</text>'
