"""Friction figures that single moves do not tell, from many of them; off the critical path.

Stribeck curve, shape of the hysteresis, asymmetry: recorded positions and forces in, figures with
sigma and verdict out. `identify` is the entry, `model` the compiled friction model, `unknowns` what
is estimated and what is believed of it before, `records` the samples, `fit` the least squares.
"""
