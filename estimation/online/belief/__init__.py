"""What is believed of an axis' friction between moves.

`belief` (its mean and covariance), `arrival_cost` (what it costs the next solve, and what it
becomes by it), `excess` (what acts beside the model), `scatter` (figures that differ from move to
move), `trend` (of the Coulomb force over time).
"""
