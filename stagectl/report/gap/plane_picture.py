"""The residual over position and velocity as coloured cells: blue below zero, orange above.

Colours are steps of two inks over the page's paper, so that zero has no colour in either theme; the
two are told apart with any kind of colour vision. Cells without samples are grey.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from stagectl.report.svg import Scale, text_element, ticks

F64 = NDArray[np.float64]

STEPS = 6
"""Steps of colour on each side of zero."""
_WIDTH, _HEIGHT = 480, 240
_LEFT, _TOP, _BOTTOM, _BAR = 78, 14, 48, 132
_BAR_WIDTH = 20


def plane_picture(
    positions: F64,
    velocities: F64,
    values: F64,
    limit: float,
    title: str,
    units: Sequence[str] = ("mm", "mm/s", "N"),
) -> Markup:
    """The picture as SVG.

    Args:
        positions: edges of the cells, float64[n + 1] [mm].
        velocities: likewise, float64[m + 1] [mm/s].
        values: of the cells, shape (n, m) [N]; nan where there is none.
        limit: value of the strongest colour [N]; larger ones have it too.
        title: for readers who do not see it.
        units: of positions, velocities and values; others on an axis that turns.
    """
    length, speed, force = units
    place = f"position [{length}]"
    right, bottom = _LEFT + _WIDTH, _TOP + _HEIGHT
    px = Scale(float(positions[0]), float(positions[-1]), _LEFT, right)
    py = Scale(float(velocities[0]), float(velocities[-1]), bottom, _TOP)
    width, height = right + _BAR, bottom + _BOTTOM
    parts = [
        f'<svg class="chart plane" viewBox="0 0 {width} {height}" role="img">'
        f"<title>{Markup.escape(title)}</title>",
        f'<rect class="unvisited" x="{_LEFT}" y="{_TOP}" width="{_WIDTH}" height="{_HEIGHT}"/>',
    ]
    across = [round(px(float(x))) for x in positions]
    down = [round(py(float(v))) for v in velocities]
    known = np.isfinite(values)
    steps = np.zeros(values.shape, dtype=np.int64)
    steps[known] = np.clip(np.round(values[known] / limit * STEPS), -STEPS, STEPS)
    for step in range(-STEPS, STEPS + 1):
        cells = "".join(
            f"M{across[i]} {down[j + 1]}H{across[i + 1]}V{down[j]}H{across[i]}z"
            for i, j in np.argwhere(known & (steps == step)).tolist()
        )
        if cells:
            # Paper below the ink: the ink is transparent, and the ground is grey.
            parts.append(f'<path class="paper" d="{cells}"/>')
            parts.append(f'<path {_ink(step)} d="{cells}"/>' if step else "")
    for x in ticks(px.low, px.high, 7):
        parts.append(text_element(px(x), bottom + 20, f"{x:.4g}", "middle"))
    for v in ticks(py.low, py.high, 5):
        parts.append(text_element(_LEFT - 8, py(v) + 5, f"{v:.4g}", "end"))
    parts.append(f'<path class="zero" d="M{_LEFT} {py(0.0):.1f}H{right}"/>')
    parts.append(text_element((_LEFT + right) / 2, height - 8, place, "middle", "axis"))
    middle = (_TOP + bottom) / 2
    parts.append(
        f'<text class="axis" x="18" y="{middle:.0f}" text-anchor="middle" '
        f'transform="rotate(-90 18 {middle:.0f})">velocity [{speed}]</text>'
    )
    return Markup("".join([*parts, *_scale(right + 22, limit, force), "</svg>"]))  # noqa: S704 - escaped


def colour_limit(values: F64) -> float:
    """A round value that nine in ten cells and more stay within [N]; 1 where there is none."""
    sizes = np.abs(values[np.isfinite(values)])
    largest = float(np.quantile(sizes, 0.93)) if len(sizes) else 0.0
    if largest <= 0.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(largest))
    return next(m * power for m in (1, 1.5, 2, 3, 5, 7, 10) if m * power >= largest * (1 - 1e-9))


def _ink(step: int) -> str:
    kind = "below" if step < 0 else "above"
    return f'class="{kind}" fill-opacity="{abs(step) / STEPS:.2f}"'


def _scale(left: float, limit: float, unit: str) -> list[str]:
    """The scale of colours, the largest value at the top."""
    each = _HEIGHT / (2 * STEPS + 1)
    place = f'x="{left:.0f}" width="{_BAR_WIDTH}" height="{each:.2f}"'
    parts = [
        f'<rect class="paper" x="{left:.0f}" y="{_TOP}" width="{_BAR_WIDTH}" height="{_HEIGHT}"/>'
    ]
    for step in range(-STEPS, STEPS + 1):
        y = _TOP + (STEPS - step) * each
        if step:
            parts.append(f'<rect {_ink(step)} {place} y="{y:.2f}"/>')
        if step in (-STEPS, 0, STEPS):
            sign = {-1: "\u2212", 0: "", 1: "+"}[(step > 0) - (step < 0)]
            text = f"{sign}{limit:g} {unit}" if step else "0"
            parts.append(text_element(left + _BAR_WIDTH + 6, y + each / 2 + 5, text, "start"))
    return parts
