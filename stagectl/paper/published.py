"""What the paper states: the system of its section IV, Tables I and II, and the claims."""

from __future__ import annotations

from dataclasses import dataclass

PARAMETERS = ("coulomb", "attraction", "viscous", "stiffness")
"""Fc [N], C [N/s], sigma_v [N s/m], sigma0 [N/m]; in this order wherever arrays hold them."""

SYMBOLS = dict(zip(PARAMETERS, ("Fc", "C", "sigma_v", "sigma0"), strict=True))
REFERENCE = {"coulomb": 2.0, "attraction": 4.0, "viscous": 1.0, "stiffness": 1000.0}
START = 0.5
"""The estimate begins at this share of the reference values."""

MASS = 1.0
"""Of the axis [kg]."""
STATIC_RATIO = 0.5
"""alpha = (Fs - Fc)/Fc."""
STRIBECK_VELOCITY = 1e-3
"""vs [m/s]."""
STRIBECK_SHAPE = 1.0
"""delta_vs."""
PLANT_ELEMENTS = 16
MODEL_ELEMENTS = 4

DISTANCE = 25e-3
"""Of the move [m]."""
VELOCITY = 0.5
"""Largest velocity [m/s]; 25 mm at 3 m/s^2 never reach it."""
ACCELERATION = 3.0
"""Largest acceleration [m/s^2]."""
BANDWIDTH = 100.0
"""Of the position loop, closed [Hz]."""


@dataclass(frozen=True, slots=True)
class Printed:
    """A column of the paper's tables.

    Attributes:
        value, sigma: estimate and standard deviation, by parameter, in the units of `PARAMETERS`.
        mse: mean squared force residual over all windows [N^2].
        iterations, evaluations: of the solver, zone A and B in turn where there are two.
    """

    value: dict[str, float]
    sigma: dict[str, float]
    mse: float
    iterations: tuple[int, ...]
    evaluations: tuple[int, ...]


TABLES = {
    "one_window": Printed(
        {"coulomb": 1.97, "attraction": 2.36, "viscous": 0.97, "stiffness": 920.0},
        {"coulomb": 0.03, "attraction": 5.3, "viscous": 0.02, "stiffness": 30.0},
        3.5e-7,
        (13,),
        (78,),
    ),
    "two_windows": Printed(
        {"coulomb": 1.99, "attraction": 2.86, "viscous": 1.01, "stiffness": 980.0},
        {"coulomb": 0.02, "attraction": 2.7, "viscous": 0.01, "stiffness": 5.0},
        1.7e-7,
        (3, 4),
        (15, 12),
    ),
}

CLAIMS = (
    "Two windows give estimates nearer the reference, with smaller deviations, than one.",
    "MSE(u) halves with two windows.",
    "Two windows need about three times fewer evaluations.",
    "C is hard to identify from one motion; alpha can be updated on-line.",
    "The start of zone B is not critical, even where elements still slip.",
    "Fc, C and sigma_v are robust to a wrong sigma0; sigma0 is not robust to wrong Fc, C, sigma_v.",
)
