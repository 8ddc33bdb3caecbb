"""Recordings judged without their controller: the force that a measured motion takes.

Where no demand was logged, or the gains are unknown, the closed loop cannot be simulated. But the
force that a known motion takes can be computed (`hil_sim.plant.inverse`). `motion` smooths the
measured positions and low-passes the force to match, `loop` compares a model's force along that
motion with the measured one so that the search of the free loop can use it, and `figures` finds
what a machine file leaves unknown. `lateness` finds how late the force was logged, `empirical`
describes what no effect explains.

Positions are not predicted, and what lies between controller and reported force (dead time, current
loop) does not show.
"""

from sim2real.open_loop.empirical import describe_residual
from sim2real.open_loop.figures import FIGURES, fit_figures
from sim2real.open_loop.lateness import find_delay, has_lost_sign
from sim2real.open_loop.loop import MotionLoop, compare_along
from sim2real.open_loop.motion import Motion, measure_motion

__all__ = [
    "FIGURES",
    "Motion",
    "MotionLoop",
    "compare_along",
    "describe_residual",
    "find_delay",
    "fit_figures",
    "has_lost_sign",
    "measure_motion",
]
