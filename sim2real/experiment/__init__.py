"""The moves to record next: those on which two models that still compete differ most.

`proposal` chooses among the candidates of `sequences`; `strokes` is the jerk-limited profile of one
move.
"""

from sim2real.experiment.proposal import propose_experiment
from sim2real.experiment.sequences import Reach, candidate_sequences, setpoints
from sim2real.experiment.strokes import stroke

__all__ = [
    "Reach",
    "candidate_sequences",
    "propose_experiment",
    "setpoints",
    "stroke",
]
