"""Friction estimation and feedforward: arrays in, dataclasses out; no files, no clock, no bus.

- `friction`: friction laws, their state, and the friction force along a path;
- `online`: the split-horizon estimator, after every move for the next one;
- `offline`: figures that single moves do not determine, from recordings;
- `field`: friction over the table, tracked from run to run.

Modules beside them serve several: `trajectory`, `move`, `kinematics`, `noise`, `sampled_force`,
`low_speed_friction`, `least_squares`.
Nothing is imported here, so that a program that only plans trajectories starts without a compiler.
"""
