"""Which deviation of the controller or its channels explains the logged force.

Each hypothesis frees one timing and one gain, or neither, in the law
(`sim2real.audit.controller_law`). The simplest hypothesis is accepted that leaves hardly more than
the law leaves on the model's own noisy run. A lag of the force behind the law may be the stage's
(dead time, current loop), the log's, or both. The mechanics tell them apart: a force that was
logged late also lags behind the measured acceleration.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize, minimize_scalar

from sim2real.audit.controller_law import AS_STATED, TERMS, WARM_UP, ControllerLaw, Timing
from stagedata import FloatArray

ACCEPTED = 1.5
"""A hypothesis holds where its remainder is at most this many times that of the model's own run."""
_NEARLY = 2.5
"""As `ACCEPTED`, for one freed figure against two: interpolated logs deviate a little."""
_SEARCHED = 1200
_SLIP = 1e-6
"""Scales the columns of position errors to the size of forces."""
_BETTER = 0.98
"""A hypothesis must leave less than this share of a simpler one's remainder."""
_SHIFTS = np.arange(-5e-3, 5.01e-3, 2e-4)
"""Finer than half a SYNC period: the demanded velocity steps at each SYNC, so the remainder has one
minimum per period."""
_DRIFTS = np.concatenate((-np.geomspace(3e-6, 3e-3, 12)[::-1], np.geomspace(3e-6, 3e-3, 12)))
_GRIDS = {
    "lag": _SHIFTS,
    "bandwidth": np.geomspace(20.0, 5000.0, 16),
    "resampled": _SHIFTS,
    "position": _SHIFTS,
    "demand": _SHIFTS,
    "drift": _DRIFTS,
}
"""Timing -> values that are tried [s; bandwidth: Hz; drift: s/s]."""
_SHARED = 9
"""Ways to share a lag between dead time and current loop that are tried."""
_FAR = 0.05
"""Longest lag of a force that is looked for, either way [s]."""
_CLEARLY = 0.5
"""Largest share of what is left of the force without a lag that a far one may leave."""
_ONE = np.eye(len(TERMS))
_FREED = {
    "": _ONE[:, :0],
    "scale": np.ones((len(TERMS), 1)),
    **{term: _ONE[:, i : i + 1] for i, term in enumerate(TERMS)},
    "all": _ONE,
}
"""What may be free in the law (nothing, one common factor, one part, every part): float64[4, n],
the parts of each free factor."""
GAINS = tuple(_FREED)
_ROUGH, _ROUGH_STEPS = 0.02, 21
"""Uncertainty of a scale that was found in motion, and the factors tried within it."""
_MOVING = 0.02
"""Speed above which friction is simple enough for inertia to be fitted [m/s]."""
_WHOLE = 0.02
"""Distance from a whole number of samples that counts as none."""
_FEWEST = 200
_AVERAGED = 8e-3
"""Time over which force and inertia are compared [s]: the second derivative of a coarse encoder's
position is least noisy half way between two samples, where no lag is."""


@dataclass(frozen=True, slots=True)
class LawHypothesis:
    """A way in which law and log may differ, fitted.

    Attributes:
        timing: name of the freed timing, "" or a key of `_GRIDS`.
        value: of it [s, Hz; drift: s/s].
        gains: which parts were free, one of `GAINS`.
        factors: factor on each part, in the order of `TERMS`; 1 where not freed.
        remainder: rms that it leaves [N].
        bandwidth: of the current loop where it was freed together with a lag [Hz].
    """

    timing: str
    value: float
    gains: str
    factors: tuple[float, ...]
    remainder: float
    bandwidth: float | None = None

    @property
    def complexity(self) -> int:
        """Number of freed figures."""
        free = len(_FREED[self.gains].T)
        return free + (self.timing != "") + (self.bandwidth is not None)


def fit_hypothesis(
    law: ControllerLaw, timing: str = "", value: float = 0.0, gains: str = ""
) -> LawHypothesis:
    """Fit the gains of one hypothesis at a given timing by least squares."""
    return _fit_products(_products(law, timing, value), timing, value, gains)


def find_hypothesis(law: ControllerLaw, expected: float) -> LawHypothesis:
    """The simplest hypothesis that accounts for the logged force, or the best one.

    Args:
        law: of the axis.
        expected: rms remainder on the model's own noisy run [N].
    """
    enough = ACCEPTED * expected
    as_stated = _products(law, "", 0.0)
    tried = [_fit_products(as_stated, "", 0.0, gains) for gains in GAINS]
    found = _simplest(tried[:-1], enough)
    if found.remainder <= enough:
        return found
    # The search uses one part of the recording; what it finds is fitted to all of it.
    part = law.most_travelled(_SEARCHED)
    best: dict[str, LawHypothesis] = {}
    far = _far_lag(part)
    grids = _GRIDS | dict.fromkeys(("lag", "resampled"), _SHIFTS + far)
    for timing, grid in grids.items():
        products = [(float(v), _products(part, timing, float(v))) for v in grid]
        for gains in GAINS[:-1]:
            coarse = [_fit_products(p, timing, v, gains) for v, p in products]
            fine = min(coarse, key=lambda s: s.remainder)
            if gains == "":
                tried.append(_refine(law, part, fine, grid))
                if tried[-1].remainder <= enough:
                    return tried[-1]
            elif gains not in best or fine.remainder < best[gains].remainder:
                best[gains] = fine
    tried.append(_fit_current_path(law, part, tried))
    found = _simplest(tried, enough)
    if found.remainder <= _NEARLY * expected:
        return found
    tried += [_refine(law, part, s, grids[s.timing]) for s in best.values()]
    return _simplest(tried, enough)


def _far_lag(law: ControllerLaw) -> float:
    """Whole samples by which the force lags far behind the law, or is far ahead [s]; else 0.

    Within the reach of `_SHIFTS` it is 0, and where it does not make their changes, which show it
    more sharply than themselves, clearly more alike.
    """
    usable = law.usable[1:] & law.usable[:-1]
    stated, logged = (
        np.where(usable, np.diff(values), 0.0) for values in (law.terms().sum(axis=0), law.force)
    )
    size = float(np.linalg.norm(stated) * np.linalg.norm(logged))
    reach = min(round(_FAR / law.period), len(logged) - 1)
    if size == 0.0 or reach < 1:
        return 0.0
    shifted = np.pad(stated, reach)
    shifts = range(2 * reach, -1, -1)
    alike = np.array([shifted[s : s + len(logged)] @ logged for s in shifts]) / size
    best = int(np.argmax(alike))
    lag = (best - reach) * law.period
    clear = 1.0 - alike[best] ** 2 < _CLEARLY * (1.0 - alike[reach] ** 2)
    return lag if clear and abs(lag) > _SHIFTS[-1] - law.period else 0.0


def _fit_current_path(
    law: ControllerLaw, part: ControllerLaw, tried: list[LawHypothesis]
) -> LawHypothesis:
    """Dead time and current bandwidth together: either alone may have compensated for the other.

    The lag of both together is known best, how they share it less: that is sought first.
    """
    alone = {s.timing: s for s in tried if s.timing in ("lag", "bandwidth")}
    corner, stated = alone["bandwidth"].value, law.bandwidth
    together = alone["lag"].value + _lag_of(stated)

    def at(of: ControllerLaw, figures: FloatArray) -> LawHypothesis:
        corner = float(np.exp(figures[1]))
        lag = float(figures[0]) * 1e-3 - _lag_of(corner)
        products = _products(of, "lag", lag, corner)
        return replace(_fit_products(products, "lag", lag, ""), bandwidth=corner)

    shared = np.linspace(np.log(corner), np.log(stated), _SHARED)
    first = [np.array((together * 1e3, share)) for share in shared]
    found = minimize(
        lambda figures: at(part, figures).remainder,
        min(first, key=lambda figures: at(part, figures).remainder),
        method="Nelder-Mead",
        options={"maxfev": 80, "xatol": 1e-4, "fatol": 1e-6},
    )
    return at(law, found.x)


def _lag_of(bandwidth: float) -> float:
    """Lag of a current loop of the first order [s]."""
    return 1.0 / (2.0 * math.pi * bandwidth)


def _simplest(tried: list[LawHypothesis], enough: float) -> LawHypothesis:
    fitting = [s for s in tried if s.remainder <= enough]
    if fitting:
        least = min(s.complexity for s in fitting)
        return min((s for s in fitting if s.complexity == least), key=lambda s: s.remainder)
    best = tried[0]
    for supposition in sorted(tried, key=lambda s: s.complexity):
        if supposition.remainder < _BETTER * best.remainder:
            best = supposition
    return best


def _refine(
    law: ControllerLaw, part: ControllerLaw, coarse: LawHypothesis, grid: FloatArray
) -> LawHypothesis:
    """The best of a hypothesis' timings between the grid points next to the coarse one."""
    i = int(np.argmin(np.abs(grid - coarse.value)))
    low, high = float(grid[max(i - 1, 0)]), float(grid[min(i + 1, len(grid) - 1)])
    fine = minimize_scalar(
        lambda value: fit_hypothesis(part, coarse.timing, float(value), coarse.gains).remainder,
        bounds=(low, high),
        method="bounded",
        options={"xatol": 1e-4 * (high - low)},
    )
    at = [
        fit_hypothesis(law, coarse.timing, v, coarse.gains) for v in (float(fine.x), coarse.value)
    ]
    return min(at, key=lambda s: s.remainder)


def _products(
    law: ControllerLaw, timing: str, value: float, bandwidth: float | None = None
) -> FloatArray:
    """Mean products of (terms, 1, position errors, force) with one another, float64[8, 8].

    The mean is over the usable samples. The position errors stand for an offset and a scale of the
    logged position: those found at rest are not accurate enough for a law with an integrator.
    """
    if timing == "bandwidth":
        terms = law.terms(AS_STATED, value)
    else:
        terms = law.terms(Timing(**{timing: value} if timing else {}), bandwidth)
    usable = law.usable & (np.abs(terms.sum(axis=0)) < 0.99 * law.control.peak_force)
    if timing in ("lag", "resampled"):  # beyond the ends the law is not known
        reach = math.ceil(abs(value) / law.period)
        if value < 0.0:
            usable[len(usable) - reach :] = False
        else:
            usable[: reach + WARM_UP if reach else 0] = False
    if usable.sum() < _FEWEST:
        usable = law.usable
    rows = np.vstack(
        (terms, np.ones((1, len(usable))), _SLIP * law.position_error_columns(), law.force[None])
    )[:, usable]
    products: FloatArray = rows @ rows.T / rows.shape[1]
    return products


def _fit_products(products: FloatArray, timing: str, value: float, gains: str) -> LawHypothesis:
    """Least squares on the products: force = fixed parts + free columns x factors."""
    count, size = len(TERMS), len(products)
    which = _FREED[gains]
    fixed = 1.0 - which.sum(axis=1)
    free = np.zeros((size, size - 1 - count + which.shape[1]))
    own = size - 1 - count  # constant and position errors
    free[count:-1, :own] = np.eye(own)
    free[:count, own:] = which
    target = np.zeros(size)
    target[:count], target[-1] = -fixed, 1.0
    normal = free.T @ products @ free
    found, *_ = np.linalg.lstsq(normal, free.T @ products @ target, rcond=None)
    rest = target - free @ found
    left = math.sqrt(max(float(rest @ products @ rest), 0.0))
    factors = fixed + which @ found[own:]
    if gains != "scale":  # what is smaller than the rest has no factor that could be read
        factors[np.sqrt(np.diagonal(products)[:count]) <= left] = 1.0
    elif found[own] != 0.0:
        left /= abs(float(found[own]))  # in newtons of the law, whatever the log's unit
    return LawHypothesis(timing, value, gains, tuple(float(f) for f in factors), left)


def rest_of_scale(law: ControllerLaw) -> float:
    """By how much logged positions are still scaled that were divided by a rough scale.

    1 where no factor makes the law fit much better than the others do.
    """
    part = law.most_travelled(_SEARCHED)

    def left(factor: float) -> float:
        return fit_hypothesis(part.with_positions_divided(factor)).remainder

    low, high = 1.0 - _ROUGH, 1.0 + _ROUGH
    grid = np.linspace(low, high, _ROUGH_STEPS)
    near, step = float(grid[np.argmin([left(f) for f in grid])]), float(grid[1] - grid[0])
    found = minimize_scalar(
        left, bounds=(near - step, near + step), method="bounded", options={"xatol": 1e-8}
    )
    return float(found.x) if found.fun < 0.5 * min(left(low), left(high)) else 1.0


def log_lateness(law: ControllerLaw, lag: float) -> float:
    """How much of a lag of the force behind the law is the log's; the rest is the stage's.

    Logs are late by whole samples: the number at which the force agrees best with inertia.

    Args:
        law: of the axis.
        lag: of the logged force behind the law [s]; negative: logged early.

    Returns:
        [s], at most `lag` where that is not negative.
    """
    most = math.floor(lag / law.period + _WHOLE)
    fits = {n: _inertia_remainder(law, n * law.period) for n in range(min(most, 0), most + 1)}
    left = {n: fit for n, fit in fits.items() if fit is not None}
    if not left:
        return min(lag, 0.0)
    best = min(left, key=lambda n: left[n])
    return lag if best and abs(lag / law.period - best) < _WHOLE else best * law.period


def _inertia_remainder(law: ControllerLaw, lag: float) -> float | None:
    """What a moving mass with friction leaves of the force if it is logged `lag` late, rms [N].

    Forces that real stages also show (drag, soft saturation, forces over position) are fitted
    too.
    """
    at = law.place * law.period - lag
    x, v, a = law.encoder(at), law.encoder(at, 1), law.encoder(at, 2)
    columns = np.stack(
        (a, v, np.sign(v), np.ones_like(v), np.sign(v) * np.exp(-np.abs(v) / _MOVING),
         v * np.abs(v), a**3, x, x**2, x**3, law.force)
    )  # fmt: skip
    window = np.ones(max(2, round(_AVERAGED / law.period)))
    moving = law.usable & (np.abs(v) > _MOVING)
    throughout = np.convolve(moving, window, "valid") > len(window) - 0.5
    if throughout.sum() < _FEWEST:
        return None
    means = [np.convolve(row, window / len(window), "valid")[throughout] for row in columns]
    columns, force = np.stack(means[:-1]), means[-1]
    columns /= np.abs(columns).max(axis=1, keepdims=True) + 1e-300
    # Normal equations: the columns are few and scaled, and this is called often.
    found = np.linalg.lstsq(columns @ columns.T, columns @ force, rcond=1e-12)[0]
    return float(np.std(force - found @ columns))
