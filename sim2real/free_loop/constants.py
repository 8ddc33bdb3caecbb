"""The constants of the free-loop search, in one table.

`python -m benchmarks.gap.emps` and `stagectl gap blind` calibrate them: change one, run both.
"""

from __future__ import annotations

MOST_EFFECTS = 6
"""Effects sought on one axis: real machines show five that matter."""
FITTED, PROMISING, SWAPPED = 4, 6, 2
"""Candidates that are fitted in each step, that the look back may take up again, and that it fits
in an earlier effect's place."""
SHORT, LONG = 4, 8
"""Iterations of a fit that decides between candidates, and of one whose figures count."""
EACH = 4.0
"""Score that each parameter of an effect must save: twice what chance saves, as in AIC."""
TRANSMISSION = 4.0
"""Score of an effect that comes with a transmission only: an effect of the same form that needs
none is seven times as probable."""
IMPLAUSIBLE = 4.0
"""Score for each tenth of its plausible range by which a value exceeds it: beyond is less likely,
not impossible; a whole range beyond is as unlikely as e^-20."""
SIGMAS = 2.0
"""Standard deviations over moves by which a step must shrink the held-out gap."""
PATIENCE = 2
"""Effects that are added at once where one alone does not: some show only together."""
VISIBLE = 0.25
"""And least squared gap over floor by which it must."""
CLOSED = 0.6
"""Share of an axis' gap that the search must close on held-out moves for its names to be given."""
MISFIT = 16.0
"""Largest squared gap over floor, per signal, that may be left then. With more, what acts is in no
list, and wrong names close most of it: of drag with the square of speed, viscous friction and a
resonance close nine tenths and leave a hundred times this."""
NEAR = 3.0
"""Squared gap over floor, per signal, up to which a model is near the floor: within the machine
file's tolerance one shows 1.5 to 3."""
HOPELESS = 8.0
"""A search ends where four effects leave this many times that misfit: two more would not do."""
STRANGE = 4.0
"""Tenths of its plausible ranges beyond which an effect's values are not plausible at all."""
