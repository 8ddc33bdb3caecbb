"""Figures that a machine file leaves unknown, fitted to the motion and its force.

Least squares on the force in motion: mass times acceleration, viscous friction, the friction law's
force along that motion per newton of the Coulomb force, and what is fitted but not reported: a
smooth force over position (springs, weight, also of an arm that turns), and friction that changes
over time. Of presliding stiffnesses that are half a decade apart, the one is taken that leaves
least. The figures are start values of the search, which fits them again together with the effects.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.special import eval_legendre

from hil_sim.plant import force_variants
from hil_sim.settings import AxisSettings, StageSettings
from sim2real.fitting import plant_figure, with_figures
from sim2real.open_loop.motion import Motion, smooth_over
from stagedata import F64

FIGURES = {"mass": "kg", "coulomb": "N", "viscous": "N s/m"}
"""Figures that may be unknown, and their units."""
_DRIFT = (1, 2)
"""Degrees of the Legendre polynomials of time in the friction that is fitted but not reported: on
average they are 0."""
_STIFFER = (30.0, 10.0, 3.0, 1.0, 1.0 / 3.0, 0.1, 1.0 / 30.0)
"""Ratios of the presliding stiffnesses that are tried to the one in place of an unknown one. Softer
ones would pass for forces over position."""
_LEAST_MASS = 1e-9
"""Of a plant [kg]."""
_PARTS = 8
"""Parts of the recordings, each left out once, that show how well a mass is known."""
_CERTAIN = 2.0
"""Standard deviations by which a mass must differ from 0."""
_NEGLIGIBLE = 0.1
"""Share of the force that the inertia of a mass, or of its standard deviation if that is larger,
may take where the motion does not show it: any such mass will do."""
_LEAST_FRICTION = 1e-6
"""Lower limit of Coulomb friction, as a share of the rms force: a plant always has some."""


def fit_figures(
    motions: Sequence[Motion],
    settings: StageSettings,
    unknown: Mapping[str, Sequence[str]],
    *,
    is_rough: bool = False,
) -> StageSettings:
    """The settings with unknown figures fitted to the recordings.

    Args:
        motions: of the recordings.
        settings: with any values in their place.
        unknown: axis -> figures; keys of `FIGURES` are found.
        is_rough: the motions are as smooth as the mass in `settings` needs them, which is none of
            the machine: a mass that they do not show is one standard deviation then.

    Raises:
        ValueError: the recordings do not determine a figure; names axis and figure.
    """
    axes = []
    for axis in settings.axes:
        others = tuple(unknown.get(axis.name, ()))
        names = tuple(key for key in FIGURES if key in others)
        open_figures = names or "stiffness" in others
        axes.append(_fit_axis(motions, axis, names, others, is_rough) if open_figures else axis)
    return replace(settings, axes=tuple(axes))


def _fit_axis(
    motions: Sequence[Motion],
    axis: AxisSettings,
    names: Sequence[str],
    others: Sequence[str],
    is_rough: bool,
) -> AxisSettings:
    """The axis with these figures fitted; `others` are all that are unknown."""
    stiffer = _STIFFER if "stiffness" in others else (1.0,)
    fits = [
        _Fit(motions, axis, names, friction) for friction in _friction_alone(motions, axis, stiffer)
    ]
    best = min(range(len(fits)), key=lambda number: fits[number].left)
    figures = dict(zip(names, fits[best].found, strict=False))
    if "mass" in figures:
        measured = all(motion.axes[axis.name].shows_acceleration for motion in motions)
        if is_rough:
            figures["mass"] = max(figures["mass"], fits[best].scatter(), _LEAST_MASS)
        else:
            figures["mass"] = _usable_mass(axis, figures, fits[best], measured)
    least = _LEAST_FRICTION * float(np.std(fits[best].target))
    for key in {"coulomb", "viscous"} & figures.keys():
        figures[key] = max(figures[key], least if key == "coulomb" else 0.0)
    if "stiffness" in others:  # the breakaway distance as it was tried
        before = axis.friction.coulomb
        ratio = stiffer[best] * figures.get("coulomb", before) / before
        figures["stiffness"] = axis.friction.stiffness * ratio
    return with_figures(axis, figures)


def _friction_alone(
    motions: Sequence[Motion], axis: AxisSettings, stiffer: Sequence[float]
) -> list[list[F64]]:
    """Friction without its viscous part, per newton of the Coulomb force, along each motion.

    For each ratio of presliding stiffnesses.
    """
    level = axis.friction.coulomb
    variants = [
        with_figures(
            replace(axis, effects=()),
            {"viscous": 0.0, "stiffness": axis.friction.stiffness * ratio},
        )
        for ratio in stiffer
    ]
    alone = []
    for motion in motions:
        own = motion.axes[axis.name]
        course = (own.position, own.velocity, own.acceleration)
        force = force_variants(motion.period, variants, course, motion.start)
        alone.append((force - axis.mass * own.acceleration[:, None]) / level)
    return [[force[:, number] for force in alone] for number in range(len(stiffer))]


class _Fit:
    """Figures of an axis, fitted to the usable samples of all recordings.

    Args:
        motions: of the recordings.
        axis: with the figures that are known.
        names: of those that are fitted.
        friction: per newton of the Coulomb force along each motion, float64[K] each.

    Attributes:
        target: the force without that of known figures, float64[P] [N].
        found: the figures.
        left: what they leave, squared and summed [N^2].
        acceleration: low-passed, rms, where the mass is fitted [m/s^2].

    Raises:
        ValueError: too few samples.
    """

    def __init__(
        self,
        motions: Sequence[Motion],
        axis: AxisSettings,
        names: Sequence[str],
        friction: Sequence[F64],
    ) -> None:
        reach = max(float(np.abs(m.axes[axis.name].position).max()) for m in motions)
        rows, targets = [], []
        for motion, sliding in zip(motions, friction, strict=True):
            moved = motion.axes[axis.name]
            parts = {"mass": moved.acceleration, "coulomb": sliding, "viscous": moved.velocity}
            low = {
                key: motion.low_pass(axis.name, part)[moved.usable] for key, part in parts.items()
            }
            smooth = smooth_over(moved.position[moved.usable], axis.rotary, reach)
            when = np.linspace(-1.0, 1.0, len(sliding))[moved.usable]
            smooth += [low["coulomb"] * eval_legendre(degree, when) for degree in _DRIFT]
            rows.append(np.column_stack([*(low[key] for key in names), *smooth]))
            known = sum(plant_figure(axis, k) * low[k] for k in FIGURES if k not in names)
            targets.append(moved.force[moved.usable] - known)
        self._columns, self.target = np.concatenate(rows), np.concatenate(targets)
        self.acceleration = float(np.sqrt(np.mean(self._columns[:, 0] ** 2)))
        if len(self.target) <= self._columns.shape[1]:
            raise ValueError(f"axis {axis.name}: too little motion to find {' and '.join(names)}")
        solved = _least_squares(self._columns, self.target)
        self.found = [float(value) for value in solved[: len(names)]]
        self.left = float(np.sum((self.target - self._columns @ solved) ** 2))

    def scatter(self) -> float:
        """Standard deviation of the first figure, by a jackknife."""
        parts = np.array_split(np.arange(len(self.target)), _PARTS)
        without = [
            _least_squares(np.delete(self._columns, p, axis=0), np.delete(self.target, p))[0]
            for p in parts
        ]
        return float(np.std(without)) * math.sqrt(_PARTS - 1)


def _least_squares(columns: F64, target: F64) -> F64:
    size = np.maximum(np.sqrt(np.mean(columns**2, axis=0)), 1e-12)
    return np.asarray(np.linalg.lstsq(columns / size, target, rcond=1e-9)[0] / size)


def _usable_mass(
    axis: AxisSettings, figures: Mapping[str, float], fit: _Fit, measured: bool
) -> float:
    """The mass; its standard deviation where it may as well be none and hardly matters.

    Args:
        axis: with the figures that are known.
        figures: as fitted.
        fit: that found them.
        measured: whether the motion shows its acceleration at all.

    Raises:
        ValueError: it matters and may as well be none.
    """
    mass, sigma = figures["mass"], fit.scatter()
    if mass > _CERTAIN * sigma:
        return mass
    inertia = fit.acceleration * (sigma if mass > -_CERTAIN * sigma else -mass)
    if measured and inertia < _NEGLIGIBLE * float(np.std(fit.target)):
        return max(mass, sigma)
    found = f"axis {axis.name}: the mass is unknown, and its motion"
    size = f"{mass:.3g} ± {sigma:.2g} {axis.unit_of('kg')}"
    if mass < -_CERTAIN * sigma:
        raise ValueError(
            f"{found} takes a force that falls with acceleration ({size}): "
            f"check the force's sign and delay"
        )
    raise ValueError(
        f"{found} does not tell it ({size}): state an estimate in the machine "
        f"file, or record harder accelerations, at a higher rate or with a finer position"
    )
