"""The virtual drives' bus: lock-step in virtual time, faults, any python-can bus in real time."""

from hil_sim.bus.fault_rules import Injected
from hil_sim.bus.fault_world import FaultyWorld
from hil_sim.bus.faults import FaultPlan
from hil_sim.bus.lockstep import LockstepBus
from hil_sim.bus.server import serve
from hil_sim.bus.world import World

__all__ = [
    "FaultPlan",
    "FaultyWorld",
    "Injected",
    "LockstepBus",
    "World",
    "serve",
]
