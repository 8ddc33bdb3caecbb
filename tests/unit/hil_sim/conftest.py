"""A host in plain CANopen frames, a plant that follows its demand exactly, the packaged stage."""

from __future__ import annotations

import itertools
import struct
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import can
import pytest

from hil_sim.bus.world import World
from hil_sim.effects import AppliedEffect, Effect
from hil_sim.effects.library import own_effects
from hil_sim.settings import AxisSettings, ControlSettings, StageSettings
from hil_sim.stage import VirtualStage
from stagectl.config import load_machine
from stagectl.config import stage_settings as settings_of
from stagedata import FrictionFigures

MS = 1_000_000


def axis(name: str, node: int) -> AxisSettings:
    return AxisSettings(
        name=name,
        node=node,
        mass=8.0,
        friction=FrictionFigures(10, 6.0, 20.0, 6e5, 100.0, 0.4, 2e-3, 1.0),
        control=ControlSettings(341e3, 16.07e6, 2714.0, 8.842e-4, 1500.0, 40.0, 120.0, 1e-4),
        increment=1e-9,
        noise=1e-9,
        travel=(-0.15, 0.15),
        velocity=1.0,
        acceleration=10.0,
        jerk=2000.0,
        following_error=1e-3,
        wander=0.01,
    )


class FollowingPlant:
    """Implements `PlantPort`: the encoder is where the demand is, unless the axis is blocked."""

    def __init__(self, start: tuple[float, ...], tick_ns: int = 100_000) -> None:
        self.tick_ns = tick_ns
        self.time_ns = 0
        self.actual = list(start)
        self.blocked = [False] * len(start)
        self.powered = [False] * len(start)
        self.offset = [0.0] * len(start)
        self.commands: list[tuple[int, int, float, float, int]] = []
        self._demand = list(start)
        self._ramp = [(x, x, 1, 1) for x in start]  # from, to, ticks, done
        self._worst = [0.0] * len(start)

    def advance_to(self, time_ns: int) -> None:
        while self.time_ns < time_ns:
            self.time_ns += self.tick_ns
            for a, (start, end, ticks, done) in enumerate(self._ramp):
                done = min(done + 1, ticks)
                self._ramp[a] = (start, end, ticks, done)
                if self.powered[a]:
                    self._demand[a] = end if done == ticks else start + (end - start) * done / ticks
                    if not self.blocked[a]:
                        self.actual[a] = self._demand[a]
                    self._worst[a] = max(self._worst[a], abs(self._demand[a] - self.actual[a]))

    def power(self, axis: int, on: bool) -> None:
        self.powered[axis] = on
        x = self.actual[axis]
        self._demand[axis] = x
        self._ramp[axis] = (x, x, 1, 1)
        self.offset[axis] = 0.0

    def command(self, axis: int, position: float, force: float, ticks: int) -> None:
        self.commands.append((self.time_ns, axis, position, force, ticks))
        self._ramp[axis] = (self._demand[axis], position, ticks, 0)
        self.offset[axis] = force

    def open_loop(self, axis: int) -> None:
        """Force moves nothing here."""

    def start_clock(self) -> None:
        """Nothing depends on time."""

    def encoder(self, axis: int) -> int:
        return round(self.actual[axis] * 1e9)

    def force(self, axis: int) -> float:
        return self.offset[axis]

    def demand(self, axis: int) -> float:
        return self._demand[axis]

    def velocity(self, axis: int) -> float:
        return 0.0

    def following_error(self, axis: int) -> float:
        worst, self._worst[axis] = self._worst[axis], 0.0
        return worst


class SdoAbortError(Exception):
    """An abort code from the drive."""

    def __init__(self, code: int) -> None:
        super().__init__(f"0x{code:08X}")
        self.code = code


@dataclass
class Frame:
    time_ns: int
    can_id: int
    data: bytes


class Host:
    """Frames out, frames in; knows nothing of the drive's insides."""

    def __init__(self, bus: can.BusABC) -> None:
        self.bus = bus
        self.clock = bus.clock  # type: ignore[attr-defined]
        self.frames: list[Frame] = []

    def send(self, can_id: int, data: bytes = b"") -> None:
        self.bus.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=False))
        self.read()

    def read(self) -> None:
        while (message := self.bus.recv(0)) is not None:
            self.frames.append(
                Frame(round(message.timestamp * 1e9), message.arbitration_id, bytes(message.data))
            )

    def wait(self, milliseconds: float) -> None:
        self.clock.sleep_until_ns(self.clock.now_ns() + round(milliseconds * MS))
        self.read()

    def take(self, can_id: int) -> list[Frame]:
        """Frames with this id received so far, which are forgotten then."""
        self.read()
        found = [f for f in self.frames if f.can_id == can_id]
        self.frames = [f for f in self.frames if f.can_id != can_id]
        return found

    def request(self, node: int, payload: bytes) -> bytes:
        self.take(0x580 + node)
        self.send(0x600 + node, payload)
        (answer,) = self.take(0x580 + node)
        if answer.data[0] == 0x80:
            raise SdoAbortError(struct.unpack_from("<I", answer.data, 4)[0])
        return answer.data

    def write(self, node: int, index: int, sub: int, fmt: str, value: float) -> None:
        data = struct.pack("<" + fmt, value)
        head = struct.pack("<BHB", 0x23 | (4 - len(data)) << 2, index, sub)
        self.request(node, head + data.ljust(4, b"\0"))

    def refusal(self, action: Callable[[], object]) -> int:
        """The abort code that an SDO access is answered with."""
        try:
            action()
        except SdoAbortError as abort:
            return abort.code
        raise AssertionError("was not refused")

    def read_object(self, node: int, index: int, sub: int, fmt: str) -> int:
        answer = self.request(node, struct.pack("<BHB4x", 0x40, index, sub))
        size = 4 - (answer[0] >> 2 & 3)
        assert size == struct.calcsize("<" + fmt)
        return struct.unpack_from("<" + fmt, answer, 4)[0]

    def upload(self, node: int, index: int, sub: int) -> bytes:
        """Segmented upload."""
        answer = self.request(node, struct.pack("<BHB4x", 0x40, index, sub))
        assert not answer[0] & 2, "was expedited"
        (size,) = struct.unpack_from("<I", answer, 4)
        data = b""
        for toggle in itertools.cycle((0x60, 0x70)):
            answer = self.request(node, bytes((toggle, 0, 0, 0, 0, 0, 0, 0)))
            data += answer[1 : 8 - (answer[0] >> 1 & 7)]
            if answer[0] & 1:
                break
        assert len(data) == size
        return data

    def nmt(self, command: int, node: int = 0) -> None:
        self.send(0x000, bytes((command, node)))

    def statusword(self, node: int = 1) -> int:
        return self.read_object(node, 0x6041, 0, "H")

    def control(self, word: int, node: int = 1) -> int:
        """Controlword by SDO; the statusword after it."""
        self.write(node, 0x6040, 0, "H", word)
        return self.statusword(node)

    def enable(self, mode: int, node: int = 1) -> None:
        self.write(node, 0x6060, 0, "b", mode)
        for word in (0x06, 0x07, 0x0F):
            status = self.control(word, node)
        assert status & 0x6F == 0x27

    def reset_fault(self, node: int = 1) -> int:
        """A rising edge of the fault reset; the statusword after it."""
        self.control(0x00, node)
        return self.control(0x80, node)

    def emergencies(self, node: int = 1) -> list[tuple[int, int]]:
        """Error code and error register of each EMCY received so far."""
        return [struct.unpack_from("<HB", f.data) for f in self.take(0x080 + node)]

    def map_for_csp(self, *nodes: int) -> None:
        """The mappings of our own driver, those of stagectl-linear-drive-csp.dcf."""
        for node in nodes or (1, 2):
            for n in range(4):
                self.write(node, 0x1400 + n, 1, "I", 0x80000200 + 0x100 * n + node)
                self.write(node, 0x1800 + n, 1, "I", 0xC0000180 + 0x100 * n + node)
            for mapping, communication, entries, cob in (
                (0x1600, 0x1400, (0x60400010, 0x607A0020, 0x60B20010), 0x200 + node),
                (0x1A00, 0x1800, (0x60410010, 0x60640020, 0x60770010), 0x40000180 + node),
            ):
                self.write(node, mapping, 0, "B", 0)
                for sub, entry in enumerate(entries, 1):
                    self.write(node, mapping, sub, "I", entry)
                self.write(node, mapping, 0, "B", len(entries))
                self.write(node, communication, 2, "B", 1)
                self.write(node, communication, 1, "I", cob)

    def cycle(
        self, target: int, force: int = 0, word: int = 0x0F, node: int = 1
    ) -> tuple[int, ...]:
        """One SYNC of 1 ms with the mapping of csp: statusword, position, force."""
        self.send(0x200 + node, struct.pack("<Hih", word, target, force))
        self.send(0x080)
        frame = self.take(0x180 + node)[-1]
        self.wait(1)
        return struct.unpack("<Hih", frame.data)

    def stream(self, targets: Iterable[int], **kwargs: int) -> list[tuple[int, ...]]:
        return [self.cycle(target, **kwargs) for target in targets]


_names = (f"unit-{n}" for n in itertools.count())


@pytest.fixture(scope="session")
def stage_settings() -> StageSettings:
    return StageSettings(1e-3, (axis("x", 1), axis("y", 2)))


@pytest.fixture
def plant() -> FollowingPlant:
    return FollowingPlant((2.5e-3, -1e-3))


@pytest.fixture
def world() -> World:
    return World(next(_names))


@pytest.fixture
def stage(stage_settings: StageSettings, plant: FollowingPlant, world: World) -> VirtualStage:
    stage = VirtualStage(stage_settings, seed=1, plant=plant)
    stage.attach(world)
    return stage


@pytest.fixture
def fresh(stage: VirtualStage, world: World) -> Iterator[Host]:
    """A host on the bus of the following plant, 30 ms after power-on, nodes pre-operational."""
    with can.Bus(interface="lockstep", channel=world.name) as bus:
        host = Host(bus)
        host.wait(30)
        yield host


@pytest.fixture
def host(fresh: Host) -> Host:
    """The same with both nodes mapped for csp."""
    fresh.map_for_csp()
    return fresh


@pytest.fixture
def streaming(host: Host) -> Host:
    """The host with axis x in csp, enabled through RPDOs, at rest at 0."""
    host.write(1, 0x6060, 0, "b", 8)
    host.nmt(1)
    for word in (0x06, 0x07, 0x0F):
        host.cycle(0, word=word)
    return host


@pytest.fixture(scope="session")
def make_host() -> type[Host]:
    """`Host` itself, for tests that bring their own bus."""
    return Host


@pytest.fixture(scope="session")
def make_following_plant() -> Callable[[], FollowingPlant]:
    """For tests that need a new plant for each example."""
    return lambda: FollowingPlant((2.5e-3, -1e-3))


@pytest.fixture(scope="session")
def nominal() -> StageSettings:
    return settings_of(load_machine())


@pytest.fixture(scope="session")
def effects() -> dict[str, Effect]:
    return own_effects()


@pytest.fixture(scope="session")
def with_effects() -> Callable[..., StageSettings]:
    """A stage with effects on axis x, and others on y."""

    def put(stage: StageSettings, *x: AppliedEffect, y: tuple[AppliedEffect, ...] = ()):
        first, second = stage.axes
        return replace(stage, axes=(replace(first, effects=x), replace(second, effects=y)))

    return put
