"""What the paper leaves open about move, signals, zones and fit, as the choices of one case."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from stagectl.paper import published

Profile = Literal["sine", "jerk-limited"]
Alignment = Literal["logged", "aligned"]
Initial = Literal["tied", "reference", "measured", "free"]
Bounds = Literal["bounded", "shortened"]

PLANT_RATE = 200_000
"""Steps of the mass per second."""


@dataclass(frozen=True, slots=True)
class Case:
    """One choice of everything.

    Attributes:
        rate: of controller and samples [Hz]; divides 200 kHz.
        profile: of the demand.
        bandwidth: of the closed position loop, |T| = -3 dB [Hz].
        feedforward: whether mass times acceleration of the demand is added to the force.
        noise: of the encoder, rms [m]; seed: of that noise.
        force: as logged, or aligned with the positions.
        cut_off: of the filter [Hz]; None, or half the sample rate and above, for no filter.
        order: of the filter, in each direction.
        filter_force: whether the force goes through the filter too.
        onset: travel at which zone A begins [m]; None: where all elements of the plant slip.
        shift: of the border between the zones against the first v <= 0 [s].
        stick: duration of zone B [s].
        start: first iterate, as `PARAMETERS`.
        initial: total of the element forces where the first window begins: "tied" to S(v0), which
            follows Fc; "reference", S(v0) under the reference values; "measured", u - m a -
            sigma_v v of the first sample; or "free", another unknown per window. Unless free, zone
            B takes zone A's end.
        bounds: how p >= 0 is kept: each step is the minimiser of a "bounded" least-squares problem,
            or the whole Gauss-Newton step is "shortened", halved until it ends above the bound.
        turned: whether zone B's elements stick from its first sample; if not, they slip on until
            the stage moves back.
        slide: unknowns of zone A where there are two windows, as `window.NAMES` counts them.

    Raises:
        ValueError: a figure outside its range, named.
    """

    rate: int = 20_000
    profile: Profile = "sine"
    bandwidth: float = published.BANDWIDTH
    feedforward: bool = False
    noise: float = 0.0
    seed: int = 1
    force: Alignment = "aligned"
    cut_off: float | None = 500.0
    order: int = 2
    filter_force: bool = True
    onset: float | None = None
    shift: float = 0.0
    stick: float = 0.05
    start: tuple[float, ...] = tuple(published.START * v for v in published.REFERENCE.values())
    initial: Initial = "tied"
    bounds: Bounds = "bounded"
    turned: bool = True
    slide: tuple[int, ...] = (0, 1, 2)

    def __post_init__(self) -> None:
        if self.rate < 500 or PLANT_RATE % self.rate:
            raise ValueError(f"rate: must be >= 500 Hz and divide {PLANT_RATE}, is {self.rate}")
        if not 0 < self.bandwidth < self.rate / 2:
            raise ValueError(f"bandwidth: must be 0..rate/2 Hz, is {self.bandwidth}")
        if not self.noise >= 0:
            raise ValueError(f"noise: must be >= 0 m, is {self.noise}")
        if self.cut_off is not None and not self.cut_off > 0:
            raise ValueError(f"cut_off: must be > 0 Hz, is {self.cut_off}")


CASE = Case()
