"""The constants of the search by innovations and of its probabilities, in one table.

`stagectl gap blind` calibrates them: change one, run it on a few hundred stages. Those that the
free loop shares (`STRANGE`, `VISIBLE`, `MOST_EFFECTS`) are in `sim2real.free_loop.constants`.
Scores are twice negative log likelihoods.
"""

from __future__ import annotations

from sim2real.shrinkage import FLOOR_LEVEL

FITTED, FITTED_FAINT = 4, 7
"""Number of the most promising effects fitted in each step, and the number where all promise
little."""
WANDERS = 2
"""Number of effects fitted besides that only the filter's wander supports."""
PROMISING = 0.03
"""Share of the best effect's first-order gain that an effect must reach to be fitted."""
FAINT = 40.0
"""First-order gain (score) from which effects are fitted where the closed loop shows a gap."""
OPEN = 2.0
"""Squared gap over floor per signal from which the closed loop shows a gap."""
RIVALS = 2
"""Number of effects that came close and are tried again in the place of each effect found."""
PASSES = 3
"""Largest number of times that effects are added and then reconsidered."""
FACTOR, MASS = "force_constant", "payload_mass"
SCALED = (MASS, "coulomb_level", "viscous_damping", "presliding_stiffness")
"""The first is an effect that the loop cannot tell from all of `SCALED` by one factor."""
FEWEST_SCALED = 3
"""Number of these from which that effect is tried in their place."""
LEAST_GAIN = 100.0
"""Score that an effect must save; on nominal stages effects save up to 12 by chance."""

ROUNDS, ITERATIONS, OUTLIER_SHRINKAGE = 5, 4, 0.9
"""Largest number of fits until an alternative has converged, and iterations of each. Another fit
follows if the outlier limit has fallen below the last share of its former value."""
LEAST_PROGRESS = 0.01
"""Share of the best alternative's cost beyond noise that a fit must save for another to follow."""
CONTENDERS, CLOSE, CLOSE_SHARE = 4, 1000.0, 0.1
"""Number of alternatives that are refined. They are close if their scores exceed the best one's by
no more than the largest of: `CLOSE`, this share of its score, its cost beyond noise."""

OCCAM = 20.0
"""Score that each parameter of an effect after the first must save: more than chance does."""
OCCAM_COURSE = 6.0
"""The same for a Coulomb level that changes with time, against one that does not: within ten
seconds most warm-ups change little, and constant levels are no more probable a priori."""
IMPLAUSIBLE = 40.0
"""Score for each tenth of its plausible range by which a value exceeds it."""
COHERENT = 1000.0
"""Samples over which deviations of the closed loop are correlated, for their weight."""

ORDERS = ((2.0, 3.0), (0.5,))
"""Orders of the harmonics tried beside a periodic effect; 0.5 is the fundamental, in case the wave
that was found is its second harmonic."""
IN_TUNE = 0.02
"""Largest relative distance of a second wave's order from a whole number."""
REPEATED = 0.5
"""An effect departs from its equation if fitting it once more beside itself removes at least this
share of what is left, both of the innovations' cost beyond noise and of the free-run gap."""
COURSE = 15.0
"""As `LEAST_GAIN`, for the repeat of a Coulomb level that changes with time. It is small because
the filter follows the level and friction's wander hides it; where the effect has its equation's
shape, a repeat that does not widen the gap saves up to 9."""
SATISFIED = 3.0 * FLOOR_LEVEL
"""Squared gap over floor of an axis that needs nothing more."""
AGAINST = 1.5
"""Two effects are a single profile if without one of them the squared gap is this many times that
of the machine file."""

TEMPER = 5.0
"""Divisor of the log likelihood in the odds of names. Innovations would have to be white for a
divisor of 1; those of a model that is right except for details are not."""
RIVAL = 0.05
"""Odds from which an effect could take another one's place."""
SIMPLER = 10.0
"""Score of a further parameter in the odds of names: simple causes are a little more probable."""
RIVALRY = 0.9
"""Largest odds of all alternatives together; below 1, since the effects chosen are the most
probable or the simplest."""
FAMILY = 0.55
"""Share of an axis' gap that an effect of the right family closes at least, in the wrong shape."""
CLOSED = 0.8
"""Share of an axis' gap from which it counts as closed."""
SURE, SURE_FAMILY = 0.99, 0.97
"""Confidence in a name where the gap is closed; in the family of an effect in another shape."""
DOUBTED = 0.45
"""Largest probability of an effect whose size may be zero by its sigma, or whose values are not
plausible at all."""
SHOWN = 8
"""Candidates shown per axis."""

SCATTER = 2.2
"""Scatter over simulated stages, over the sigma that a fit gives."""
RELATIVE = 0.003
"""Smallest relative sigma that a size can have."""
WANDER_SHARE = 0.4
"""Share of the friction's wander in the sigma of what scales Coulomb friction."""
STEP_SHARE = 0.05
"""Sigma of delays, in control periods, by which integrators differ."""
DAMPED, TUNED = 0.02, 5e-4
"""Sigma of an oscillator's damping per radian that it turns in a control period, and of its
frequency, relative: integration damps or excites oscillators, and detunes them."""
