"""Where effects enter the compiled plant.

`port_arrays` writes their figures into `records`, with the weights of `current_loop`;
`disturbances` is what they do.
"""

from hil_sim.plant.ports.port_arrays import build_ports

__all__ = ["build_ports"]
