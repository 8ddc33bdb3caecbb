"""Pictures as SVG text: panels of lines for documents, and heat maps, in frames with ticks.

Curves of pages are drawn by uPlot (`chart`); these are for what it cannot draw or has no script.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from xml.sax.saxutils import escape

import numpy as np

from stagedata import F64

_MOST_POINTS = 800
_LETTER = 5.8
"""Approximate width of a letter [px]."""
_FONT = 'font-family="Helvetica, Arial, sans-serif" font-size="12" fill="currentColor"'


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

    @property
    def style(self) -> str:
        """Attributes of its stroke."""
        dash = ' stroke-dasharray="5 4"' if self.dashed else ""
        return f'stroke="{self.colour}" stroke-width="1.4"{dash}'


@dataclass(frozen=True, slots=True)
class Span:
    """A shaded range of x with a label at its top."""

    first: float
    last: float
    label: str
    colour: str


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
class Frame:
    """A pair of axes.

    Attributes:
        x, y: from values to pixels; the frame is between their ends.
        x_label, y_label: with units.
        title: above.
    """

    x: Scale
    y: Scale
    x_label: str
    y_label: str
    title: str = ""

    def draw(self, inside: Sequence[str], *, grid: bool) -> list[str]:
        """Ticks and labels around what is inside, with lines at the ticks behind it or none."""
        left, right, bottom, top = self.x.first, self.x.last, self.y.first, self.y.last
        lines, labels = [], []
        for x in ticks(self.x.low, self.x.high):
            lines.append(f"M{self.x(x):.1f} {top:.1f}V{bottom:.1f}")
            labels.append(text(self.x(x), bottom + 16, _number(x), "middle"))
        for y in ticks(self.y.low, self.y.high, 5):
            lines.append(f"M{left:.1f} {self.y(y):.1f}H{right:.1f}")
            labels.append(text(left - 6, self.y(y) + 4, _number(y), "end"))
        drawn = f'<path d="{"".join(lines)}" stroke="currentColor" stroke-opacity="0.15"/>'
        middle, across = (top + bottom) / 2, left - 44
        return [
            *([drawn] if grid else []),
            *inside,
            f'<rect x="{left:.1f}" y="{top:.1f}" width="{right - left:.1f}" '
            f'height="{bottom - top:.1f}" fill="none" stroke="currentColor" stroke-opacity="0.6"/>',
            *labels,
            text((left + right) / 2, bottom + 32, self.x_label, "middle"),
            f'<text x="{across:.1f}" y="{middle:.1f}" text-anchor="middle" '
            f'transform="rotate(-90 {across:.1f} {middle:.1f})">{escape(self.y_label)}</text>',
            text(left, top - 8, self.title, "start") if self.title else "",
        ]


def picture(parts: Sequence[str], width: float, height: float, title: str, paper: str = "") -> str:
    """An SVG element, on paper of a colour or none; the title is for screen readers."""
    ground = f'<rect width="100%" height="100%" fill="{paper}"/>' if paper else ""
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}" '
        f'viewBox="0 0 {width:.0f} {height:.0f}" role="img" {_FONT}>'
        f"<title>{escape(title)}</title>{ground}{''.join(parts)}</svg>"
    )


def draw(rows: Sequence[Sequence[Panel]], width: int, height: int, title: str) -> str:
    """A figure of panels in rows, each `height` pixels high.

    Args:
        rows: panels, top to bottom, left to right.
        width: of the whole [px].
        height: of a row [px].
        title: read by screen readers.
    """
    parts = []
    for r, row in enumerate(rows):
        each = width / len(row)
        for c, panel in enumerate(row):
            parts += _panel(panel, c * each, r * height, each, height)
    return picture(parts, width, height * len(rows), title, "#ffffff") + "\n"


def _panel(panel: Panel, x0: float, y0: float, width: float, height: float) -> list[str]:
    low, high = _range([line.x for line in panel.lines], 0.0)
    x = Scale(low, high, x0 + 62, x0 + width - 12)
    y = Scale(*_range([line.y for line in panel.lines], 0.06), y0 + height - 38, y0 + 24)
    inside = []
    for span in panel.spans:
        first, last = (x(min(max(end, low), high)) for end in (span.first, span.last))
        inside.append(
            f'<rect x="{first:.1f}" y="{y.last:.1f}" width="{last - first:.1f}" '
            f'height="{y.first - y.last:.1f}" fill="{span.colour}"/>'
            + text((first + last) / 2, y.last - 5, span.label, "middle")
        )
    for line in panel.lines:
        places = zip(*(v.tolist() for v in thinned(line.x, line.y, _MOST_POINTS)), strict=True)
        points = " ".join(f"{x(a):.1f},{y(b):.1f}" for a, b in places)
        inside.append(f'<polyline points="{points}" fill="none" {line.style}/>')
    end = x.last
    for line in reversed([line for line in panel.lines if line.label]):
        start = end - _LETTER * len(line.label)
        inside.append(
            f'<path d="M{start - 24:.1f} {y.last - 9:.1f}h20" {line.style}/>'
            + text(start, y.last - 5, line.label, "start")
        )
        end = start - 36
    return Frame(x, y, panel.x_label, panel.y_label, panel.title).draw(inside, grid=True)


def ticks(low: float, high: float, most: int = 6) -> list[float]:
    """Round numbers within low..high, in steps of 1, 2 or 5 times a power of ten."""
    if not high > low:
        return [low]
    raw = (high - low) / most
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(m * power for m in (1, 2, 5, 10) if m * power >= raw * (1 - 1e-9))
    first = math.ceil(low / step - 1e-9)
    return [k * step for k in range(first, math.floor(high / step + 1e-9) + 1)]


def thinned(x: F64, y: F64, most: int) -> tuple[F64, F64]:
    """About `most` points of a curve: its ends, and the extremes of each part between them."""
    if len(x) <= most:
        return x, y
    chunks = np.array_split(np.arange(len(x)), most // 2)
    extremes = {int(i) for c in chunks for i in (c[y[c].argmin()], c[y[c].argmax()])}
    kept = sorted({0, *extremes, len(x) - 1})
    return x[kept], y[kept]


def _range(values: list[F64], margin: float) -> tuple[float, float]:
    low = min(float(v.min()) for v in values)
    high = max(float(v.max()) for v in values)
    if high == low:
        return low - 1.0, high + 1.0
    return low - margin * (high - low), high + margin * (high - low)


def text(x: float, y: float, words: str, anchor: str) -> str:
    """A text at a pixel position."""
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(words)}</text>'


def _number(value: float) -> str:
    return f"{value:.6g}" if abs(value) > 1e-12 else "0"
