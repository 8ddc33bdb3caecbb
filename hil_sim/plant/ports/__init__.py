"""Where effects enter the compiled plant: their figures (`port_arrays`) and what they do."""

from hil_sim.plant.ports.port_arrays import build_ports

__all__ = ["build_ports"]
