"""Charts of the gap report as inline SVG: lines, bars, a matrix; coloured by the page's style.

Large type, few lines: they are looked at on a projector. Only what is drawn is computed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from xml.sax.saxutils import escape

import numpy as np
import numpy.typing as npt
from markupsafe import Markup

from stagectl.report.svg import thinned, ticks

FloatArray = npt.NDArray[np.float64]

_LEFT, _RIGHT, _TOP, _BOTTOM = 78, 14, 14, 48
_POINTS = 900
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True, slots=True)
class Curve:
    """A line of a chart.

    Attributes:
        name: for the legend; also its class in the style: measured, before, after, floor.
        x, y: points, float64[n].
    """

    name: str
    x: FloatArray
    y: FloatArray


def chart(
    curves: Sequence[Curve],
    x_label: str,
    y_label: str,
    *,
    width: int = 600,
    height: int = 300,
    logarithmic: bool = False,
    zero: bool = False,
) -> Markup:
    """A line chart.

    Args:
        curves: drawn in order.
        x_label: with unit.
        y_label: with unit.
        width: of the drawing [px]; it scales with the page.
        height: likewise.
        logarithmic: both axes.
        zero: the vertical axis begins at zero.
    """
    shown = [_thinned(c, logarithmic) for c in curves]
    shown = [c for c in shown if len(c.x) > 1]
    if not shown:
        return Markup("<p class='note'>Nothing to draw.</p>")
    scale = np.log10 if logarithmic else np.asarray
    xs = np.concatenate([scale(c.x) for c in shown])
    ys = np.concatenate([scale(c.y) for c in shown])
    low_x, high_x = float(xs.min()), float(xs.max())
    low_y, high_y = (0.0 if zero else float(ys.min())), float(ys.max())
    if high_y <= low_y:
        low_y, high_y = low_y - 1.0, high_y + 1.0
    pad = 0.06 * (high_y - low_y)
    low_y, high_y = (low_y if zero else low_y - pad), high_y + pad
    if high_x <= low_x:
        high_x = low_x + 1.0
    right, bottom = width - _RIGHT, height - _BOTTOM

    def px(x: float) -> float:
        return _LEFT + (x - low_x) / (high_x - low_x) * (right - _LEFT)

    def py(y: float) -> float:
        return bottom - (y - low_y) / (high_y - low_y) * (bottom - _TOP)

    parts = [_open(width, height, f"{y_label} over {x_label}")]
    for x in _marks(low_x, high_x, 7, logarithmic):
        parts.append(f'<path class="grid" d="M{px(x):.1f} {_TOP}V{bottom}"/>')
        parts.append(_text(px(x), bottom + 20, _label(x, logarithmic), "middle"))
    for y in _marks(low_y, high_y, 5, logarithmic):
        parts.append(f'<path class="grid" d="M{_LEFT} {py(y):.1f}H{right}"/>')
        parts.append(_text(_LEFT - 8, py(y) + 5, _label(y, logarithmic), "end"))
    for c in shown:
        points = " ".join(
            f"{px(float(x)):.1f},{py(float(y)):.1f}"
            for x, y in zip(scale(c.x), scale(c.y), strict=True)
        )
        parts.append(f'<polyline class="line {_class(c.name)}" points="{points}"/>')
    parts.append(_text((_LEFT + right) / 2, height - 8, x_label, "middle", "axis"))
    middle = (_TOP + bottom) / 2
    parts.append(
        f'<text class="axis" x="18" y="{middle:.0f}" text-anchor="middle" '
        f'transform="rotate(-90 18 {middle:.0f})">{escape(y_label)}</text>'
    )
    return Markup("".join([*parts, "</svg>"]))  # noqa: S704 - texts are escaped above


def bars(
    names: Sequence[str], groups: Mapping[str, Sequence[float]], y_label: str, width: int = 600
) -> Markup:
    """Upright bars side by side: one group per name, one bar per key of `groups`."""
    height = 300
    right, bottom = width - _RIGHT, height - _BOTTOM
    top = max((v for values in groups.values() for v in values if math.isfinite(v)), default=1.0)
    top = top * 1.06 or 1.0

    def py(y: float) -> float:
        return bottom - y / top * (bottom - _TOP)

    parts = [_open(width, height, y_label)]
    for y in ticks(0.0, top, 5):
        parts.append(f'<path class="grid" d="M{_LEFT} {py(y):.1f}H{right}"/>')
        parts.append(_text(_LEFT - 8, py(y) + 5, f"{y:.3g}", "end"))
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
        parts.append(_text(_LEFT + (n + 0.5) * step, low, name, "middle"))
    middle = (_TOP + bottom) / 2
    parts.append(
        f'<text class="axis" x="18" y="{middle:.0f}" text-anchor="middle" '
        f'transform="rotate(-90 18 {middle:.0f})">{escape(y_label)}</text>'
    )
    return Markup("".join([*parts, "</svg>"]))  # noqa: S704


def matrix(names: Sequence[str], likeness: Mapping[tuple[str, str], float]) -> Markup:
    """How alike effects look, each against each: 0 (told apart) to 1 (the same)."""
    cell, left, top = 64, 210, 150
    size = cell * len(names)
    parts = [_open(left + size + 110, top + size + 10, "likeness of effects", "matrix")]
    for i, name in enumerate(names):
        parts.append(_text(left - 10, top + (i + 0.5) * cell + 6, name, "end"))
        x = left + (i + 0.5) * cell
        parts.append(
            f'<text x="{x:.0f}" y="{top - 10}" text-anchor="start" '
            f'transform="rotate(-45 {x:.0f} {top - 10})">{escape(name)}</text>'
        )
        for j, other in enumerate(names):
            value = 1.0 if i == j else likeness.get((name, other), likeness.get((other, name)))
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
    return Markup("".join([*parts, "</svg>"]))  # noqa: S704


def legend(names: Sequence[str]) -> Markup:
    """What the lines or bars are."""
    keys = "".join(
        f'<span class="entry"><i class="{_class(name)}"></i>{escape(name)}</span>' for name in names
    )
    return Markup(f'<p class="legend">{keys}</p>')  # noqa: S704


def _thinned(curve: Curve, logarithmic: bool) -> Curve:
    """At most so many points; extremes stay. Points that can't be drawn go."""
    x, y = np.asarray(curve.x, dtype=float), np.asarray(curve.y, dtype=float)
    good = np.isfinite(x) & np.isfinite(y)
    if logarithmic:
        good &= (x > 0) & (y > 0)
    return Curve(curve.name, *thinned(x[good], y[good], _POINTS))


def _marks(low: float, high: float, most: int, logarithmic: bool) -> list[float]:
    if not logarithmic:
        return ticks(low, high, most)
    whole = [float(k) for k in range(math.ceil(low), math.floor(high) + 1)]
    return whole if len(whole) <= most + 2 else whole[:: math.ceil(len(whole) / most)]


def _label(value: float, logarithmic: bool) -> str:
    if logarithmic:
        power = round(value)
        return f"{10**power:g}" if -3 <= power <= 3 else "10" + str(power).translate(_SUPERSCRIPT)
    return f"{value:.4g}" if abs(value) > 1e-12 else "0"


def _class(name: str) -> str:
    return name.split()[0].lower()


def _open(width: float, height: float, title: str, kind: str = "chart") -> str:
    return (
        f'<svg class="{kind}" viewBox="0 0 {width:.0f} {height:.0f}" role="img">'
        f"<title>{escape(title)}</title>"
    )


def _text(x: float, y: float, text: str, anchor: str, kind: str = "") -> str:
    of = f' class="{kind}"' if kind else ""
    return f'<text{of} x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(text)}</text>'
