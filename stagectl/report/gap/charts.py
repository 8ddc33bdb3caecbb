"""Charts of the gap report as inline SVG, coloured by the page's style: lines, bars, a matrix.

Large type and few lines, to be readable on a projector.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal
from xml.sax.saxutils import escape

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from stagectl.report.svg import Scale, points_of, text_element, thinned, ticks

F64 = NDArray[np.float64]

_WIDTH, _HEIGHT = 600, 300
"""Of a chart before it is scaled to the page [px]."""
_LEFT, _RIGHT, _TOP, _BOTTOM = 78, 14, 14, 48
_POINTS = 900
_FEW_DECADES = 2.7
"""Decades of a logarithmic axis from which on only powers of ten are marked."""
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True, slots=True)
class Curve:
    """A line of a chart.

    Attributes:
        name: in the legend, and CSS class: measured, before, after, floor.
        x, y: points, float64[n].
    """

    name: str
    x: F64
    y: F64


@dataclass(frozen=True, slots=True)
class Band:
    """A shaded range of y over x, behind the curves.

    Attributes:
        name: CSS class, as of a curve.
        x, low, high: points, float64[n].
    """

    name: str
    x: F64
    low: F64
    high: F64


def chart(
    curves: Sequence[Curve],
    x_label: str,
    y_label: str,
    *,
    log: Literal["", "x", "xy"] = "",
    zero: bool = False,
    bands: Sequence[Band] = (),
    shaded: Sequence[tuple[float, float]] = (),
) -> Markup:
    """A line chart.

    Args:
        curves: drawn in order.
        x_label: with unit.
        y_label: with unit.
        log: the axes that are logarithmic.
        zero: whether the vertical axis starts at zero.
        bands: behind the curves.
        shaded: ranges of x about which nothing is known.
    """
    log_x, log_y = "x" in log, "y" in log
    shown = [_thinned(c, log_x, log_y) for c in curves]
    shown = [c for c in shown if len(c.x)]
    if not shown:
        return Markup("<p class='note'>Nothing to draw.</p>")
    right, bottom = _WIDTH - _RIGHT, _HEIGHT - _BOTTOM
    low_x, high_x = _range([c.x for c in shown] + [np.array(ends) for ends in _logs(shaded, log_x)])
    px = Scale(low_x, high_x if high_x > low_x else low_x + 1.0, _LEFT, right)
    heights = [c.y for c in shown] + [end for band in bands for end in (band.low, band.high)]
    py = Scale(*_padded(*_range(heights), zero), bottom, _TOP)
    parts = [_open(_WIDTH, _HEIGHT, f"{y_label} over {x_label}")]
    for first, last in _logs(shaded, log_x):
        parts.append(
            f'<rect class="unknown" x="{px(first):.1f}" y="{_TOP}" '
            f'width="{px(last) - px(first):.1f}" height="{bottom - _TOP}"/>'
        )
    for x in _marks(px, 7, log_x):
        parts.append(f'<path class="grid" d="M{px(x):.1f} {_TOP}V{bottom}"/>')
        parts.append(text_element(px(x), bottom + 20, _label(x, log_x), "middle"))
    for y in _marks(py, 5, log_y):
        parts += _horizontal(py(y), right, _label(y, log_y))
    for band in bands:
        ends = np.concatenate((band.low, band.high[::-1]))
        points = points_of(px, py, np.concatenate((band.x, band.x[::-1])), ends)
        parts.append(f'<polygon class="band {_class(band.name)}" points="{points}"/>')
    for c in shown:
        points = points_of(px, py, c.x, c.y)
        if len(c.x) == 1:
            centre = f'cx="{px(float(c.x[0])):.1f}" cy="{py(float(c.y[0])):.1f}"'
            parts.append(f'<circle class="point {_class(c.name)}" {centre} r="3"/>')
            continue
        parts.append(f'<polyline class="line {_class(c.name)}" points="{points}"/>')
    parts.append(text_element((_LEFT + right) / 2, _HEIGHT - 8, x_label, "middle", "axis"))
    return _closed([*parts, _y_title(y_label, bottom)])


def bars(names: Sequence[str], groups: Mapping[str, Sequence[float]], y_label: str) -> Markup:
    """A bar chart: one group of bars per name, in it one bar per key of `groups`."""
    right, bottom = _WIDTH - _RIGHT, _HEIGHT - _BOTTOM
    top = max((v for values in groups.values() for v in values if math.isfinite(v)), default=1.0)
    top = top * 1.06 or 1.0
    py = Scale(0.0, top, bottom, _TOP)
    parts = [_open(_WIDTH, _HEIGHT, y_label)]
    for y in ticks(0.0, top, 5):
        parts += _horizontal(py(y), right, f"{y:.3g}")
    step = (right - _LEFT) / max(len(names), 1)
    wide = 0.76 * step / max(len(groups), 1)
    for n, name in enumerate(names):
        start = _LEFT + n * step + 0.12 * step
        for g, (group, values) in enumerate(groups.items()):
            if not math.isfinite(values[n]):
                continue
            y = py(values[n])
            parts.append(
                f'<rect class="bar {_class(group)}" x="{start + g * wide:.1f}" y="{y:.1f}" '
                f'width="{wide:.1f}" height="{bottom - y:.1f}"/>'
            )
        low = bottom + (20 if n % 2 == 0 or len(names) < 6 else 38)
        parts.append(text_element(_LEFT + (n + 0.5) * step, low, name, "middle"))
    return _closed([*parts, _y_title(y_label, bottom)])


def matrix(names: Sequence[str], similarity: Mapping[tuple[str, str], float]) -> Markup:
    """The similarity of effects, each against each: 0 (distinguishable) to 1 (identical)."""
    cell, left, top = 64, 210, 150
    size = cell * len(names)
    parts = [_open(left + size + 110, top + size + 10, "similarity of effects", "matrix")]
    for i, name in enumerate(names):
        parts.append(text_element(left - 10, top + (i + 0.5) * cell + 6, name, "end"))
        x = left + (i + 0.5) * cell
        parts.append(
            f'<text x="{x:.0f}" y="{top - 10}" text-anchor="start" '
            f'transform="rotate(-45 {x:.0f} {top - 10})">{escape(name)}</text>'
        )
        for j, other in enumerate(names):
            value = 1.0 if i == j else similarity.get((name, other), similarity.get((other, name)))
            place = f'x="{left + j * cell}" y="{top + i * cell}"'
            box = f'{place} width="{cell - 2}" height="{cell - 2}"'
            if value is None:
                parts.append(f'<rect class="none" {box}/>')
                continue
            parts.append(f'<rect class="heat" {box} fill-opacity="{0.06 + 0.94 * value:.2f}"/>')
            dark = ' class="on"' if value > 0.55 else ""
            parts.append(
                f'<text{dark} x="{left + (j + 0.5) * cell - 1:.0f}" '
                f'y="{top + (i + 0.5) * cell + 6:.0f}" text-anchor="middle">{value:.2f}</text>'
            )
    return _closed(parts)


def legend(names: Sequence[str]) -> Markup:
    """The legend of lines or bars."""
    keys = "".join(
        f'<span class="entry"><i class="{_class(name)}"></i>{escape(name)}</span>' for name in names
    )
    return Markup(f'<p class="legend">{keys}</p>')  # noqa: S704


def _thinned(curve: Curve, log_x: bool, log_y: bool) -> Curve:
    """A curve as it is drawn: with fewer points but its extremes, logarithms where they are drawn.

    Points that cannot be drawn are left out.
    """
    x, y = np.asarray(curve.x, dtype=float), np.asarray(curve.y, dtype=float)
    good = np.isfinite(x) & np.isfinite(y)
    good &= ((x > 0) | (not log_x)) & ((y > 0) | (not log_y))
    x, y = thinned(x[good], y[good], _POINTS)
    return Curve(curve.name, np.log10(x) if log_x else x, np.log10(y) if log_y else y)


def _logs(ranges: Sequence[tuple[float, float]], log: bool) -> list[tuple[float, float]]:
    return [(math.log10(a), math.log10(b)) if log else (a, b) for a, b in ranges]


def _range(values: Sequence[F64]) -> tuple[float, float]:
    return min(float(v.min()) for v in values), max(float(v.max()) for v in values)


def _padded(low: float, high: float, zero: bool) -> tuple[float, float]:
    """A range with a margin for the vertical axis, starting at zero if asked for."""
    low = 0.0 if zero else low
    if high <= low:
        low, high = low - 1.0, high + 1.0
    pad = 0.06 * (high - low)
    return low if zero else low - pad, high + pad


def _marks(scale: Scale, most: int, logarithmic: bool) -> list[float]:
    """Where an axis has grid lines; on a logarithmic one at powers of ten, or at 1, 2 and 5."""
    if not logarithmic:
        return ticks(scale.low, scale.high, most)
    decades = range(math.floor(scale.low), math.ceil(scale.high) + 1)
    if scale.high - scale.low < _FEW_DECADES:
        fine = [k + math.log10(digit) for k in decades for digit in (1, 2, 5)]
        return [mark for mark in fine if scale.low - 1e-9 <= mark <= scale.high + 1e-9]
    whole = [float(k) for k in decades if scale.low <= k <= scale.high]
    return whole if len(whole) <= most + 2 else whole[:: math.ceil(len(whole) / most)]


def _label(value: float, logarithmic: bool) -> str:
    if logarithmic:
        power = math.floor(value + 1e-9)
        if -3 <= power <= 3:
            return f"{10**value:.3g}"
        digit = round(10 ** (value - power))
        whole = "10" + str(power).translate(_SUPERSCRIPT)
        return whole if digit == 1 else f"{digit}·{whole}"
    return f"{value:.4g}" if abs(value) > 1e-12 else "0"


def _class(name: str) -> str:
    return name.split()[0].lower()


def _open(width: float, height: float, title: str, kind: str = "chart") -> str:
    return (
        f'<svg class="{kind}" viewBox="0 0 {width:.0f} {height:.0f}" role="img">'
        f"<title>{escape(title)}</title>"
    )


def _horizontal(y: float, right: float, label: str) -> list[str]:
    """A horizontal grid line with its label."""
    return [
        f'<path class="grid" d="M{_LEFT} {y:.1f}H{right}"/>',
        text_element(_LEFT - 8, y + 5, label, "end"),
    ]


def _y_title(label: str, bottom: float) -> str:
    middle = (_TOP + bottom) / 2
    return (
        f'<text class="axis" x="18" y="{middle:.0f}" text-anchor="middle" '
        f'transform="rotate(-90 18 {middle:.0f})">{escape(label)}</text>'
    )


def _closed(parts: Sequence[str]) -> Markup:
    return Markup("".join([*parts, "</svg>"]))  # noqa: S704 - all texts are escaped
