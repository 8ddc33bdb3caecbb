"""Which of a move's samples the estimator can use, when they were taken, and its record of them."""
