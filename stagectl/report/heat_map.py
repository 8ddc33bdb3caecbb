"""A figure over a plane as coloured cells with their scale: one hue after another, or two inks.

The inks are over the page's paper: zero has no colour in either theme, and the two can be told
apart with any kind of colour vision. Cells that are not known are grey.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from stagectl.report.svg import Frame, Scale, picture, text
from stagedata import F64

_LONGER, _SHORTER = 240.0, 80.0
"""Length of the longer side, and least length of the shorter one [px]."""
_LEFT, _TOP, _BELOW, _BAR = 58, 26, 40, 84
_STEPS = 24
"""Steps of colour; an even number."""
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
        x, y: edges of the cells in the units of their labels, float64[n + 1] and float64[m + 1].
        values: of the cells, float64[n, m]; nan where there is none.
        limits: values of the first and last colour.
        labels: of x, y and the scale, with units.
        title: above.
        marks: places that are marked.
        is_plane: drawn to the proportions of the table; else twice as wide as high.
        two_inks: from -limit to limit; else by hue.
    """

    x: F64
    y: F64
    values: F64
    limits: tuple[float, float]
    labels: tuple[str, str, str]
    title: str
    marks: Sequence[tuple[float, float]] = ()
    is_plane: bool = True
    two_inks: bool = False


def draw_heat_map(of: HeatMap) -> Markup:
    """The picture as an SVG element."""
    wide, high = _LONGER, _LONGER / 2
    if of.is_plane:
        sides = float(np.ptp(of.x)), float(np.ptp(of.y))
        wide, high = (max(_LONGER * side / max(sides), _SHORTER) for side in sides)
    x = Scale(float(of.x[0]), float(of.x[-1]), _LEFT, _LEFT + wide)
    y = Scale(float(of.y[0]), float(of.y[-1]), _TOP + high, _TOP)
    low, top = of.limits
    share = (of.values - low) / ((top - low) or 1.0)
    steps = np.clip(np.floor(np.nan_to_num(share) * _STEPS), 0, _STEPS - 1).astype(np.int64)
    across, down = ([round(s(float(v)), 1) for v in ends] for s, ends in ((x, of.x), (y, of.y)))
    inside = [_rectangle('class="unvisited"', _LEFT, _TOP, wide, high)]
    for step in range(_STEPS):
        cells = np.argwhere(np.isfinite(of.values) & (steps == step)).tolist()
        path = "".join(
            f"M{across[i]} {down[j + 1]}H{across[i + 1]}V{down[j]}H{across[i]}z" for i, j in cells
        )
        if path:
            inside += [
                f'<path shape-rendering="crispEdges" {ink} d="{path}"/>'
                for ink in _inks(step, of.two_inks)
            ]
    inside += [
        f'<circle cx="{x(a):.1f}" cy="{y(b):.1f}" r="3" fill="none" stroke="#fff" '
        'stroke-width="1.5"/>'
        for a, b in of.marks
    ]
    bar, each = _LEFT + wide + 14, high / _STEPS
    for step in range(_STEPS):
        for ink in _inks(step, of.two_inks):
            inside.append(_rectangle(ink, bar, _TOP + high - (step + 1) * each, 14, each))
    decimals = max(2 - math.floor(math.log10(top - low or 1.0)), 0)
    for part in (0.0, 0.5, 1.0):
        value = f"{low + part * (top - low):.{decimals}f}".replace("-", "\N{MINUS SIGN}")
        inside.append(text(bar + 18, _TOP + high * (1 - part) + 4, value, "start"))
    inside.append(text(bar, _TOP - 8, of.labels[2], "start"))
    frame = Frame(x, y, of.labels[0], of.labels[1], of.title if of.is_plane else "").draw(
        inside, grid=False
    )
    return Markup(  # noqa: S704 - all texts are escaped
        picture(frame, _LEFT + wide + _BAR, _TOP + high + _BELOW, of.title)
    )


def common_limits(values: Sequence[F64]) -> tuple[float, float]:
    """Lowest and highest of all values, nan aside: one scale for pictures that are compared."""
    return min(float(np.nanmin(v)) for v in values), max(float(np.nanmax(v)) for v in values)


def round_limit(values: F64) -> float:
    """A round value that nine in ten cells and more stay within; 1 where there is none."""
    sizes = np.abs(values[np.isfinite(values)])
    largest = float(np.quantile(sizes, 0.93)) if len(sizes) else 0.0
    if largest <= 0.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(largest))
    return next(m * power for m in (1, 1.5, 2, 3, 5, 7, 10) if m * power >= largest * (1 - 1e-9))


def _rectangle(ink: str, x: float, y: float, width: float, height: float) -> str:
    place = f'x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}"'
    return f'<rect shape-rendering="crispEdges" {ink} {place}/>'


def _inks(step: int, two_inks: bool) -> list[str]:
    """What a step of colour is drawn with, one over the other."""
    if not two_inks:
        at = (step + 0.5) / _STEPS * (len(_COLOURS) - 1)
        known = np.arange(len(_COLOURS))
        rgb = (round(float(np.interp(at, known, _COLOURS[:, k]))) for k in range(3))
        return ['fill="#{:02x}{:02x}{:02x}"'.format(*rgb)]
    off = 2 * step + 1 - _STEPS  # odd, from 1 - steps to steps - 1
    ink = f'class="{"below" if off < 0 else "above"}" fill-opacity="{abs(off) / _STEPS:.2f}"'
    return ['class="paper"', ink]
