"""The constants of the search by innovations and of its probabilities, in one table.

`stagectl gap blind` calibrates them: change one, run it on a few hundred stages. Those that the
free loop shares (`STRANGE`, `VISIBLE`, `MOST_EFFECTS`) are in `sim2real.free_loop.constants`.
Scores are twice negative log likelihoods.
"""

from __future__ import annotations

from sim2real.shrinkage import FLOOR_LEVEL

FITTED, FITTED_FAINT = 4, 7
"""Most promising effects fitted in each step; and where all promise little."""
WANDERS = 2
"""Further effects that only the filter's wander supports."""
PROMISING = 0.03
"""Effects are fitted whose first-order gain is at least this share of the best one's."""
FAINT = 40.0
"""First-order gain (score) from which effects are fitted where the closed loop shows a gap."""
OPEN = 2.0
"""Squared gap over floor per signal from which the closed loop shows a gap."""
RIVALS = 2
"""Effects that came close in its place, with which each effect is tested again."""
LEAST_GAIN = 100.0
"""Score that an effect must save: nominal stages show accidental ones of 12."""

ROUNDS, ITERATIONS, OUTLIER_SHRINKAGE = 5, 4, 0.9
"""Fits that an alternative may take until it has converged, iterations of each, and the share of
its former value below which the outlier limit must not have fallen, or another fit follows."""
LEAST_PROGRESS = 0.01
"""Share of what the best leaves beyond noise that another fit has to gain."""
CONTENDERS, CLOSE, CLOSE_SHARE = 4, 1000.0, 0.1
"""Alternatives that are refined, and the score (or share of it, or all that the best leaves beyond
noise) within which they are considered close."""

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
"""Harmonics tried for a periodic effect; and its fundamental, in case the second was found."""
IN_TUNE = 0.02
"""How far a wave that was fitted beside another may be from its harmonic, relative."""
REPEATED = 0.5
"""Share of what is left (also of the free-run gap) that an effect must save when it is fitted once
more beside itself, for it to depart from its equation."""
COURSE = 15.0
"""Score that a Coulomb level that changes with time must save so: the filter follows it, and
friction's wander hides it; true ones save up to 9 if the gap does not widen."""
SATISFIED = 3.0 * FLOOR_LEVEL
"""Squared gap over floor of an axis that needs nothing more."""
AGAINST = 1.5
"""How much wider than the machine file's own gap it must be without one of a pair, for the pair
to be a single profile."""

CLOSES = 0.4
"""Share of the gap, or of its remainder, that an effect must close where structure is left."""
SETS = 4
"""Sets of effects of each size that are simulated then."""

TEMPER = 5.0
"""Divisor of the log likelihood in the odds of names: innovations of the true model are white,
those of a model that is right except for details are not."""
RIVAL = 0.05
"""Odds from which an effect could take another one's place."""
SIMPLER = 10.0
"""Score of a further parameter in the odds of names: simple causes are a little more probable."""
RIVALRY = 0.9
"""Largest odds of all alternatives together: what was chosen is the most probable or simplest."""
STEEP = 4.0
"""How fast confidence in the only name falls with the share of the gap that is left."""
FAMILY = 0.55
"""Least share of an axis' gap that an effect of the right family closes in the wrong shape."""
CLOSED = 0.8
"""Share of an axis' gap from which it counts as closed."""
SURE, SURE_FAMILY, UNSURE = 0.99, 0.97, (0.05, 0.95)
"""Confidence in a name where the gap is closed; in the family of an effect in another shape; and
limits of the confidence that follows from the share of the gap closed."""
DOUBTED = 0.45
"""Largest probability of an effect whose size may be zero by its sigma, or whose values are not
plausible at all."""
SHOWN = 8
"""Candidates shown per axis."""

SCATTER = 2.2
"""Scatter over simulated stages, over the sigma that a fit gives."""
RELATIVE = 0.003
"""Relative sigma of every size at best."""
WANDER_SHARE = 0.4
"""Share of the friction's wander in the sigma of what scales Coulomb friction."""
STEP_SHARE = 0.05
"""Sigma of delays, in control periods, by which integrators differ."""
DAMPED, TUNED = 0.02, 5e-4
"""Sigma of an oscillator's damping per radian that it turns in a control period, and of its
frequency, relative: integration damps or excites oscillators, and detunes them."""
