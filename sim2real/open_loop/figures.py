"""Figures that a machine file leaves unknown, fitted to the motion and its force.

Least squares on the force in motion: mass times acceleration, Coulomb and viscous friction, plus a
smooth force over position that is fitted but not reported (weight, springs). The figures are start
values of the search, which fits them again together with the effects.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hil_sim.settings import AxisSettings, StageSettings
from sim2real.open_loop.motion import Motion

F64 = NDArray[np.float64]

FIGURES = {"mass": "kg", "coulomb": "N", "viscous": "N s/m"}
"""Figures that may be unknown, and their units."""
_POWERS = (0, 1, 2, 3)
"""Powers of position in the smooth force that is fitted but not reported."""
_LEAST_FRICTION = 1e-6
"""Lower limit of Coulomb friction, as a share of the rms force: a plant always has some."""


def fit_figures(
    motions: Sequence[Motion], settings: StageSettings, unknown: Mapping[str, Sequence[str]]
) -> StageSettings:
    """The settings with unknown figures fitted to the recordings.

    Args:
        motions: of the recordings.
        settings: with any values in their place.
        unknown: axis -> figures; keys of `FIGURES` are found.

    Raises:
        ValueError: the recordings do not determine a figure; names axis and figure.
    """
    axes = []
    for axis in settings.axes:
        others = tuple(unknown.get(axis.name, ()))
        names = tuple(key for key in FIGURES if key in others)
        axes.append(_fit_axis(motions, axis, names, others) if names else axis)
    return replace(settings, axes=tuple(axes))


def with_figures(axis: AxisSettings, figures: Mapping[str, float]) -> AxisSettings:
    """The axis with other values of some `FIGURES`."""
    friction = {key: value for key, value in figures.items() if key != "mass"}
    return replace(
        axis,
        mass=figures.get("mass", axis.mass),
        friction=axis.friction.with_figures(friction) if friction else axis.friction,
    )


def _fit_axis(
    motions: Sequence[Motion], axis: AxisSettings, names: Sequence[str], others: Sequence[str]
) -> AxisSettings:
    """The axis with these figures fitted; `others` are all that are unknown."""
    rows, targets = [], []
    reach = max(float(np.abs(m.axes[axis.name].position).max()) for m in motions)
    own = {"mass": axis.mass, "coulomb": axis.friction.coulomb, "viscous": axis.friction.viscous}
    for motion in motions:
        moved = motion.axes[axis.name]
        parts = {
            "mass": moved.acceleration,
            "coulomb": np.sign(moved.velocity),
            "viscous": moved.velocity,
        }
        low = {key: motion.low_pass(axis.name, part)[moved.usable] for key, part in parts.items()}
        place = moved.position[moved.usable] / max(reach, 1e-12)
        rows.append(
            np.column_stack([*(low[key] for key in names), *(place**power for power in _POWERS)])
        )
        known = sum(own[key] * low[key] for key in FIGURES if key not in names)
        targets.append(moved.force[moved.usable] - known)
    matrix, target = np.concatenate(rows), np.concatenate(targets)
    if len(target) <= matrix.shape[1]:
        raise ValueError(f"axis {axis.name}: too little motion to find {' and '.join(names)}")
    size = np.maximum(np.sqrt(np.mean(matrix**2, axis=0)), 1e-12)
    found = np.linalg.lstsq(matrix / size, target, rcond=1e-9)[0] / size
    figures = dict(zip(names, map(float, found), strict=False))
    if figures.get("mass", 1.0) <= 0.0:
        raise ValueError(
            f"axis {axis.name}: the mass is unknown, and its motion takes a force that falls with "
            f"acceleration ({figures['mass']:.3g} kg): check the force's sign and delay"
        )
    least = _LEAST_FRICTION * float(np.std(target))
    for key in {"coulomb", "viscous"} & figures.keys():
        figures[key] = max(figures[key], least if key == "coulomb" else 0.0)
    if (
        "stiffness" in others and "coulomb" in figures
    ):  # also unknown: keep the breakaway distance as before
        figures["stiffness"] = axis.friction.stiffness * figures["coulomb"] / own["coulomb"]
    return with_figures(axis, figures)
