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

from sim2real.open_loop.figures import FIGURES as FIGURES
from sim2real.open_loop.figures import fit_figures as fit_figures
from sim2real.open_loop.lateness import find_delay as find_delay
from sim2real.open_loop.lateness import has_lost_sign as has_lost_sign
from sim2real.open_loop.loop import MotionLoop as MotionLoop
from sim2real.open_loop.loop import compare_along as compare_along
from sim2real.open_loop.motion import Motion as Motion
from sim2real.open_loop.motion import measure_motion as measure_motion
