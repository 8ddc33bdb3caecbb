"""A CAN segment in virtual time on which the faults of a plan happen.

`FaultyWorld` is a `World`; the faults sit between the host and each node's transceiver, so that
host and drives notice nothing but the faults themselves. A world without faults is a plain `World`
and pays nothing for this. The same plan, seed and host give the same frames.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import can
import numpy as np

from hil_sim.bus import faults as f
from hil_sim.bus.fault_rules import Injected, Line, Rule, SdoAborts, nanoseconds
from hil_sim.bus.subscriptions import Handler, PendingAction, Subscriptions
from hil_sim.bus.world import DATA_FRAME, World
from hil_sim.drive import Drive
from hil_sim.stage import VirtualStage

BUS_OFF_RECOVERED = 0x8140
LOOK_NS = 1_000_000  # how often positions are looked at

_STREAM = 0x4641  # keeps the faults' random numbers apart from the plant's of the same seed
_RESET_NODE = 129


class FaultyWorld(World):
    """A world with a plan of faults; switch the stage on with `power_on`.

    Attributes:
        injected: one entry per fault of the plan, in its order.
    """

    def __init__(self, name: str, plan: f.FaultPlan) -> None:
        super().__init__(name)
        self.plan = plan
        self.injected = tuple(Injected(fault) for fault in plan.faults)
        self._host_off = False
        self._aborts = [
            SdoAborts(entry, entry.fault)
            for entry in self.injected
            if isinstance(entry.fault, f.SdoAbort)
        ]
        rules = [
            Rule(entry, entry.fault, np.random.default_rng((_STREAM, plan.seed, number)))
            for number, entry in enumerate(self.injected)
            if isinstance(entry.fault, f.FrameFault)
        ]
        self._from_host = Line(self, [r for r in rules if r.on_way("host") and r.node is None])
        self._from_drives = Line(self, [r for r in rules if r.on_way("drives")])
        self._received = {
            r.node: Line(self, [q for q in rules if q.on_way("host") and q.node == r.node])
            for r in rules
            if r.node is not None and r.on_way("host")
        }
        self._transceivers: dict[int, Transceiver] = {}

    def power_on(self, stage: VirtualStage) -> None:
        """Switch the stage's drives on, each behind a transceiver of its own.

        Raises:
            ValueError: the stage is on already, or a fault names a node that it does not have.
        """
        nodes = [axis.node for axis in stage.settings.axes]
        self._transceivers = {n: Transceiver(self, n, self._received.get(n)) for n in nodes}
        for entry in self.injected:
            fault = entry.fault
            node = fault.frames.node if isinstance(fault, f.FrameFault) else fault.node
            if node is not None and node not in nodes:
                raise ValueError(f"fault {fault}: there is no node {node} on this stage")
        stage.attach([self._transceivers[n] for n in nodes])
        drives = {drive.node_id: drive for drive in stage.drives}
        for entry in self.injected:
            self._schedule(entry, drives, stage)

    def transmit(
        self,
        owner: object,
        can_id: int,
        data: bytes,
        flags: tuple[bool, bool, bool] = DATA_FRAME,
    ) -> None:
        """Send a host's frame, as far as the faults let it through.

        Raises:
            can.CanOperationError: the host's controller is bus-off.
        """
        if self._host_off:
            raise can.CanOperationError(f"lockstep bus {self.name!r}: the controller is bus-off")
        if flags is not DATA_FRAME:
            super().transmit(owner, can_id, data, flags)
            return
        for abort in self._aborts:
            answer = abort.answer(can_id, data, self.now_ns)
            if answer is not None:
                super().emit(*answer)
                return
        send = super().transmit
        self._from_host.carry(can_id, data, None, lambda payload: send(owner, can_id, payload))

    def emit_from(self, node: int, can_id: int, data: bytes) -> None:
        """Send a node's frame, as far as the faults let it through."""
        if not self._host_off:
            self._from_drives.carry(can_id, data, node, partial(self.emit, can_id))

    def _schedule(self, entry: Injected, drives: dict[int, Drive], stage: VirtualStage) -> None:
        """Put a fault that is not a frame's on the clock."""
        fault = entry.fault
        if isinstance(fault, f.BusOff):
            begin = nanoseconds(fault.at)
            self.at(begin, lambda: self._bus_off(entry, fault.node))
            self.at(begin + nanoseconds(fault.duration), lambda: self._bus_on(fault.node, drives))
        elif isinstance(fault, f.Reboot):
            self.at(nanoseconds(fault.at), lambda: self._reboot(entry, fault.node))
        elif isinstance(fault, f.SafeTorqueOff):
            drive = drives[fault.node]
            self.at(nanoseconds(fault.at), lambda: self._torque_off(entry, drive))
            if fault.until is not None:
                self.at(nanoseconds(fault.until), lambda: drive.safe_torque_off(False))
        elif isinstance(fault, f.DriveFault):
            drive = drives[fault.node]
            if fault.at is not None:
                self.at(nanoseconds(fault.at), lambda: self._fault_of_drive(entry, drive, fault))
            elif fault.position is not None:
                watch = _Crossing(self, stage, drive, fault.position)
                watch.then = lambda: self._fault_of_drive(entry, drive, fault)
                watch.look()

    def _bus_off(self, entry: Injected, node: int | None) -> None:
        entry.note(self.now_ns)
        if node is None:
            self._host_off = True
        else:
            self._transceivers[node].off = True

    def _bus_on(self, node: int | None, drives: dict[int, Drive]) -> None:
        if node is None:
            self._host_off = False
        else:
            self._transceivers[node].off = False
            drives[node].emergency.announce(BUS_OFF_RECOVERED)

    def _reboot(self, entry: Injected, node: int) -> None:
        entry.note(self.now_ns)
        self._transceivers[node].hand_over(0x000, bytes((_RESET_NODE, node)))

    def _torque_off(self, entry: Injected, drive: Drive) -> None:
        entry.note(self.now_ns)
        drive.safe_torque_off(True)

    def _fault_of_drive(self, entry: Injected, drive: Drive, fault: f.DriveFault) -> None:
        entry.note(self.now_ns)
        until_ns = None if fault.until is None else nanoseconds(fault.until)
        lasting = until_ns is not None and until_ns > self.now_ns
        drive.inject_fault(fault.code, lasting)
        if lasting and until_ns is not None:
            self.at(until_ns, lambda: drive.end_fault(fault.code))


class Transceiver:
    """One node's end of a faulty world: a `CanSegment`.

    Attributes:
        off: bus-off.
    """

    def __init__(self, world: FaultyWorld, node: int, line: Line | None) -> None:
        self.off = False
        self._world = world
        self._node = node
        self._line = line
        self._handlers = Subscriptions()
        self._heard: set[int] = set()

    @property
    def now_ns(self) -> int:
        """Virtual time [ns]."""
        return self._world.now_ns

    def emit(self, can_id: int, data: bytes) -> None:
        """Send a data frame."""
        if not self.off:
            self._world.emit_from(self._node, can_id, data)

    def at(self, time_ns: int, action: Callable[[], None]) -> PendingAction:
        """Call `action` at `time_ns`."""
        return self._world.at(time_ns, action)

    def subscribe(self, can_id: int, handler: Handler) -> None:
        """Call `handler` with the payload of every data frame with this id."""
        if can_id not in self._heard:
            self._heard.add(can_id)
            self._world.subscribe(can_id, partial(self._receive, can_id))
        self._handlers.subscribe(can_id, handler)

    def unsubscribe(self, can_id: int, handler: Handler) -> None:
        """Undo `subscribe`."""
        self._handlers.unsubscribe(can_id, handler)

    def hand_over(self, can_id: int, data: bytes) -> None:
        """Let the node have a frame, past all faults."""
        for handler in self._handlers.get(can_id, ()):
            handler(data)

    def _receive(self, can_id: int, data: bytes) -> None:
        if self.off:
            return
        if self._line is None:
            self.hand_over(can_id, data)
        else:
            self._line.carry(can_id, data, self._node, partial(self.hand_over, can_id))


class _Crossing:
    """Looks every millisecond whether a drive crosses a position in csp, and acts once."""

    def __init__(self, world: World, stage: VirtualStage, drive: Drive, position: float) -> None:
        self.then: Callable[[], None] = lambda: None
        self._world = world
        self._stage = stage
        self._drive = drive
        self._limit = position / drive.motor.unit
        self._below: bool | None = None

    def look(self) -> None:
        now = self._world.now_ns
        below = None
        if self._drive.motion.following:
            self._stage.plant.advance_to(now)
            below = self._drive.motor.position() < self._limit
        before, self._below = self._below, below
        if before is not None and below is not None and before is not below:
            self.then()
        else:
            self._world.at(now + LOOK_NS, self.look)
