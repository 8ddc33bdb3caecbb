"""Settings of an axis' estimator, and what the kernels take of them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from estimation.online.belief.belief import (
    COULOMB,
    FIGURES,
    FRICTION_FIGURES,
    LAG,
    LEVEL,
    MASS,
    RATE,
    SCATTERING,
    STIFFNESS,
    VISCOUS,
    BeliefSettings,
)
from stagedata import FrictionFigures

BOUNDS = 0.05, 20.0
"""Lowest and highest value of each figure, relative to the start model."""
_ZONE_A = (COULOMB, VISCOUS, MASS)
_ZONE_B = (COULOMB, VISCOUS, STIFFNESS, RATE, MASS)
_ZONE_AB = (COULOMB, VISCOUS, STIFFNESS, MASS)  # a fast move hardly determines C; slow ones do
_REQUESTS = {"relaxation_rate", "static_ratio", "lag"}


USUAL, SHORT, CALM = range(3)
"""Kinds of moves, for which figures are solved for: those that go far; those that do not, which say
nothing of C/Fc; those that settle at once, which say nothing of sigma0."""


AXIS = np.dtype(
    [
        ("period", np.float64),
        ("position_noise", np.float64),
        ("force_noise", np.float64),
        ("model_error", np.float64),
        ("usual_error", np.float64),  # of the settings; `model_error` grows where moves show more
        ("wander", np.float64),
        ("usual_wander", np.float64),  # of the machine file; `wander` grows where moves show more
        ("correlation_time", np.float64),
        ("unmodelled", np.float64),  # rms of the unmodelled force, as the moves so far show it
        ("unmodelled_length", np.float64),
        ("scatter", np.float64, (LEVEL,)),  # rms of each figure from move to move, relative
        ("excess", np.float64),  # rms of what acts beside the model, over the Coulomb force
        ("peak_force", np.float64),
        ("misfit", np.float64),
        ("scale", np.float64, (LEVEL,)),  # mean square of normalised innovations so far
        ("usual_misfit", np.float64),  # of this axis' moves so far
        ("unit", np.float64, (LEVEL,)),  # what the figures are relative to
        ("lower", np.float64, (LEVEL,)),  # bounds of the figures
        ("upper", np.float64, (LEVEL,)),
        ("drift", np.float64, (LEVEL,)),  # sigma by which each changes from move to move
        ("consider", np.int8, (LEVEL,)),  # figures that stay, but count in sigma
        ("masks", np.int8, (3, 3, LEVEL)),  # figures to solve for: kind of move, zones A, B, both
    ]
)
"""Settings of an axis as the kernels take them: a record, with the names of `EstimatorSettings`."""


@dataclass(frozen=True, slots=True)
class EstimatorSettings:
    """How an axis is estimated.

    Attributes:
        mass: moved mass [kg].
        period: of the samples [s].
        position_noise: rms of a sampled position, encoder increment included [m].
        force_noise: rms of a sampled force, its resolution included [N].
        peak_force: samples at or beyond it are saturated and left out [N].
        model_error: rms of what the model itself misses, relative to the Coulomb force.
        belief: start and ageing of what is believed.
        misfit: largest rms of the whitened residual that is accepted.
        fixed: figures that are never estimated, of `FIGURES`.
        request: figures to estimate in every move beside the usual ones: relaxation_rate (that is
            C; else from moves without zone A only), static_ratio (alpha), lag.
        consider: figures that stay as they are, but whose uncertainty counts in that of the others
            (Schmidt's consider parameters): static_ratio, or none.
    """

    mass: float
    period: float
    position_noise: float
    force_noise: float
    peak_force: float = math.inf
    model_error: float = 0.01
    belief: BeliefSettings = field(default_factory=BeliefSettings)
    misfit: float = 4.5
    fixed: tuple[str, ...] = ()
    request: tuple[str, ...] = ()
    consider: tuple[str, ...] = ()

    def axis(self, friction: FrictionFigures, frozen: bool = False) -> np.void:
        """What the kernels take of these settings, a record of `AXIS`.

        Args:
            friction: model that the relative figures are relative to.
            frozen: the friction figures are never estimated.

        Raises:
            ValueError: a name that is not one of `FIGURES`.
        """
        unit = [
            friction.coulomb, friction.viscous, friction.stiffness, friction.relaxation_rate,
            self.mass, 1.0, 1.0,
        ]  # fmt: skip
        usual = self._masks(friction, frozen)
        masks = np.stack([usual, usual, usual])
        masks[SHORT, :, RATE] = False
        masks[CALM][:, [STIFFNESS, RATE]] = False
        belief = self.belief
        own = {n: getattr(self, n, getattr(belief, n, 0.0)) for n in AXIS.names or ()}
        own |= {
            "usual_error": self.model_error,
            "wander": belief.level,
            "usual_wander": belief.wander,
            "scatter": [belief.scatter * (name in SCATTERING) for name in FIGURES],
            "scale": np.ones(LEVEL),
            "usual_misfit": math.inf,
            "unit": unit,
            "lower": [BOUNDS[0]] * 5 + [-0.9, -1.5],
            "upper": [BOUNDS[1]] * 5 + [5.0, 1.5],
            "consider": np.isin(FIGURES, self.consider),
            "masks": masks,
        }
        made: np.void = np.array([tuple(own.values())], AXIS)[0]
        return made

    def _masks(self, friction: FrictionFigures, frozen: bool) -> NDArray[np.bool_]:
        """Figures to solve for in zone A, without it, and with both, shape (3, LEVEL)."""
        for name in (*self.fixed, *self.request, *self.consider):
            if name not in FIGURES:
                raise ValueError(f"{name}: no such figure; there are {', '.join(FIGURES)}")
        fixed = {FIGURES.index(name) for name in self.fixed}
        fixed |= {
            FIGURES.index(name) for name in FRICTION_FIGURES if frozen or not friction.has(name)
        }
        if frozen:
            fixed.add(LAG)
        asked = {*self.request, *self.consider} & _REQUESTS
        wanted = {FIGURES.index(name) for name in asked}
        masks = np.zeros((3, LEVEL), dtype=np.bool_)
        zones = (
            {*_ZONE_A, *(wanted & {LAG})}, {*_ZONE_B, *wanted}, {*_ZONE_AB, *wanted},
        )  # fmt: skip
        for row, zone in enumerate(zones):
            masks[row, sorted(zone - fixed)] = True
        return masks
