"""One move as a least-squares problem with an arrival cost, compiled.

`prepare` (samples to kinematics), `zones` and `onset` (what the positions show), `residual` and
`whitening` with `shared_rounding` (rows and their weights), `solve`.
"""
