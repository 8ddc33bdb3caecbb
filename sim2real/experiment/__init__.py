"""The moves to record next: those on which two models that still compete differ most.

`proposal` chooses among the candidates of `sequences`; `strokes` is the jerk-limited profile of one
move. `excitation` needs no recording: moves that excite whatever effects act on.
"""

from sim2real.experiment.excitation import Excitation, excite_axes
from sim2real.experiment.proposal import propose_experiment
from sim2real.experiment.sequences import Reach, candidate_sequences, repeat_moves, setpoints
from sim2real.experiment.strokes import stroke

__all__ = [
    "Excitation",
    "Reach",
    "candidate_sequences",
    "excite_axes",
    "propose_experiment",
    "repeat_moves",
    "setpoints",
    "stroke",
]
