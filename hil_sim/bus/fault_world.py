"""A CAN segment in virtual time on which the faults of a plan occur.

`FaultyWorld` is a `World` with faults between the host and each node's transceiver; to host and
drives it is the same bus. A world without faults is a plain `World` and has none of this on its
path. The same plan, seed and host give the same frames.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import can
import numpy as np

from hil_sim.bus import faults as f
from hil_sim.bus.fault_rules import (
    FaultyLine,
    FrameRule,
    InjectedFault,
    SdoAbortRule,
    nanoseconds,
)
from hil_sim.bus.subscriptions import Handler, PendingAction, Subscriptions
from hil_sim.bus.world import DATA_FRAME, World
from hil_sim.drive import Drive
from hil_sim.stage import VirtualStage

BUS_OFF_RECOVERED = 0x8140
POSITION_CHECK_NS = 1_000_000
"""Period at which positions are compared with those of the plan [ns]."""

_STREAM = 0x4641  # random numbers apart from those of the plant
_RESET_NODE = 129


class FaultyWorld(World):
    """A world with a plan of faults; switch the stage on with `power_on`.

    Attributes:
        injected: one entry per fault of the plan, in its order.
    """

    is_faultless = False

    def __init__(self, name: str, plan: f.FaultPlan) -> None:
        super().__init__(name)
        self.plan = plan
        self.injected = tuple(InjectedFault(fault) for fault in plan.faults)
        self._host_off = False
        self._aborts = [
            SdoAbortRule(entry, entry.fault)
            for entry in self.injected
            if isinstance(entry.fault, f.SdoAbort)
        ]
        rules = [
            FrameRule(entry, entry.fault, np.random.default_rng((_STREAM, plan.seed, number)))
            for number, entry in enumerate(self.injected)
            if isinstance(entry.fault, f.FrameFault)
        ]
        of_host = [r for r in rules if r.acts_on_frames_of("host")]
        self._from_host = FaultyLine(self, [r for r in of_host if r.node is None])
        self._from_drives = FaultyLine(self, [r for r in rules if r.acts_on_frames_of("drives")])
        self._to_node = {
            node: FaultyLine(self, [r for r in of_host if r.node == node])
            for node in {r.node for r in of_host}
            if node is not None
        }
        self._transceivers: dict[int, Transceiver] = {}

    def power_on(self, stage: VirtualStage) -> None:
        """Switch the stage's drives on, each behind a transceiver of its own.

        Raises:
            ValueError: the stage is on already, or a fault names a node that it does not have.
        """
        nodes = [axis.node for axis in stage.settings.axes]
        self._transceivers = {
            n: Transceiver(self, n, partial(self._emit_from, n), self._to_node.get(n))
            for n in nodes
        }
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
        """Send a host's frame, subject to the faults.

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

    def _emit_from(self, node: int, can_id: int, data: bytes) -> None:
        if not self._host_off:
            self._from_drives.carry(can_id, data, node, partial(self.emit, can_id))

    def _schedule(
        self, entry: InjectedFault, drives: dict[int, Drive], stage: VirtualStage
    ) -> None:
        """Set timers for a fault of a node; faults of frames need none."""
        match entry.fault:
            case f.BusOff(controller, at, duration):
                self._strike_at(entry, at, partial(self._begin_bus_off, controller))
                end = nanoseconds(at) + nanoseconds(duration)
                self.at(end, lambda: self._end_bus_off(controller, drives))
            case f.Reboot(node, at):
                reset = partial(self._transceivers[node].deliver, 0x000, bytes((_RESET_NODE, node)))
                self._strike_at(entry, at, reset)
            case f.SafeTorqueOff(node, at, until):
                drive = drives[node]
                self._strike_at(entry, at, lambda: drive.safe_torque_off(True))
                if until is not None:
                    self.at(nanoseconds(until), lambda: drive.safe_torque_off(False))
            case f.DriveFault(node, _, at, position) as fault:
                inject = partial(self._inject, drives[node], fault)
                if at is not None:
                    self._strike_at(entry, at, inject)
                elif position is not None:
                    self._strike_in_place(entry, position, inject, drives[node], stage)

    def _strike_at(self, entry: InjectedFault, at: float, strike: Callable[[], None]) -> None:
        def act() -> None:
            entry.note(self.now_ns)
            strike()

        self.at(nanoseconds(at), act)

    def _strike_in_place(
        self,
        entry: InjectedFault,
        position: float,
        strike: Callable[[], None],
        drive: Drive,
        stage: VirtualStage,
    ) -> None:
        """Let a fault strike once, when the drive in a cyclic mode crosses a position [m]."""
        limit = position / drive.motor.unit
        before: bool | None = None

        def check() -> None:
            nonlocal before
            below = None
            if drive.motion.following:
                stage.plant.advance_to(self.now_ns)
                below = drive.motor.position() < limit
            if None not in (before, below) and below is not before:
                entry.note(self.now_ns)
                strike()
            else:
                before = below
                self.at(self.now_ns + POSITION_CHECK_NS, check)

        check()

    def _begin_bus_off(self, node: int | None) -> None:
        if node is None:
            self._host_off = True
        else:
            self._transceivers[node].bus_off = True

    def _end_bus_off(self, node: int | None, drives: dict[int, Drive]) -> None:
        if node is None:
            self._host_off = False
        else:
            self._transceivers[node].bus_off = False
            drives[node].emergency.announce(BUS_OFF_RECOVERED)

    def _inject(self, drive: Drive, fault: f.DriveFault) -> None:
        until_ns = None if fault.until is None else nanoseconds(fault.until)
        lasting = until_ns is not None and until_ns > self.now_ns
        drive.inject_fault(fault.code, lasting)
        if lasting and until_ns is not None:
            self.at(until_ns, lambda: drive.end_fault(fault.code))


class Transceiver:
    """A `CanSegment` for one node: frames that it misses, and bus-off.

    Args:
        world: the bus.
        node: node id.
        send: takes id and data of a frame of the node.
        line: carries the frames to the node; None: directly.

    Attributes:
        bus_off: the node neither sends nor receives.
    """

    def __init__(
        self,
        world: World,
        node: int,
        send: Callable[[int, bytes], None],
        line: FaultyLine | None,
    ) -> None:
        self.bus_off = False
        self._world = world
        self._node = node
        self._send = send
        self._line = line
        self._handlers = Subscriptions()
        self._subscribed: set[int] = set()

    @property
    def now_ns(self) -> int:
        """Virtual time [ns]."""
        return self._world.now_ns

    def emit(self, can_id: int, data: bytes) -> None:
        """Send a data frame."""
        if not self.bus_off:
            self._send(can_id, data)

    def at(self, time_ns: int, action: Callable[[], None]) -> PendingAction:
        """Call `action` at `time_ns`."""
        return self._world.at(time_ns, action)

    def subscribe(self, can_id: int, handler: Handler) -> None:
        """Call `handler` with the payload of every data frame with this id."""
        if can_id not in self._subscribed:
            self._subscribed.add(can_id)
            self._world.subscribe(can_id, partial(self._receive, can_id))
        self._handlers.subscribe(can_id, handler)

    def unsubscribe(self, can_id: int, handler: Handler) -> None:
        """Undo `subscribe`."""
        self._handlers.unsubscribe(can_id, handler)

    def deliver(self, can_id: int, data: bytes) -> None:
        """Deliver a frame to the node, whatever the faults."""
        for handler in self._handlers.get(can_id, ()):
            handler(data)

    def _receive(self, can_id: int, data: bytes) -> None:
        if self.bus_off:
            return
        if self._line is None:
            self.deliver(can_id, data)
        else:
            self._line.carry(can_id, data, self._node, partial(self.deliver, can_id))
