"""The device profile of a virtual drive (CiA 402): power states, modes of operation, stops."""

from hil_sim.cia402.device_profile import MotionControl as MotionControl
from hil_sim.cia402.state_machine import State as State
