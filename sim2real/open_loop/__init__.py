"""Recordings judged without their controller: the force that a measured motion takes.

Where no demand was logged, or nobody knows the gains, the closed loop cannot be simulated. The
plant can, the other way round (`hil_sim.plant.inverse`): `motion` makes a smooth motion of the
measured positions and low-passes the force alike, `loop` compares the force of a model along that
motion with it, for the same search as in the free loop, and `figures` finds what a machine file
leaves unknown. `empirical` describes what no effect explains.
Positions cannot be predicted; what lies between controller and reported force (dead time, current
loop) does not show.
"""

from sim2real.open_loop.empirical import describe_residual
from sim2real.open_loop.figures import FIGURES, fit_figures
from sim2real.open_loop.loop import MotionLoop, compare_along
from sim2real.open_loop.motion import Motion, measure_motion

__all__ = [
    "FIGURES",
    "Motion",
    "MotionLoop",
    "compare_along",
    "describe_residual",
    "fit_figures",
    "measure_motion",
]
