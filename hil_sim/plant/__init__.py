"""The simulated plant, compiled: mechanics, friction, motor, encoder and control loops."""

from hil_sim.plant.arrays import Arrays
from hil_sim.plant.friction.gms import Slip, element_shares, slip_step
from hil_sim.plant.friction.stribeck import stribeck
from hil_sim.plant.inverse import force_along, force_variants
from hil_sim.plant.mechanics import advance, command
from hil_sim.plant.motor import Motor
from hil_sim.plant.ports.port_arrays import build_ports
from hil_sim.plant.simulate import (
    Response,
    Simulation,
    needs_all_axes,
    simulate,
    simulate_variants,
)
from hil_sim.plant.stepped import Plant, warm_up

__all__ = [
    "Arrays",
    "Motor",
    "Plant",
    "Response",
    "Simulation",
    "Slip",
    "advance",
    "build_ports",
    "command",
    "element_shares",
    "force_along",
    "force_variants",
    "needs_all_axes",
    "simulate",
    "simulate_variants",
    "slip_step",
    "stribeck",
    "warm_up",
]
