"""The virtual drives' bus: virtual time or real time on any python-can bus, and faults on it."""

from hil_sim.bus.fault_rules import InjectedFault
from hil_sim.bus.fault_world import FaultyWorld
from hil_sim.bus.faults import FaultPlan
from hil_sim.bus.lockstep import LockstepBus
from hil_sim.bus.server import serve
from hil_sim.bus.world import World

__all__ = [
    "FaultPlan",
    "FaultyWorld",
    "InjectedFault",
    "LockstepBus",
    "World",
    "serve",
]
