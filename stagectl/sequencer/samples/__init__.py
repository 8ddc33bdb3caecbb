"""Which of a move's samples the estimator can use, when they were taken, and its record of them."""

from stagectl.sequencer.samples.move_data import prepare_move_data

__all__ = ["prepare_move_data"]
