"""The constants of the free-loop search, in one table.

`python -m benchmarks.gap.emps` and `stagectl gap blind` calibrate them: change one, run both.
"""

from __future__ import annotations

MOST_EFFECTS = 6
"""Effects sought on one axis: real machines show five that matter."""
FITTED, PROMISING, SWAPPED = 4, 6, 2
"""Number of candidates: fitted in each step; remembered for the look back; and fitted by the look
back in place of an earlier effect."""
SHORT, LONG = 4, 8
"""Iterations of a fit that decides between candidates, and of one whose figures count."""
EACH = 4.0
"""Score that each parameter of an effect must save: twice what chance saves, as in AIC."""
TRANSMISSION = 4.0
"""Score that an effect must save in addition if only transmissions have it: an effect of the same
form without a transmission is e^2, about seven times, as probable a priori."""
IMPLAUSIBLE = 4.0
"""Score for each tenth of its plausible range by which a value exceeds it, for up to five tenths:
at that distance a value is less likely by e^-10, not impossible."""
SIGMAS = 2.0
"""A step must shrink the held-out gap by this many standard deviations, estimated over moves."""
PATIENCE = 2
"""Number of effects that may be added before the held-out gap has to shrink: some show only
together."""
VISIBLE = 0.25
"""A step must also shrink the squared gap over floor by at least this."""
CLOSED = 0.6
"""Share of an axis' gap that the search must close on held-out moves for its names to be given."""
MISFIT = 16.0
"""Largest squared gap over floor, per signal, that may be left where names are given. If more is
left, the library probably lacks what acts, even if its effects close most of the gap: of drag with
the square of speed, viscous friction and a resonance close nine tenths and leave a hundred times
this."""
NEAR = 3.0
"""Squared gap over floor, per signal, up to which a model is near the floor; models whose figures
are within the machine file's tolerance show 1.5 to 3."""
HOPELESS = 8.0
"""A search ends where four effects or more leave this many times `MISFIT`: two further ones would
not explain it."""
STRANGE = 4.0
"""Tenths of its plausible ranges beyond which an effect's values are not plausible at all."""
