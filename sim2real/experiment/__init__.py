"""The moves to record next: those on which two models that still compete differ most.

`proposal` chooses among the candidates of `sequences`; `strokes` is the jerk-limited profile of one
move. `excitation` needs no recording: moves that excite whatever effects act on.
"""

from sim2real.experiment.excitation import excite_axes as excite_axes
from sim2real.experiment.proposal import propose_experiment as propose_experiment
from sim2real.experiment.strokes import stroke as stroke
