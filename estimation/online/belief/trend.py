"""A trend of the Coulomb force, extrapolated in time between moves.

A stage that warms up changes by a few per cent per second. An axis that rests meanwhile, or makes
moves that do not slide, would be believed unchanged. The logarithm of the level that moves show is
therefore tracked under two hypotheses,

    none:   w(t) + c,     drift:  w(t) + c(t),  dc/dt = r,

w the level's own wander, c a constant that drifts a little from move to move, r a first-order
Gauss-Markov process: friction warms up fast at first, and less and less. The probability of a drift
follows from the innovations of both Kalman filters (multiple models: P. S. Maybeck, Stochastic
Models, Estimation, and Control, vol. 2, 1982, section 10.8) and is forgotten slowly. The level is
extrapolated by the rate times that probability, and the variance of the Coulomb force is at least
that of the mixture: an error of the rate adds up from move to move. A quiet stage is neither
extrapolated nor doubted.
"""

from __future__ import annotations

import math

import numpy as np

from estimation.online.belief.belief import COULOMB, BeliefSettings
from stagedata.compiled import kernel

RATE, LASTING = 0.05, 10.0
"""Rms [1/s] and correlation time [s] of the rate, where there is a drift: guides and grease warm up
by 10 to 40 % with time constants of three seconds to minutes."""
REMEMBERED = 30.0
"""Time constant with which the odds of a drift return to even [s]."""
MISSED = 0.004
"""Relative rms error of a move's level beyond its own sigma (as in `site_tracking`)."""
STEP, MOST = 3.5, 16.0
"""An innovation of more than STEP standard deviations is a step, which the constant takes up, not a
rate. The square of one counts for no more than MOST against a hypothesis."""
VAGUE = 0.006
"""Relative sigma of a level above which its move hardly slid (as in `site_tracking`): an innovation
above STEP is then taken for an error of that level, not for a step."""

# The state of both filters, one behind the other, none first: w, c, r; and their covariances, rows
# of its upper triangle.
_W, _C, _R, _WW, _WC, _WR, _CC, _CR, _RR = range(9)
_SIZE = 9
_ODDS = 2 * _SIZE
"""Behind them: logarithm of the odds of a drift."""


class Trend:
    """The trend of the Coulomb force of one axis.

    Args:
        settings: of the belief; wander of the level and drift of the Coulomb force are used.
    """

    __slots__ = ("_constants", "_state", "_time")

    def __init__(self, settings: BeliefSettings) -> None:
        self._constants = np.array(
            [settings.wander, settings.correlation_time, settings.drift[COULOMB]]
        )
        self._state = np.empty(_ODDS + 1)
        self._time: float | None = None
        self.calm()
        # Compiled, or loaded, before anything moves.
        observe(self._state.copy(), self._constants, 0.0, 0.0, 1.0)

    def calm(self) -> None:
        """Forget: what comes is another place, or its level is known from elsewhere."""
        self._time = None
        self._state[:] = 0.0
        for filter_ in (0, _SIZE):
            self._state[filter_ + _WW] = self._constants[0] ** 2
        self._state[_SIZE + _RR] = RATE**2

    @property
    def probability(self) -> float:
        """Of a drift."""
        return 1.0 / (1.0 + math.exp(-self._state.item(_ODDS)))

    @property
    def rate(self) -> tuple[float, float]:
        """Of the level's logarithm where there is a drift, and its standard deviation [1/s]."""
        variance = self._state.item(_SIZE + _RR)
        return self._state.item(_SIZE + _R), math.sqrt(max(variance, 0.0))

    def saw(
        self, time: float, level: float, variance: float, believed: tuple[float, float]
    ) -> None:
        """Take in what a move has shown.

        Args:
            time: of it [s]; none is earlier than the one before.
            level: Coulomb force with its wander, in any unit, always the same.
            variance: of it, relative.
            believed: Coulomb force before it and its variance, relative: what c begins from.
        """
        if self._time is None:
            for filter_ in (0, _SIZE):
                self._state[filter_ + _C] = math.log(believed[0])
                self._state[filter_ + _CC] = believed[1]
        elapsed = 0.0 if self._time is None else max(time - self._time, 0.0)
        self._time = time
        observe(self._state, self._constants, elapsed, math.log(level), variance)

    def carry(self, begin: float, end: float) -> tuple[float, float]:
        """The expected change of the level's logarithm between two instants.

        Args:
            begin: from when [s]; not before the last `saw`.
            end: until when [s].

        Returns:
            That, and the variance of c at the end; zeros where nothing has been seen.
        """
        if self._time is None or not end > begin:
            return 0.0, 0.0
        state, share = self._state.tolist(), self.probability
        elapsed = end - self._time
        hold = math.exp(-elapsed / LASTING)
        grown = LASTING * (1.0 - hold)
        earlier = LASTING * (1.0 - math.exp(-max(begin - self._time, 0.0) / LASTING))
        rate, apart = state[_SIZE + _R], state[_SIZE + _C] - state[_C]
        drift = state[_SIZE + _CC] + grown * (2.0 * state[_SIZE + _CR] + grown * state[_SIZE + _RR])
        drift += wandered(elapsed, hold)
        spread = share * drift + (1.0 - share) * state[_CC]
        spread += share * (1.0 - share) * (apart + grown * rate) ** 2
        return share * (grown - earlier) * rate, spread


def wandered(elapsed: float, hold: float) -> float:
    """Variance of the level's logarithm after `elapsed` [s], if the rate was known at the start.

    `hold`: share of the rate that is left, exp(-elapsed/LASTING).
    """
    times = elapsed / LASTING
    return (RATE * LASTING) ** 2 * max(2.0 * times - 3.0 + 4.0 * hold - hold**2, 0.0)


_wandered = kernel(inline="always")(wandered)


@kernel()
def observe(state, constants, elapsed, value, variance):  # type: ignore[no-untyped-def]
    """Let time pass, then correct both filters and what is believed of them by one value.

    Args:
        state: as above, shape (2 _SIZE + 1,); changed.
        constants: rms and correlation time [s] of the wander, drift of the constant.
        elapsed: since the last value [s].
        value: logarithm of the level shown.
        variance: of it.
    """
    wander, correlation, walk = constants[0], constants[1], constants[2]
    keep = math.exp(-elapsed / correlation)
    hold = math.exp(-elapsed / LASTING)
    grown = LASTING * (1.0 - hold)
    state[_ODDS] *= math.exp(-elapsed / REMEMBERED)
    for drift in range(2):
        x = state[drift * _SIZE : (drift + 1) * _SIZE]
        x[_C] += grown * x[_R]
        x[_W] *= keep
        x[_R] *= hold
        x[_CC] += grown * (2.0 * x[_CR] + grown * x[_RR]) + walk**2
        x[_WC] = keep * (x[_WC] + grown * x[_WR])
        x[_CR] = hold * (x[_CR] + grown * x[_RR])
        x[_WW] = keep * keep * x[_WW] + (1.0 - keep * keep) * wander**2
        x[_WR] *= keep * hold
        x[_RR] *= hold * hold
        if drift == 1:
            x[_CC] += _wandered(elapsed, hold)
            x[_CR] += RATE**2 * LASTING * (1.0 - hold) ** 2
            x[_RR] += RATE**2 * (1.0 - hold * hold)
        off = value - x[_W] - x[_C]
        noise = variance + MISSED**2
        expected = x[_WW] + 2.0 * x[_WC] + x[_CC] + noise
        surprise = off * off / expected
        said = -0.5 * (math.log(expected) + min(surprise, MOST))
        state[_ODDS] += said if drift == 1 else -said
        if surprise > STEP**2:
            if variance < VAGUE**2:
                x[_CC] += off * off
            expected += off * off
        by_w, by_c, by_r = x[_WW] + x[_WC], x[_WC] + x[_CC], x[_WR] + x[_CR]
        x[_W] += by_w / expected * off
        x[_C] += by_c / expected * off
        x[_R] += by_r / expected * off
        x[_WW] -= by_w * by_w / expected
        x[_WC] -= by_w * by_c / expected
        x[_WR] -= by_w * by_r / expected
        x[_CC] -= by_c * by_c / expected
        x[_CR] -= by_c * by_r / expected
        x[_RR] -= by_r * by_r / expected
