"""Charts of curves, which uPlot draws from the data beside them (`static/charts.js`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from markupsafe import Markup, escape

from stagectl.report.render import script_json
from stagectl.report.svg import thinned
from stagedata import F64

_POINTS = 900


@dataclass(frozen=True, slots=True)
class Curve:
    """A line of a chart, or points.

    Attributes:
        name: of its colour: measured, before, after, floor, zero, map.
        x, y: float64[n]; what is not finite is left out.
        low, high: ends of a band about the line or of bars at the points, float64[n], or None.
        has_line: whether the points are joined.
    """

    name: str
    x: F64
    y: F64
    low: F64 | None = None
    high: F64 | None = None
    has_line: bool = True


@dataclass(frozen=True, slots=True)
class Chart:
    """A line chart; as part of a template its place and its data.

    Attributes:
        curves: drawn in order.
        x_label, y_label: with unit.
        log: the axes that are logarithmic.
        zero: whether the vertical axis starts at zero.
        shaded: ranges of x about which nothing is known.
        y_range: shown; None for what the curves take.
        is_time: x is in seconds since 1970.
    """

    curves: Sequence[Curve]
    x_label: str
    y_label: str
    log: Literal["", "x", "xy"] = ""
    zero: bool = False
    shaded: Sequence[tuple[float, float]] = ()
    y_range: tuple[float, float] | None = None
    is_time: bool = False

    def __html__(self) -> Markup:
        """The element that the script fills."""
        curves = [c for c in map(self._drawn, self.curves) if c["x"]]
        if not curves:
            return Markup("<p class='note'>Nothing to draw.</p>")
        data = {
            "x": self.x_label, "y": self.y_label, "log": self.log, "zero": self.zero,
            "shaded": self.shaded, "range": self.y_range, "time": self.is_time, "curves": curves,
        }  # fmt: skip
        label = escape(f"{self.y_label} over {self.x_label}")
        return Markup(  # noqa: S704 - escaped
            f'<div class="chart curves" role="img" aria-label="{label}">'
            f'<script type="application/json">{script_json(data)}</script></div>'
        )

    def _drawn(self, curve: Curve) -> dict[str, Any]:
        """A curve as it is drawn: with fewer points but its extremes."""
        x, y = np.asarray(curve.x, dtype=np.float64), np.asarray(curve.y, dtype=np.float64)
        good = np.isfinite(x) & np.isfinite(y)
        good &= ((x > 0) | ("x" not in self.log)) & ((y > 0) | ("y" not in self.log))
        values = {"y": y[good]}
        x = x[good]
        if curve.low is not None and curve.high is not None:
            values |= {"low": curve.low[good], "high": curve.high[good]}
        else:
            x, values["y"] = thinned(x, values["y"], _POINTS)
        return {
            "name": curve.name,
            "line": curve.has_line,
            "x": [float(f"{v:.12g}") if self.is_time else float(f"{v:.6g}") for v in x],
            **{k: [float(f"{v:.5g}") for v in of] for k, of in values.items()},
        }


def legend(*entries: tuple[str, str] | str) -> Markup:
    """The legend of charts: names of curves, with other words where given."""
    keys = "".join(
        Markup('<span class="entry"><i class="{}"></i>{}</span>').format(*entry)
        for entry in ((e, e) if isinstance(e, str) else e for e in entries)
    )
    return Markup('<p class="legend">{}</p>').format(Markup(keys))  # noqa: S704 - escaped
