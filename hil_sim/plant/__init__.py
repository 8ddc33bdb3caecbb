"""The simulated mechanics with motor, friction, encoder and control loops, compiled."""

from hil_sim.plant.arrays import Arrays
from hil_sim.plant.friction import element_shares, slip_step, stribeck
from hil_sim.plant.mechanics import advance, command
from hil_sim.plant.motor import Motor
from hil_sim.plant.port_arrays import opened
from hil_sim.plant.simulate import Response, needs_all_axes, simulate
from hil_sim.plant.stepped import Plant, warm_up

__all__ = [
    "Arrays",
    "Motor",
    "Plant",
    "Response",
    "advance",
    "command",
    "element_shares",
    "needs_all_axes",
    "opened",
    "simulate",
    "slip_step",
    "stribeck",
    "warm_up",
]
