"""All views of one axis, and their JSON (docs/formats/gap-report.md, `residuals`)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hil_sim.settings import AxisSettings, StageSettings
from sim2real.gap import Measured, Signals
from sim2real.residuals.course import gather_course
from sim2real.residuals.plane import ResidualPlane, average_over_plane
from sim2real.residuals.response import FrequencyResponse, estimate_response
from sim2real.residuals.reversal import Branch, ReversalLoop, average_reversals
from sim2real.residuals.velocity import VelocityMeans, average_over_velocity

Json = dict[str, Any]
_DIGITS = 4
"""Significant digits of figures in the JSON."""


@dataclass(frozen=True, slots=True, eq=False)
class ResidualViews:
    """What a model leaves on one axis, and what it leaves with the causes found.

    Attributes:
        axis: its name.
        settings: of the machine file.
        has_demand: whether positions follow a demand in the comparison, not forces a motion.
        velocity: mean residual force over velocity, by direction; empty without motion.
        plane: over position and velocity; None without motion.
        response: demand to position; None where it cannot be estimated.
        reversals: forces around turns; empty where there are none.
    """

    axis: str
    settings: AxisSettings
    has_demand: bool
    velocity: tuple[VelocityMeans, ...]
    plane: ResidualPlane | None
    response: FrequencyResponse | None
    reversals: tuple[ReversalLoop, ...]

    def to_json(self) -> Json:
        """The entry of `residuals`."""
        return {
            "over_velocity": [_velocity_json(means) for means in self.velocity],
            "response": None if self.response is None else _response_json(self.response),
            "reversals": [_reversal_json(loop) for loop in self.reversals],
        }


def view_residuals(
    measured: Sequence[Measured],
    explained: Sequence[Signals] | None,
    settings: StageSettings,
) -> dict[str, ResidualViews]:
    """The views of all axes, by name; none where nothing was measured.

    Args:
        measured: gap of each recording.
        explained: signals of the model with the causes, per recording; None without causes.
        settings: of the machine file.
    """
    if not measured:
        return {}
    ratio = settings.control_period / settings.sync_period
    views = {}
    for axis in settings.axes:
        course = gather_course(measured, explained, axis.name, ratio)
        views[axis.name] = ResidualViews(
            axis.name,
            axis,
            course.demand is not None,
            average_over_velocity(course),
            average_over_plane(course),
            estimate_response(course),
            average_reversals(course, axis.mass),
        )
    return views


def residuals_json(views: Mapping[str, ResidualViews]) -> Json:
    """The key `residuals` of a report, by axis."""
    return {"residuals": {axis: view.to_json() for axis, view in views.items()}}


def _velocity_json(means: VelocityMeans) -> Json:
    return {
        "direction": means.direction,
        "velocity": _numbers(means.velocity),
        "samples": [int(n) for n in means.samples],
        "mean": _by_model(means.mean),
        "spread": _by_model(means.spread),
    }


def _response_json(response: FrequencyResponse) -> Json:
    return {
        "frequency": _numbers(response.frequency),
        "magnitude": _by_model({name: np.abs(h) for name, h in response.response.items()}),
        "phase": _by_model({name: np.angle(h) for name, h in response.response.items()}),
        "coherence": _numbers(response.coherence),
        "excited": [bool(known) for known in response.excited],
    }


def _reversal_json(loop: ReversalLoop) -> Json:
    def sides(branches: Mapping[str, Branch]) -> Json:
        return {
            name: {
                "position": _numbers(branch.place),
                "force": _numbers(branch.force),
                "spread": _numbers(branch.spread),
            }
            for name, branch in branches.items()
        }

    return {
        "direction": loop.direction,
        "turns": loop.turns,
        "approach": sides(loop.approach),
        "departure": sides(loop.departure),
    }


def _by_model(values: Mapping[str, Iterable[float]]) -> Json:
    return {model: _numbers(numbers) for model, numbers in values.items()}


def _numbers(values: Iterable[float]) -> list[float | None]:
    """Plain numbers of few digits; null for what is not finite."""
    return [float(f"{v:.{_DIGITS}g}") if math.isfinite(v) else None for v in values]
