"""Cycles and SDO reads per second, compared with python canopen's own objects.

    python -m benchmarks.rates.cycle_peers [--rounds 7] [--json OUT]

One cycle: two RPDOs and a SYNC out, two TPDOs in and decoded (statusword, position, force of two
axes). All peers use the same virtual drives, complete except for the mechanics: in place of the
plant is a massless body that is always at its demand. On `lockstep` host and drives share a thread;
on `virtual` the drives have a thread of their own. Each round times all peers in turn; the best
round counts, and ratios are those of the best. On a shared machine CPU time is steadier than wall
time, so both are printed; a target may be met in either.
"""

from __future__ import annotations

import argparse
import json
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import can
import canopen
import numpy as np

from benchmarks.shared.machine_facts import machine_facts
from drivers import objects as od
from drivers.stage import Stage
from hil_sim import CSP_DCF_PATH
from hil_sim.bus import World, serve
from hil_sim.stage import VirtualStage
from stagectl.config.machine.file import load_machine
from stagectl.config.settings.package_settings import driver_settings, stage_settings

LOCKSTEP_CYCLES, VIRTUAL_CYCLES, READS = 10_000, 2_000, 2_000
PRESENT_POSITION = 37
"""Homing method that takes no time."""
PATIENCE = 0.02
"""SYNC period where the drives run in another thread [s]; the host waits half of it for TPDOs.

As in a run, the host's heartbeat is timed by this grid: every fifth of our cycles includes a frame
that canopen does not send."""
NODES = (1, 2)
RATIOS = {"lockstep, cycles": 4.0, "virtual, cycles": 1.5, "virtual, SDO reads": 1.0}
"""Target: lowest ratio of our rate to canopen's."""


@dataclass(frozen=True)
class Figure:
    """What one subject reached.

    Attributes:
        what: bus and kind.  who: whose objects.
        rate: per second of wall time, best round.
        cpu_rate: per second of CPU time of all threads, best round.
        ratio, cpu_ratio: to canopen's; None for canopen itself.
    """

    what: str
    who: str
    rate: float
    cpu_rate: float
    ratio: float | None
    cpu_ratio: float | None


class Weightless:
    """Replaces the plant: each axis is at its demand, without any force."""

    def __init__(self, axes: int) -> None:
        self._position = [0.0] * axes

    def advance_to(self, time_ns: int) -> None:
        """Nothing moves by itself."""

    def start_clock(self) -> None:
        """Nothing depends on time."""

    def power(self, axis: int, on: bool) -> None:
        """Do nothing: the axis holds its demand with or without power."""

    def command(self, axis: int, position: float, force: float, ticks: int) -> None:
        """Be there at once [m]."""
        self._position[axis] = position

    def open_loop(self, axis: int) -> None:
        """There is no loop."""

    def encoder(self, axis: int) -> int:
        """In increments of 1 nm."""
        return round(self._position[axis] * 1e9)

    def force(self, axis: int) -> float:
        """None."""
        return 0.0

    def demand(self, axis: int) -> float:
        """Where it is [m]."""
        return self._position[axis]

    def velocity(self, axis: int) -> float:
        """None."""
        return 0.0

    def following_error(self, axis: int) -> float:
        """None."""
        return 0.0


class Hurried:
    """A clock on which waiting takes no time: what is measured is the work of a cycle."""

    def __init__(self) -> None:
        self._ahead = 0

    def now_ns(self) -> int:
        """Monotonic, with the waiting skipped [ns]."""
        return time.monotonic_ns() + self._ahead

    def sleep_until_ns(self, t: int) -> None:
        """Skip to `t` [ns]."""
        self._ahead += max(0, t - self.now_ns())


class PumpedNetwork(canopen.Network):
    """canopen's network without a receiving thread: it receives after each frame it sends."""

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send, and dispatch what came of it."""
        assert self.bus is not None
        self.bus.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=False))
        while (message := self.bus.recv(0)) is not None:
            self.notify(message.arbitration_id, message.data, message.timestamp)


@contextmanager
def drives(interface: str, name: str) -> Iterator[can.BusABC]:
    """The host's end of a bus with both virtual drives on it."""
    settings = stage_settings(load_machine(None))
    stage = VirtualStage(settings, 1, plant=Weightless(len(settings.axes)))
    with ExitStack() as stack:
        if interface == "lockstep":
            world = World(name)
            stage.attach(world)
            yield stack.enter_context(can.Bus(interface="lockstep", channel=name))
            return
        theirs = stack.enter_context(can.Bus(interface=interface, channel=name))
        ours = stack.enter_context(can.Bus(interface=interface, channel=name))
        stop = threading.Event()
        thread = threading.Thread(target=serve, args=(stage, theirs, stop))
        thread.start()
        try:
            yield ours
        finally:
            stop.set()
            thread.join()


Subject = Callable[[], int]
"""Does a batch of work and returns the number of operations done."""


def our_cycles(stack: ExitStack, interface: str, count: int) -> tuple[Subject, Stage]:
    """`Stage.stream`: everything that a run does per SYNC."""
    bus_object = stack.enter_context(drives(interface, f"ours-{interface}"))
    if interface != "lockstep":
        bus_object.clock = Hurried()  # type: ignore[attr-defined]
    bus, axes = driver_settings(load_machine(None))
    if interface != "lockstep":
        bus = replace(bus, sync_period=PATIENCE)
    axes = tuple(replace(axis, homing_method=PRESENT_POSITION) for axis in axes)
    stage = stack.enter_context(Stage.open(bus, axes, bus_object=bus_object))
    stage.boot()
    for axis in stage.axes:  # other subjects run in between, and this clock runs ahead
        axis.node.write(od.HEARTBEAT_CONSUMER, 0)
        axis.node.watched = False
    stage.home()
    stage.enable()
    demand = np.tile(stage.targets, (count, 1))
    offset = np.zeros_like(demand)

    def work() -> int:
        before = stage.missed
        stage.stream(demand, offset)
        return count - (stage.missed - before)

    return work, stage


def canopens(
    stack: ExitStack, interface: str, count: int
) -> tuple[Subject, list[canopen.RemoteNode]]:
    """The same cycle with canopen's PDO objects, the drives enabled by SDO as far as it goes."""
    bus = stack.enter_context(drives(interface, f"theirs-{interface}"))
    network: canopen.Network
    if interface == "lockstep":
        network = PumpedNetwork(bus)
        bus.clock.sleep_until_ns(30_000_000)
    else:
        network = canopen.Network(bus)
        network.notifier = can.Notifier(bus, network.listeners, 0.1)
        stack.callback(network.notifier.stop)
        time.sleep(0.1)
    nodes = [network.add_node(n, str(CSP_DCF_PATH)) for n in NODES]
    for node in nodes:
        node.nmt.state = "PRE-OPERATIONAL"
        node.load_configuration()
        node.sdo[0x6060].raw = 8
        node.nmt.state = "OPERATIONAL"
        for word in (6, 7, 15):
            node.sdo[0x6040].raw = word
    pairs = [([m for m in node.rpdo[1]], [m for m in node.tpdo[1]]) for node in nodes]  # noqa: C416
    arrived = [threading.Event() for _ in nodes]
    for node, event in zip(nodes, arrived, strict=True):
        node.tpdo[1].add_callback(lambda _, event=event: event.set())
    seen = [[0, 0, 0] for _ in nodes]
    targets = [node.sdo[0x6064].raw for node in nodes]

    def work() -> int:
        done = 0
        for _ in range(count):
            for node, (out, _), target in zip(nodes, pairs, targets, strict=True):
                for variable, value in zip(out, (0x0F, target, 0), strict=True):
                    variable.raw = value
                node.rpdo[1].transmit()
            for event in arrived:
                event.clear()
            network.sync.transmit()
            complete = all(event.wait(0.1) for event in arrived)
            for a, (_, back) in enumerate(pairs):
                seen[a] = [variable.raw for variable in back]
            done += complete
        return done

    return work, nodes


def our_reads(stage: Stage) -> Subject:
    """Objects of the first axis by our SDO client."""
    node = stage.axes[0].node

    def work() -> int:
        for _ in range(READS):
            node.read(od.STATUSWORD)
        return READS

    return work


def canopens_reads(nodes: list[canopen.RemoteNode]) -> Subject:
    """The same object by canopen's."""
    variable = nodes[0].sdo[0x6041]

    def work() -> int:
        for _ in range(READS):
            assert variable.raw is not None
        return READS

    return work


def main() -> None:
    """Measure everybody in turn; exit code 1 where a target is missed."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=7, help="measurements of each [7]")
    parser.add_argument("--json", type=Path, help="also write the figures here")
    arguments = parser.parse_args()
    figures = measure(arguments.rounds)
    print(f"best of {arguments.rounds} rounds; {machine_facts()}\n")
    print("| per second of | whose | wall time | ratio | CPU time | ratio |")
    print("| --- | --- | --- | --- | --- | --- |")
    for f in figures:
        ratios = [("" if r is None else f"{r:.2f}") for r in (f.ratio, f.cpu_ratio)]
        print(
            f"| {f.what} | {f.who} | {f.rate:,.0f} | {ratios[0]} | {f.cpu_rate:,.0f} "
            f"| {ratios[1]} |"
        )
    missed = []
    for f in figures:
        if f.ratio is None or f.cpu_ratio is None:
            continue
        if max(f.ratio, f.cpu_ratio) < RATIOS.get(f.what, 0.0):
            missed.append(
                f"{f.what}: {max(f.ratio, f.cpu_ratio):.2f} of {RATIOS[f.what]} x canopen"
            )
    for line in missed:
        print(f"missed: {line}")
    if arguments.json:
        arguments.json.write_text(json.dumps([asdict(f) for f in figures], indent=1) + "\n")
    sys.exit(bool(missed))


def measure(rounds: int) -> list[Figure]:
    """All figures, best of `rounds` rounds."""
    with ExitStack() as stack:
        subjects: dict[tuple[str, str], Subject] = {}
        for interface, count in (("lockstep", LOCKSTEP_CYCLES), ("virtual", VIRTUAL_CYCLES)):
            ours, stage = our_cycles(stack, interface, count)
            theirs, nodes = canopens(stack, interface, count)
            subjects[f"{interface}, cycles", "stagectl"] = ours
            subjects[f"{interface}, cycles", "canopen"] = theirs
            if interface == "virtual":
                subjects[f"{interface}, SDO reads", "stagectl"] = our_reads(stage)
                subjects[f"{interface}, SDO reads", "canopen"] = canopens_reads(nodes)
        best: dict[tuple[str, str], tuple[float, float]] = {}
        for _ in range(rounds):
            for name, subject in subjects.items():
                wall, cpu = time.perf_counter(), time.process_time()
                done = subject()
                rates = done / (time.perf_counter() - wall), done / (time.process_time() - cpu)
                before = best.get(name, (0.0, 0.0))
                best[name] = max(before[0], rates[0]), max(before[1], rates[1])
    figures = []
    for (what, who), (rate, cpu) in best.items():
        ratio, cpu_ratio = (
            ours / peer for ours, peer in zip((rate, cpu), best[what, "canopen"], strict=True)
        )
        own = who != "canopen"
        figures.append(
            Figure(what, who, rate, cpu, ratio if own else None, cpu_ratio if own else None)
        )
    return figures


if __name__ == "__main__":
    main()
