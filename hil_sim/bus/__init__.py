"""The virtual drives' bus: virtual time or real time on any python-can bus, and faults on it."""

from hil_sim.bus.fault_rules import InjectedFault as InjectedFault
from hil_sim.bus.fault_world import FaultyWorld as FaultyWorld
from hil_sim.bus.faults import FaultPlan as FaultPlan
from hil_sim.bus.lockstep import LockstepBus as LockstepBus
from hil_sim.bus.paced_world import PacedWorld as PacedWorld
from hil_sim.bus.server import serve as serve
from hil_sim.bus.world import World as World
