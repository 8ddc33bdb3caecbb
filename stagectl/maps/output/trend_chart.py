"""The trend of one axis at one site as SVG text: points with their 95 % intervals over time."""

from __future__ import annotations

import numpy as np

from stagectl.history import Trend
from stagectl.maps.output.outline import day
from stagectl.report import ticks

_WIDTH, _HEIGHT = 380, 150
_LEFT, _RIGHT, _TOP, _BOTTOM = 44, 8, 22, 22
MOST = 200
"""Points drawn at most, the last ones."""


def draw_trend(trend: Trend, figure: str, title: str, at_map: float | None) -> str:
    """Draw a trend as SVG; "" where no estimate has the figure (long: one shape per line).

    Args:
        trend: of the site.
        figure: to draw.
        title: above the chart.
        at_map: the map's value, drawn as a line; None for none.
    """
    value, sigma, time = (
        trend.values[figure][-MOST:],
        trend.sigma[figure][-MOST:],
        trend.time[-MOST:],
    )
    ok = np.isfinite(value) & np.isfinite(sigma)
    if not ok.any():
        return ""
    value, sigma, time = value[ok], sigma[ok], time[ok]
    low, high = value - 1.96 * sigma, value + 1.96 * sigma
    # A vague first estimate must not flatten all others.
    bottom_value = min(float(np.percentile(low, 5)), float(value.min()), at_map or np.inf)
    top_value = max(float(np.percentile(high, 95)), float(value.max()), at_map or -np.inf)
    pad = 0.05 * (top_value - bottom_value) or 1.0
    y0, y1 = bottom_value - pad, top_value + pad
    t0, t1 = float(time[0]), float(time[-1])
    if t1 <= t0:
        t0, t1 = t0 - 1.0, t1 + 1.0
    left, right, top, bottom = _LEFT, _WIDTH - _RIGHT, _TOP, _HEIGHT - _BOTTOM

    def px(t: float) -> float:
        return left + 4 + (t - t0) / (t1 - t0) * (right - left - 8)

    def py(v: float) -> float:
        return bottom - (min(max(v, y0), y1) - y0) / (y1 - y0) * (bottom - top)

    parts = [
        f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" width="{_WIDTH}" height="{_HEIGHT}" role="img" '
        f'aria-label="{title}" font-size="12" fill="currentColor">',
        f'<text x="{left}" y="14" font-weight="600">{title}</text>',
    ]
    for y in ticks(y0, y1, 4):
        parts.append(
            f'<line x1="{left}" x2="{right}" y1="{py(y):.1f}" y2="{py(y):.1f}" '
            'stroke="currentColor" stroke-opacity="0.15"/>'
            f'<text x="{left - 5}" y="{py(y) + 4:.1f}" text-anchor="end">{y:.4g}</text>'
        )
    if at_map is not None:
        parts.append(
            f'<line x1="{left}" x2="{right}" y1="{py(at_map):.1f}" y2="{py(at_map):.1f}" '
            'stroke="#c0392b" stroke-dasharray="5 3"/>'
        )
    for t, v, a, b in zip(time.tolist(), value.tolist(), low.tolist(), high.tolist(), strict=True):
        parts.append(
            f'<line x1="{px(t):.1f}" x2="{px(t):.1f}" y1="{py(a):.1f}" y2="{py(b):.1f}" '
            'stroke="#2a6fb0" stroke-opacity="0.5"/>'
            f'<circle cx="{px(t):.1f}" cy="{py(v):.1f}" r="2" fill="#2a6fb0"/>'
        )
    first, last = float(time[0]), float(time[-1])
    brief = last - first < 600.0
    parts.append(
        f'<text x="{left}" y="{_HEIGHT - 5}">{day(first, brief)}</text>'
        f'<text x="{right}" y="{_HEIGHT - 5}" text-anchor="end">{day(last, brief)}</text>'
    )
    return "".join([*parts, "</svg>"])
