"""Friction of the simulated plant: its laws by name (`laws`), each in a module of its own."""

from hil_sim.plant.friction.gms import Slip, element_shares, slip_step
from hil_sim.plant.friction.laws import NUMBERS, rest_forces
from hil_sim.plant.friction.stribeck import stribeck

__all__ = ["NUMBERS", "Slip", "element_shares", "rest_forces", "slip_step", "stribeck"]
