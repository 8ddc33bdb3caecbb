"""Line plots as SVG text: panels with axes, lines, shaded spans. Enough for two figures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

_LEFT, _RIGHT, _TOP, _BOTTOM = 62, 12, 22, 38
_MOST_POINTS = 800
_LETTER = 5.8
"""About as wide as a letter [px]."""
_FONT = 'font-family="Helvetica, Arial, sans-serif" font-size="11"'


@dataclass(frozen=True, slots=True)
class Line:
    """A curve.

    Attributes:
        x, y: points, shape (n,).
        label: for the legend, above the panel; empty for none.
        colour: of the stroke; dashed: broken.
    """

    x: F64
    y: F64
    label: str = ""
    colour: str = "#1f5fa8"
    dashed: bool = False


@dataclass(frozen=True, slots=True)
class Span:
    """A shaded range of x with a word at its top."""

    first: float
    last: float
    label: str
    colour: str


@dataclass(frozen=True, slots=True)
class Panel:
    """One pair of axes.

    Attributes:
        x_label, y_label: with units.
        lines: drawn in order.
        spans: behind them.
        title: above.
    """

    x_label: str
    y_label: str
    lines: tuple[Line, ...]
    spans: tuple[Span, ...] = ()
    title: str = ""


def draw(rows: Sequence[Sequence[Panel]], width: int, height: int, title: str) -> str:
    """A figure of panels in rows, each `height` pixels high.

    Args:
        rows: panels, top to bottom, left to right.
        width: of the whole [px].
        height: of a row [px].
        title: for those who do not see it.
    """
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height * len(rows)}" '
        f'viewBox="0 0 {width} {height * len(rows)}" role="img" {_FONT}>',
        f"<title>{escape(title)}</title>",
        '<rect width="100%" height="100%" fill="#ffffff"/>',
    ]
    for r, row in enumerate(rows):
        each = width / len(row)
        for c, panel in enumerate(row):
            parts += _panel(panel, c * each, r * height, each, height)
    return "\n".join([*parts, "</svg>", ""])


def ticks(low: float, high: float, most: int = 6) -> list[float]:
    """Round numbers inside low..high: steps of 1, 2 or 5 times a power of ten."""
    if not high > low:
        return [low]
    raw = (high - low) / most
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(m * power for m in (1, 2, 5, 10) if m * power >= raw * (1 - 1e-9))
    first = math.ceil(low / step - 1e-9)
    return [k * step for k in range(first, math.floor(high / step + 1e-9) + 1)]


def _panel(panel: Panel, x0: float, y0: float, width: float, height: float) -> list[str]:
    low_x, high_x = _range([line.x for line in panel.lines], 0.0)
    low_y, high_y = _range([line.y for line in panel.lines], 0.06)
    left, right = x0 + _LEFT, x0 + width - _RIGHT
    top, bottom = y0 + _TOP, y0 + height - _BOTTOM

    def px(x: float) -> float:
        return left + (x - low_x) / (high_x - low_x) * (right - left)

    def py(y: float) -> float:
        return bottom - (y - low_y) / (high_y - low_y) * (bottom - top)

    parts = []
    for span in panel.spans:
        first, last = (px(min(max(x, low_x), high_x)) for x in (span.first, span.last))
        parts.append(
            f'<rect x="{first:.1f}" y="{top:.1f}" width="{last - first:.1f}" '
            f'height="{bottom - top:.1f}" fill="{span.colour}"/>'
        )
        parts.append(_text((first + last) / 2, top - 5, span.label, "middle"))
    for x in ticks(low_x, high_x):
        parts.append(_stroke(px(x), top, px(x), bottom))
        parts.append(_text(px(x), bottom + 14, _number(x), "middle"))
    for y in ticks(low_y, high_y, 5):
        parts.append(_stroke(left, py(y), right, py(y)))
        parts.append(_text(left - 5, py(y) + 4, _number(y), "end"))
    parts.append(
        f'<rect x="{left:.1f}" y="{top:.1f}" width="{right - left:.1f}" '
        f'height="{bottom - top:.1f}" fill="none" stroke="#444444"/>'
    )
    for line in panel.lines:
        points = " ".join(
            f"{px(float(x)):.1f},{py(float(y)):.1f}"
            for x, y in zip(*thinned(line.x, line.y, _MOST_POINTS), strict=True)
        )
        dash = ' stroke-dasharray="5 4"' if line.dashed else ""
        parts.append(
            f'<polyline points="{points}" fill="none" stroke="{line.colour}" '
            f'stroke-width="1.4"{dash}/>'
        )
    end = right
    for line in reversed([line for line in panel.lines if line.label]):
        start = end - _LETTER * len(line.label)
        dash = ' stroke-dasharray="5 4"' if line.dashed else ""
        parts.append(
            f'<line x1="{start - 24:.1f}" y1="{top - 9:.1f}" x2="{start - 4:.1f}" '
            f'y2="{top - 9:.1f}" stroke="{line.colour}" stroke-width="1.4"{dash}/>'
        )
        parts.append(_text(start, top - 5, line.label, "start"))
        end = start - 36
    parts.append(_text((left + right) / 2, bottom + 30, panel.x_label, "middle"))
    middle = (top + bottom) / 2
    parts.append(
        f'<text x="{x0 + 14:.1f}" y="{middle:.1f}" text-anchor="middle" '
        f'transform="rotate(-90 {x0 + 14:.1f} {middle:.1f})">{escape(panel.y_label)}</text>'
    )
    if panel.title:
        parts.append(_text((left + right) / 2, top - 7, panel.title, "middle"))
    return parts


def _range(values: list[F64], margin: float) -> tuple[float, float]:
    low = min(float(v.min()) for v in values)
    high = max(float(v.max()) for v in values)
    if high == low:
        return low - 1.0, high + 1.0
    return low - margin * (high - low), high + margin * (high - low)


def thinned(x: F64, y: F64, most: int) -> tuple[F64, F64]:
    """About so many points of a curve: its ends, and the extremes of what lies between."""
    if len(x) <= most:
        return x, y
    chunks = np.array_split(np.arange(len(x)), most // 2)
    extremes = {int(i) for c in chunks for i in (c[y[c].argmin()], c[y[c].argmax()])}
    kept = sorted({0, *extremes, len(x) - 1})
    return x[kept], y[kept]


def _stroke(x1: float, y1: float, x2: float, y2: float) -> str:
    return f'<path d="M{x1:.1f} {y1:.1f}L{x2:.1f} {y2:.1f}" stroke="#dddddd"/>'


def _text(x: float, y: float, text: str, anchor: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(text)}</text>'


def _number(value: float) -> str:
    return f"{value:.6g}" if abs(value) > 1e-12 else "0"
