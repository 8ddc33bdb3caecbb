"""The constants of the search for effects and of its probabilities, in one table.

Each states unit and reason. Scores are twice negative log likelihoods; those of innovations count
`TEMPER` times as much. Gaps are squared gaps over floor, per signal. To calibrate one, change it
and run

    stagectl gap blind --trials 300 --seed N          names, probabilities, promises, sigmas
    stagectl gap blind --trials 60 --effects 4        several effects on one axis
    stagectl gap blind --trials 60 --leave-out        what no effect of the library explains
    python -m benchmarks.gap.emps                     a real machine, in the free loop

A constant names the last one where the first does not show it.
"""

from __future__ import annotations

# How many effects, and what one more must bring.

MOST_EFFECTS = 6
"""Effects sought on one axis: real machines show five that matter."""
MOST_FOR_CURVE = 2
"""Effects sought in the free loop where one curve explains nearly all: one in its place, and one
that does not show along the motion."""
EACH = 4.0
"""Score that each parameter of an effect must save: twice what chance saves, as in AIC."""
TRANSMISSION = 4.0
"""Score that an effect must save in addition if only transmissions have it: an effect of the same
form without a transmission is e^2, about seven times, as probable a priori. `emps`. The weight of
what an axis turns (`Effect.any_size`) is as usual as any."""
IMPLAUSIBLE = 4.0
"""Score for each tenth of its plausible range by which a value exceeds it, for up to five tenths:
at that distance a value is less likely by e^-10, not impossible."""
TEMPER = 5.0
"""Score of innovations that counts as one. Theirs would be 1 if they were white; those of a model
that is right except for details are not."""
LEAST_GAIN = 80.0
"""Score of innovations that an effect must save in addition; on nominal stages effects save up to
12 by chance."""
COHERENT = 1000.0
"""Samples over which deviations of the closed loop are correlated, for their weight beside
innovations."""
OPEN = 2.0
"""Gap from which the closed loop needs an explanation."""
WIDE = 1e4
"""Gap from which scans to first order say nothing: a pull of many times friction was a level of
friction there. The motion shows what closes nearly all of it."""
VISIBLE = 0.25
"""Fall of the gap, both signals together, by which an effect shows in the closed loop."""
FLIPS, CHANCE = 4000, 0.02
"""A step in the free loop must shrink the held-out gap by more than all but this share of so many
draws in which each move's change has a random sign; for like changes that is two sigma."""
PATIENCE = 2
"""Effects that may be added before the held-out gap has to shrink: some show only together."""

# Which candidates are fitted, and for how long: time against the risk of missing one.

FITTED, FITTED_FAINT = 4, 7
"""Most promising effects fitted in each step, and where all promise little."""
WANDERS = 2
"""Effects fitted besides that only the filter's wander supports."""
PROMISING = 0.03
"""Share of the best effect's first-order gain that an effect must reach to be fitted."""
FAINT = 40.0
"""First-order gain of innovations from which effects are fitted where the closed loop is open."""
RIVALS = 2
"""Effects that came close and are fitted again in the place of each effect found."""
REMEMBERED = 6
"""Most promising effects of a step in the free loop that later look-backs consider."""
PASSES = 3
"""Largest number of times that effects are added and then reconsidered."""
SHORT, LONG = 4, 8
"""Iterations of a fit that decides between candidates, and of one whose figures count."""
ROUNDS, OUTLIER_SHRINKAGE = 5, 0.9
"""Fits of `SHORT` until an alternative has converged, at most. Another one follows if the outlier
limit has fallen below this share of its former value."""
LEAST_PROGRESS = 0.01
"""Share of the best alternative's cost beyond noise that a fit must save for another to follow."""
CONTENDERS, CLOSE, CLOSE_SHARE = 4, 1000.0, 0.1
"""Alternatives that are fitted to convergence. They are close if their scores exceed the best one's
by no more than the largest of: `CLOSE`, this share of its score, its cost beyond noise."""
HOPELESS = 128.0
"""A search in the free loop ends where four effects or more leave this gap over the floor: two
further ones would not explain it."""
FACTOR, MASS, OFFSET = "force_constant", "payload_mass", "force_offset"
SCALED = (MASS, "coulomb_level", "viscous_damping", "presliding_stiffness")
FEWEST_SCALED = 3
"""The loop cannot tell the first effect from all of `SCALED` by one factor. It is tried in their
place where this many of them were found. `--effects`."""

# What is named, and how sure it is.

WITHIN = 3.0
"""Tolerances that a figure of the machine file may be off; of one stage in 70 some figure is."""
NEAR = 3.0
"""Gap up to which a model is near the floor; models whose figures are within the machine file's
tolerance show 1.5 to 3."""
CLOSED = 0.6
"""Share of an axis' gap that named effects must close on held-out moves."""
LEVEL_MISFIT = 4.0
"""Mean square of the tracked Coulomb level, over that of the wander, from which the level has a
course that the model lacks; right models show 0.4 to 1.8."""
STRANGE = 4.0
"""Tenths of its plausible ranges beyond which an effect's values are not plausible at all."""
ENOUGH = 0.9
"""Share of a gap from which it counts as closed."""
ALIKE = 0.05
"""Odds from which an effect could take another one's place."""
CHOSEN = 0.53
"""Smallest probability of an effect of the chosen set, before anything limits it."""
SURE, SURE_COORDINATE = 0.99, 0.97
"""Largest probability of a name, and of a coordinate."""
UNCERTAIN = 0.85
"""Largest probability of a name where structure is left: a relative of what acts may close most of
the gap as well. `--leave-out`."""
LITTLE = 0.02
"""Share of the gap that counts for nothing where structure is left: other shapes leave as much."""
DOUBTED, SIGNIFICANT = 0.45, 2.0
"""Largest probability of an effect whose size may be zero by this many sigmas, or whose values are
not plausible at all."""
SHOWN = 8
"""Candidates shown per axis."""

# Standard deviations of figures.

SCATTER = 2.2
"""Scatter over simulated stages, over the sigma that a fit to innovations gives."""
RELATIVE = 0.003
"""Smallest relative sigma that a size can have."""
WANDER_SHARE = 0.4
"""Share of the friction's wander in the sigma of what scales Coulomb friction."""
STEP_SHARE = 0.05
"""Sigma of delays, in control periods, by which integrators differ."""
DAMPED, TUNED = 0.02, 5e-4
"""Sigma of an oscillator's damping per radian that it turns in a control period, and of its
frequency, relative: integration damps or excites oscillators, and detunes them."""
