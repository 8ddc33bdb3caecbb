"""Line plots as standalone SVG: panels with axes, lines and shaded spans.

`Scale`, `ticks`, `thinned` and the element functions also serve `gap.charts`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray

F64 = NDArray[np.float64]

_LEFT, _RIGHT, _TOP, _BOTTOM = 62, 12, 22, 38
_MAX_POINTS = 800
_LETTER = 5.8
"""Approximate width of a letter [px]."""
_FONT = 'font-family="Helvetica, Arial, sans-serif" font-size="11"'


@dataclass(frozen=True, slots=True)
class Line:
    """A curve.

    Attributes:
        x, y: points, shape (n,).
        label: for the legend above the panel; empty for none.
        colour: of the stroke.
        dashed: whether the stroke is.
    """

    x: F64
    y: F64
    label: str = ""
    colour: str = "#1f5fa8"
    dashed: bool = False


@dataclass(frozen=True, slots=True)
class Span:
    """A shaded range of x with a label at its top."""

    first: float
    last: float
    label: str
    colour: str


@dataclass(frozen=True, slots=True)
class Scale:
    """A linear map from values to pixels: `low` to `first`, `high` to `last`."""

    low: float
    high: float
    first: float
    last: float

    def __call__(self, value: float) -> float:
        """The pixel coordinate of a value."""
        return self.first + (value - self.low) / (self.high - self.low) * (self.last - self.first)


@dataclass(frozen=True, slots=True)
class Panel:
    """A plot in one pair of axes.

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
        title: read by screen readers.
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
    """Round numbers within low..high, in steps of 1, 2 or 5 times a power of ten."""
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

    px, py = Scale(low_x, high_x, left, right), Scale(low_y, high_y, bottom, top)
    parts = []
    for span in panel.spans:
        first, last = (px(min(max(x, low_x), high_x)) for x in (span.first, span.last))
        parts.append(
            f'<rect x="{first:.1f}" y="{top:.1f}" width="{last - first:.1f}" '
            f'height="{bottom - top:.1f}" fill="{span.colour}"/>'
        )
        parts.append(text_element((first + last) / 2, top - 5, span.label, "middle"))
    for x in ticks(low_x, high_x):
        parts.append(_stroke(px(x), top, px(x), bottom))
        parts.append(text_element(px(x), bottom + 14, _number(x), "middle"))
    for y in ticks(low_y, high_y, 5):
        parts.append(_stroke(left, py(y), right, py(y)))
        parts.append(text_element(left - 5, py(y) + 4, _number(y), "end"))
    parts.append(
        f'<rect x="{left:.1f}" y="{top:.1f}" width="{right - left:.1f}" '
        f'height="{bottom - top:.1f}" fill="none" stroke="#444444"/>'
    )
    for line in panel.lines:
        points = points_of(px, py, *thinned(line.x, line.y, _MAX_POINTS))
        parts.append(f'<polyline points="{points}" fill="none" {_line_style(line)}/>')
    parts += _legend(panel.lines, right, top)
    parts.append(text_element((left + right) / 2, bottom + 30, panel.x_label, "middle"))
    middle = (top + bottom) / 2
    parts.append(
        f'<text x="{x0 + 14:.1f}" y="{middle:.1f}" text-anchor="middle" '
        f'transform="rotate(-90 {x0 + 14:.1f} {middle:.1f})">{escape(panel.y_label)}</text>'
    )
    if panel.title:
        parts.append(text_element((left + right) / 2, top - 7, panel.title, "middle"))
    return parts


def _legend(lines: Sequence[Line], end: float, top: float) -> list[str]:
    """Samples and labels of the lines above a panel, ending at x = `end`."""
    parts = []
    for line in reversed([line for line in lines if line.label]):
        start = end - _LETTER * len(line.label)
        parts.append(
            f'<line x1="{start - 24:.1f}" y1="{top - 9:.1f}" x2="{start - 4:.1f}" '
            f'y2="{top - 9:.1f}" {_line_style(line)}/>'
        )
        parts.append(text_element(start, top - 5, line.label, "start"))
        end = start - 36
    return parts


def _line_style(line: Line) -> str:
    dash = ' stroke-dasharray="5 4"' if line.dashed else ""
    return f'stroke="{line.colour}" stroke-width="1.4"{dash}'


def _range(values: list[F64], margin: float) -> tuple[float, float]:
    low = min(float(v.min()) for v in values)
    high = max(float(v.max()) for v in values)
    if high == low:
        return low - 1.0, high + 1.0
    return low - margin * (high - low), high + margin * (high - low)


def thinned(x: F64, y: F64, most: int) -> tuple[F64, F64]:
    """About `most` points of a curve: its ends, and the extremes of each part between them."""
    if len(x) <= most:
        return x, y
    chunks = np.array_split(np.arange(len(x)), most // 2)
    extremes = {int(i) for c in chunks for i in (c[y[c].argmin()], c[y[c].argmax()])}
    kept = sorted({0, *extremes, len(x) - 1})
    return x[kept], y[kept]


def _stroke(x1: float, y1: float, x2: float, y2: float) -> str:
    return f'<path d="M{x1:.1f} {y1:.1f}L{x2:.1f} {y2:.1f}" stroke="#dddddd"/>'


def points_of(px: Scale, py: Scale, x: F64, y: F64) -> str:
    """The `points` of a polyline."""
    return " ".join(f"{px(float(a)):.1f},{py(float(b)):.1f}" for a, b in zip(x, y, strict=True))


def text_element(x: float, y: float, text: str, anchor: str, kind: str = "") -> str:
    """A text at a pixel position, of CSS class `kind`."""
    of = f' class="{kind}"' if kind else ""
    return f'<text{of} x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(text)}</text>'


def _number(value: float) -> str:
    return f"{value:.6g}" if abs(value) > 1e-12 else "0"
