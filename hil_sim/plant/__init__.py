"""The simulated plant, compiled: mechanics, friction, motor, encoder and control loops."""

from hil_sim.plant.arrays import Arrays as Arrays
from hil_sim.plant.friction.gms import Slip as Slip
from hil_sim.plant.friction.gms import element_shares as element_shares
from hil_sim.plant.friction.gms import slip_step as slip_step
from hil_sim.plant.friction.stribeck import stribeck as stribeck
from hil_sim.plant.inverse import force_along as force_along
from hil_sim.plant.inverse import force_variants as force_variants
from hil_sim.plant.mechanics import advance as advance
from hil_sim.plant.mechanics import command as command
from hil_sim.plant.motor import Motor as Motor
from hil_sim.plant.ports.port_arrays import build_ports as build_ports
from hil_sim.plant.simulate import Response as Response
from hil_sim.plant.simulate import Simulation as Simulation
from hil_sim.plant.simulate import needs_all_axes as needs_all_axes
from hil_sim.plant.simulate import simulate as simulate
from hil_sim.plant.simulate import simulate_variants as simulate_variants
from hil_sim.plant.stepped import Plant as Plant
from hil_sim.plant.stepped import warm_up as warm_up
