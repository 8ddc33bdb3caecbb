"""What of the controller, or of its channels, is not as the machine file says.

The logged force against the law (`sim2real.law`): each supposition frees one timing and one gain or
none. The simplest that leaves no more than the law leaves on the model's own noisy run is taken.
A lag of the force behind the law may be the stage's (dead time, current loop) or the log's; the
mechanics tell: against a log's lag, acceleration comes too early for the force as well.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize, minimize_scalar

from sim2real.audit.controller_law import AS_STATED, TERMS, Law
from sim2real.recording import FloatArray

ACCEPTED = 1.5
"""A supposition holds where it leaves at most so many times what is left on the model's own run."""
_NEARLY = 2.5
"""As `ACCEPTED`, for one freed figure against two: interpolated logs are a little off the law."""
_SEARCHED = 1200
_SLIP = 1e-6
"""Brings the columns for a position log that is off to the size of forces."""
_BETTER = 0.98
"""A less simple supposition must leave less than this share of a simpler one's."""
_SHIFTS = np.arange(-5e-3, 5.01e-3, 2e-4)
"""Finer than half a SYNC period: demanded velocity steps at each SYNC make one dip per period."""
_DRIFTS = np.concatenate((-np.geomspace(3e-6, 3e-3, 12)[::-1], np.geomspace(3e-6, 3e-3, 12)))
_GRIDS = {
    "lag": _SHIFTS,
    "bandwidth": np.geomspace(20.0, 5000.0, 16),
    "resampled": _SHIFTS,
    "position": _SHIFTS,
    "demand": _SHIFTS,
    "drift": _DRIFTS,
}
_DEAD_TIMES, _CORNERS = (1e-4, 3e-4, 5e-4, 7e-4, 9e-4), (120.0, 180.0, 270.0, 400.0, 700.0)
"""Where dead time and bandwidth together are sought from [s, Hz]."""
GAINS = ("", "scale", *TERMS, "all")
"""What may be free in the law: nothing, all parts by one factor, one part, every part."""
_MOVING = 0.02
"""Speed above which friction is simple enough to look at inertia [m/s]."""
_LOGGED, _CLEARLY, _WHOLE = 0.9, 0.7, 0.02
"""A log is late where inertia is told so much better: by whole samples as logs are, or by a part of
one, which dead time explains as well unless inertia says so clearly (a moving base bends it)."""
_FEWEST = 200


@dataclass(frozen=True, slots=True)
class Supposition:
    """A way in which law and log may differ, fitted.

    Attributes:
        timing: name of the freed timing "" or a key of `_GRIDS`.
        value: of it [s, Hz; drift: s/s].
        gains: which parts were free, one of `GAINS`.
        factors: factor on each part, in the order of `TERMS`; 1 where not freed.
        left: rms of what it leaves [N].
        bandwidth: of the current loop where it was freed beside a lag [Hz].
    """

    timing: str
    value: float
    gains: str
    factors: tuple[float, ...]
    left: float
    bandwidth: float | None = None

    @property
    def simplicity(self) -> int:
        """Freed figures."""
        free = {"": 0, "all": len(TERMS)}.get(self.gains, 1)
        return free + (self.timing != "") + (self.bandwidth is not None)


def suppose(law: Law, timing: str = "", value: float = 0.0, gains: str = "") -> Supposition:
    """Fit the gains of one supposition at a given timing by least squares."""
    return _fitted(_products(law, timing, value), timing, value, gains)


def explain(law: Law, expected: float) -> Supposition:
    """The simplest supposition that accounts for the logged force, or the best one.

    Args:
        law: of the axis.
        expected: rms left on the model's own noisy run [N].
    """
    enough = ACCEPTED * expected
    as_stated = _products(law, "", 0.0)
    tried = [_fitted(as_stated, "", 0.0, gains) for gains in GAINS]
    found = _simplest(tried[:-1], enough)
    if found.left <= enough:
        return found
    # The search looks at one stretch only; what it finds is fitted to all of the recording.
    part = law.busiest(_SEARCHED)
    best: dict[str, Supposition] = {}
    for timing, grid in _GRIDS.items():
        products = [(float(v), _products(part, timing, float(v))) for v in grid]
        for gains in GAINS[:-1]:
            coarse = [_fitted(p, timing, v, gains) for v, p in products]
            fine = min(coarse, key=lambda s: s.left)
            if gains == "":
                tried.append(_refined(law, part, fine, grid))
                if tried[-1].left <= enough:
                    return tried[-1]
            elif gains not in best or fine.left < best[gains].left:
                best[gains] = fine
    tried.append(_current_path(law, part, tried))
    found = _simplest(tried, enough)
    if found.left <= _NEARLY * expected:
        return found
    tried += [_refined(law, part, s, _GRIDS[s.timing]) for s in best.values()]
    return _simplest(tried, enough)


def _current_path(law: Law, part: Law, tried: list[Supposition]) -> Supposition:
    """Dead time and current bandwidth together: each alone may have taken the other's part."""
    alone = {s.timing: s for s in tried if s.timing in ("lag", "bandwidth")}
    lag, bandwidth = alone["lag"], alone["bandwidth"]
    stated = law.bandwidth
    starts = [(lag.value, stated), (0.0, bandwidth.value)]
    starts += [(dead, corner) for dead in _DEAD_TIMES for corner in _CORNERS]

    def at(of: Law, figures: FloatArray) -> Supposition:
        lag, corner = float(figures[0]) * 1e-3, float(np.exp(figures[1]))
        products = _products(of, "lag", lag, corner)
        return replace(_fitted(products, "lag", lag, ""), bandwidth=corner)

    first = [np.array((dead * 1e3, np.log(corner))) for dead, corner in starts]
    found = minimize(
        lambda figures: at(part, figures).left,
        min(first, key=lambda figures: at(part, figures).left),
        method="Nelder-Mead",
        options={"maxfev": 80, "xatol": 1e-4, "fatol": 1e-6},
    )
    return at(law, found.x)


def _simplest(tried: list[Supposition], enough: float) -> Supposition:
    fitting = [s for s in tried if s.left <= enough]
    if fitting:
        least = min(s.simplicity for s in fitting)
        return min((s for s in fitting if s.simplicity == least), key=lambda s: s.left)
    best = tried[0]
    for supposition in sorted(tried, key=lambda s: s.simplicity):
        if supposition.left < _BETTER * best.left:
            best = supposition
    return best


def _refined(law: Law, part: Law, coarse: Supposition, grid: FloatArray) -> Supposition:
    """The best of a supposition's timings between the grid points beside the coarse one."""
    i = int(np.argmin(np.abs(grid - coarse.value)))
    low, high = float(grid[max(i - 1, 0)]), float(grid[min(i + 1, len(grid) - 1)])
    fine = minimize_scalar(
        lambda value: suppose(part, coarse.timing, float(value), coarse.gains).left,
        bounds=(low, high),
        method="bounded",
        options={"xatol": 1e-4 * (high - low)},
    )
    at = [suppose(law, coarse.timing, v, coarse.gains) for v in (float(fine.x), coarse.value)]
    return min(at, key=lambda s: s.left)


def _products(law: Law, timing: str, value: float, bandwidth: float | None = None) -> FloatArray:
    """Mean products of (terms, 1, slips, force) with one another, shape (8, 8).

    Over the usable samples. The slips stand for a position log that is off or scaled: what the
    rests say of that is not exact enough for an integrator.
    """
    if timing == "":
        terms = law.terms()
    elif timing == "bandwidth":
        terms = law.terms(AS_STATED, value)
    else:
        terms = law.terms(replace(AS_STATED, **{timing: value}), bandwidth)
    usable = law.usable & (np.abs(terms.sum(axis=0)) < 0.99 * law.control.peak_force)
    if usable.sum() < _FEWEST:
        usable = law.usable
    rows = np.vstack((terms, np.ones((1, len(usable))), _SLIP * law.slip(), law.force[None]))[
        :, usable
    ]
    products: FloatArray = rows @ rows.T / rows.shape[1]
    return products


def _fitted(products: FloatArray, timing: str, value: float, gains: str) -> Supposition:
    """Least squares out of the products: force = fixed parts + free columns x factors."""
    count = len(TERMS)
    size = len(products)
    free = np.eye(size)[:, count:-1]  # constant and slips
    own = free.shape[1]
    target = np.zeros(size)
    target[-1] = 1.0
    parts = np.zeros((size, count))
    parts[:count] = np.eye(count)
    if gains == "":
        target[:count] = -1.0
    elif gains == "scale":
        free = np.column_stack((free, parts.sum(axis=1)))
    elif gains == "all":
        free = np.column_stack((free, parts))
    else:
        row = TERMS.index(gains)
        target[:count] = -1.0
        target[row] = 0.0
        free = np.column_stack((free, parts[:, row]))
    normal = free.T @ products @ free
    found, *_ = np.linalg.lstsq(normal, free.T @ products @ target, rcond=None)
    rest = target - free @ found
    left = math.sqrt(max(float(rest @ products @ rest), 0.0))
    if gains == "scale" and found[own] != 0.0:
        left /= abs(float(found[own]))  # in newtons of the law, whatever the log's unit
    factors = np.ones(count)
    if gains == "scale":
        factors[:] = found[own]
    elif gains == "all":
        factors[:] = found[own:]
    elif gains:
        factors[TERMS.index(gains)] = found[own]
    return Supposition(timing, value, gains, tuple(float(f) for f in factors), left)


def log_is_late(law: Law, lag: float) -> bool:
    """Whether a lag of the force is the log's: inertia sees the force that late too.

    Args:
        law: of the axis.
        lag: of the logged force behind the law [s].
    """
    at, late = _inertia(law, 0.0), _inertia(law, lag)
    if at is None or late is None:
        return False
    left = [_inertia(law, float(shift)) or math.inf for shift in _SHIFTS]
    nearest = float(_SHIFTS[left.index(min(left))])
    samples = lag / law.period
    whole = round(samples) >= 1 and abs(samples - round(samples)) < _WHOLE
    return bool(late < (_LOGGED if whole else _CLEARLY) * at and abs(nearest - lag) < abs(nearest))


def _inertia(law: Law, lag: float) -> float | None:
    """What a moving mass with friction leaves of the force, logged `lag` late, rms [N].

    What real stages show beside it (drag, soft saturation, forces over the position) is free.
    """
    at = law.place * law.period - lag
    x, v, a = law.encoder(at), law.encoder(at, 1), law.encoder(at, 2)
    moving = law.usable & (np.abs(v) > _MOVING)
    if moving.sum() < _FEWEST:
        return None
    x, v, a = x[moving], v[moving], a[moving]
    columns = np.stack(
        (a, v, np.sign(v), np.ones_like(v), np.sign(v) * np.exp(-np.abs(v) / _MOVING),
         v * np.abs(v), a**3, x, x**2, x**3)
    )  # fmt: skip
    columns /= np.abs(columns).max(axis=1, keepdims=True) + 1e-300
    force = law.force[moving]
    # By normal equations: the columns are few and scaled, and this is done often.
    found = np.linalg.lstsq(columns @ columns.T, columns @ force, rcond=1e-12)[0]
    return float(np.std(force - found @ columns))
