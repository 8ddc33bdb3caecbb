"""The pictures of what a model leaves: over velocity, over the plane, at reversals, by frequency.

Each is drawn from `sim2real.residuals`; if there are no data, a sentence says why.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hil_sim.settings import AxisSettings
from sim2real.residuals import (
    FrequencyResponse,
    ResidualViews,
    ReversalLoop,
    VelocityMeans,
)
from stagectl.report.chart import Chart, Curve
from stagectl.report.gap.traces import Panel
from stagectl.report.heat_map import HeatMap, draw_heat_map, round_limit
from stagedata import F64

_SLOW = 0.12
"""Share of the highest speed that the picture of low speeds shows."""
_FEWEST_SLOW = 3
"""Fewest points per direction for the picture of low speeds."""
_NAMES = {"before": "before", "after": "after the explanation"}


@dataclass(frozen=True, slots=True)
class View:
    """The pictures of one kind for all axes, and a sentence for each that cannot be drawn.

    Attributes:
        panels: with their headings.
        missing: sentences.
    """

    panels: tuple[Panel, ...]
    missing: tuple[str, ...]


def draw_views(views: Sequence[ResidualViews]) -> list[tuple[str, View]]:
    """Key of each section in the template, and its pictures; nothing without views."""
    drawers = {"velocity": velocity, "plane": plane, "reversal": reversal, "response": response}
    return [(key, draw_view(draw, views)) for key, draw in drawers.items()] if views else []


def draw_view(
    draw: Callable[[ResidualViews], Iterable[Panel | str]], views: Sequence[ResidualViews]
) -> View:
    """The pictures that one of the functions below draws of every axis, and its sentences."""
    drawn = [each for of_axis in views for each in draw(of_axis)]
    panels = tuple(each for each in drawn if isinstance(each, Panel))
    return View(panels, tuple(each for each in drawn if isinstance(each, str)))


def velocity(of_axis: ResidualViews) -> Iterator[Panel | str]:
    """Mean residual force over velocity: all speeds, and low ones where the axis has crept."""
    if not of_axis.velocity:
        yield f"Axis {of_axis.axis} did not move long enough at any speed."
        return
    units = of_axis.settings.unit_of("mm/s"), of_axis.settings.unit_of("N")
    yield _velocity_panel(of_axis.velocity, f"Axis {of_axis.axis}: all speeds", units)
    fastest = max(float(np.abs(m.velocity).max()) for m in of_axis.velocity)
    slow = [_slower(means, _SLOW * fastest) for means in of_axis.velocity]
    if all(len(means.velocity) >= _FEWEST_SLOW for means in slow):
        yield _velocity_panel(slow, f"Axis {of_axis.axis}: low speeds", units)


def plane(of_axis: ResidualViews) -> Iterator[Panel | str]:
    """Mean residual force over position and velocity; all pictures of an axis on one scale."""
    if of_axis.plane is None:
        yield f"Axis {of_axis.axis} did not move."
        return
    found = of_axis.plane
    limit = round_limit(found.mean["before"])
    length, speed, force = (of_axis.settings.unit_of(u) for u in ("mm", "mm/s", "N"))
    labels = (f"position [{length}]", f"velocity [{speed}]", force)
    for model, values in found.mean.items():
        title = f"Axis {of_axis.axis}: {_NAMES.get(model, model)}"
        picture = HeatMap(
            1e3 * found.positions, 1e3 * found.velocities, values, (-limit, limit), labels,
            title, is_plane=False, two_inks=True,
        )  # fmt: skip
        yield Panel(title, draw_heat_map(picture))


def reversal(of_axis: ResidualViews) -> Iterator[Panel | str]:
    """Force over position around reversals, measured and simulated."""
    if not of_axis.reversals:
        yield f"Axis {of_axis.axis}: too few samples around reversals."
    for loop in of_axis.reversals:
        way = "forward, then back" if loop.direction > 0 else "backward, then forward"
        turns = f"{loop.turns} reversal{'s' if loop.turns > 1 else ''}"
        title = f"Axis {of_axis.axis}: {way} ({turns})"
        yield Panel(title, _reversal_picture(loop, of_axis.settings))


def response(of_axis: ResidualViews) -> Iterable[Panel | str]:
    """Frequency response from demand to position: magnitude and phase."""
    found = of_axis.response
    if not of_axis.has_demand:
        return [f"Axis {of_axis.axis}: forces are compared along its motion, without a demand."]
    if found is None:
        return [f"Axis {of_axis.axis}: no recording is long enough (2.5 s)."]
    if found.excited.sum() < 2:
        return [
            f"Axis {of_axis.axis}: these moves excite no frequency enough. "
            "stagectl gap excite writes a recipe with chirps, which do."
        ]
    return _response_panels(of_axis.axis, found)


def _slower(means: VelocityMeans, speed: float) -> VelocityMeans:
    """The bins up to a speed."""
    kept = np.abs(means.velocity) <= speed

    def cut(values: Mapping[str, F64]) -> dict[str, F64]:
        return {model: v[kept] for model, v in values.items()}

    return VelocityMeans(
        means.direction, means.velocity[kept], means.samples[kept], means.bins[kept],
        cut(means.mean), cut(means.spread),
    )  # fmt: skip


def _velocity_panel(
    directions: Sequence[VelocityMeans], title: str, units: tuple[str, str]
) -> Panel:
    """`units` are those of 1e-3 of the velocity and of the force."""
    curves = []
    for means in directions:
        velocity = 1e3 * means.velocity
        gaps = np.flatnonzero(np.diff(means.bins) > 1) + 1
        for part in np.split(np.arange(len(velocity)), gaps):
            for model, every in means.mean.items():
                mean, spread = every[part], means.spread[model][part]
                curves.append(Curve(model, velocity[part], mean, mean - spread, mean + spread))
    fastest = max(float(np.abs(c.x).max()) for c in curves)
    zero = Curve("zero", np.array([-fastest, fastest]), np.zeros(2))
    speed, force = units
    label = f"measured \u2212 simulated [{force}]"
    return Panel(title, Chart([zero, *curves], f"velocity [{speed}]", label))


def _reversal_picture(loop: ReversalLoop, axis: AxisSettings) -> Chart:
    curves = []
    for name, approach in loop.approach.items():
        departure = loop.departure.get(name)
        if departure is None:
            continue
        for b in (approach, departure):
            ends = (b.force - b.spread, b.force + b.spread) if name == "measured" else (None, None)
            curves.append(Curve(name, 1e6 * b.place, b.force, *ends))
    position = f"position from the turning point [{axis.unit_of('µm')}]"
    return Chart(curves, position, f"force [{axis.unit_of('N')}]")


def _response_panels(axis: str, response: FrequencyResponse) -> list[Panel]:
    excited, frequency = response.excited, response.frequency
    unknown = _unknown(response)
    magnitudes, phases = [], []
    measured = response.response["measured"]
    reference = np.full(len(frequency), np.nan)
    reference[excited] = np.unwrap(np.angle(measured[excited]))
    for name, values in response.response.items():
        # Unwrap each phase to within half a turn of the measured one.
        phase = reference + np.angle(values / np.where(measured == 0.0, 1.0, measured))
        with np.errstate(divide="ignore"):
            decibels = 20.0 * np.log10(np.abs(values))
        for first, end in _runs(excited):
            cut = slice(first, end)
            magnitudes.append(Curve(name, frequency[cut], decibels[cut]))
            phases.append(Curve(name, frequency[cut], np.degrees(phase[cut])))
    return [
        Panel(
            f"Axis {axis}: {title}",
            Chart(curves, "frequency [Hz]", label, log="x", shaded=unknown),
        )
        for title, curves, label in (
            ("magnitude", magnitudes, "position / demand [dB]"),
            ("phase", phases, "phase [°]"),
        )
    ]


def _runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First number and one past the last of every run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False])).astype(np.int8)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _unknown(response: FrequencyResponse) -> list[tuple[float, float]]:
    """Bands of frequency that are not excited, from midway to midway between two frequencies."""
    f = response.frequency
    middles = np.array([np.sqrt(a * b) for a, b in pairwise(f)])
    edges = np.concatenate((f[:1], middles, f[-1:]))
    return [(float(edges[a]), float(edges[b])) for a, b in _runs(~response.excited)]
