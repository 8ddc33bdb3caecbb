"""A scripted bus with scripted drives: just enough CANopen to see what the driver does.

Synchronous and in virtual time: whatever a frame leads to is in the receive queue when `send`
returns; only waiting in `recv` or `clock.sleep_until_ns` moves time.
"""

import struct
from collections import deque
from importlib.resources import files
from pathlib import Path

import can
import numpy as np
import pytest

from drivers.drive import TRANSITIONS, Command, State
from drivers.drive.cia402 import AUTOMATIC
from drivers.settings import AxisSettings, BusSettings
from drivers.stage import Stage

STATUS = {state: state.value[1] | 0x0200 for state in State}
NEW_SETPOINT, RELATIVE, ACKNOWLEDGED, REACHED = 1 << 4, 1 << 6, 1 << 12, 1 << 10
PP = 1
"""Bits and mode of profile position."""


def rest(stage, count):
    """Setpoints that hold where the stage stands."""
    return np.tile(stage.targets, (count, 1)), np.zeros((count, len(stage.axes)))


def power_is_off(scripted):
    """Whether the last controlword that each drive took removes its power, without force offset."""
    return all(d.latched[0] & 0xF in (0, 2) and d.latched[2] == 0 for d in scripted.drives)


class ScriptedDrive:
    """SDO server over a dict, CiA 402 states by table, follows its target at once.

    Attributes:
        objects: (index, sub) -> value; unset ones read 0.
        refuse: (index, sub) -> SDO abort code, for any access.
        refuse_write: the same, reading goes.
        stuck: objects whose writes are acknowledged but not kept.
        silent: from now on it sends nothing.
        waits_for_word: shows 0x0000 until a controlword other than 0 comes.
        mute_tpdo: number of SYNCs that it leaves unanswered.
        on_sync: called with the drive and the number of the SYNC before it answers.
    """

    def __init__(self, bus, node, rated):
        self.bus = bus
        self.node = node
        self.objects = {
            (0x1000, 0): 0x00020192,
            (0x1016, 0): 1,
            (0x1018, 1): 0x00535447,
            (0x1018, 2): 0x402,
            (0x1018, 3): 0x00010003,
            (0x6502, 0): 0xA1,
            (0x6076, 0): round(rated * 1000),
            (0x608F, 1): 1, (0x608F, 2): 1, (0x6091, 1): 1, (0x6091, 2): 1,
            (0x6092, 1): 1, (0x6092, 2): 1,
            (0x60A8, 0): 0xF7010000, (0x60A9, 0): 0xF7010300, (0x60AA, 0): 0xFA015700,
        }  # fmt: skip
        self.sizes = {}
        self.refuse = {}
        self.refuse_write = {}
        self.stuck = set()
        self.writes = []
        self.silent = False
        self.deaf = False
        self.mute_tpdo = 0
        self.waits_for_word = False
        self.nmt = 127
        self.state = State.SWITCH_ON_DISABLED
        self.bits = 0
        self.position = 1234
        self.force = 0
        self.latched = (0, 0, 0)
        self.controlword = 0
        self.syncs = 0
        self.on_sync = lambda drive, count: None
        self.next_beat = 0

    def emit(self, can_id, data):
        if not self.silent:
            self.bus.deliver(can_id, data)

    def emergency(self, code):
        self.emit(0x80 + self.node, struct.pack("<HB5x", code, 0x21))

    def on_frame(self, can_id, data):
        if self.deaf:
            return
        if can_id == 0 and data[1] in (0, self.node):
            if data[0] == 130:
                self.nmt = 127
                self.emit(0x700 + self.node, b"\0")
            else:
                self.nmt = {1: 5, 2: 4, 128: 127}[data[0]]
        elif can_id == 0x600 + self.node and data[0] != 0x80:
            self.answer_sdo(data)
        elif can_id == 0x200 + self.node:
            self.latched = struct.unpack("<Hih", data)
        elif can_id == 0x80 and self.nmt == 5:
            self.syncs += 1
            self.on_sync(self, self.syncs)
            if self.mute_tpdo:
                self.mute_tpdo -= 1
            else:
                word = STATUS[self.state] | self.bits
                self.emit(0x180 + self.node, struct.pack("<Hih", word, self.position, self.force))
            self.take_over()

    def take_over(self):
        word, target, _ = self.latched
        if self.state is State.NOT_READY_TO_SWITCH_ON and self.waits_for_word and not word:
            return
        if self.state in AUTOMATIC:
            self.state = AUTOMATIC[self.state][1]
        elif self.state is State.FAULT:
            if word & 0x80 and not self.controlword & 0x80:
                self.state = State.SWITCH_ON_DISABLED
        else:
            step = TRANSITIONS.get((self.state, Command(word & 0x8F)))
            self.state = self.state if step is None else step[1]
        if self.state is State.OPERATION_ENABLED:
            self.position = target
        self.controlword = word

    def answer_sdo(self, data):
        command, index, sub = struct.unpack_from("<BHB", data)
        key = (index, sub)
        code = self.refuse.get(key) or (self.refuse_write.get(key) if command != 0x40 else None)
        if code:
            self.emit(0x580 + self.node, struct.pack("<BHBI", 0x80, index, sub, code))
        elif command == 0x40:
            value = self.objects.get(key, 0)
            if index == 0x6061:
                value = self.objects.get((0x6060, 0), 0)
            if index == 0x6041:
                value = STATUS[self.state] | self.bits
            if index == 0x6064:
                value = self.position
            payload = struct.pack("<q", value)[:4]
            size = self.sizes.get(key, 4)
            self.emit(
                0x580 + self.node,
                struct.pack("<BHB", 0x43 | (4 - size) << 2, index, sub) + payload,
            )
        else:
            size = 4 - (command >> 2 & 3)
            self.sizes[key] = size
            value = int.from_bytes(data[4 : 4 + size], "little")
            self.writes.append((index, sub, value))
            if key not in self.stuck:
                self.objects[key] = value
            self.emit(0x580 + self.node, struct.pack("<BHB4x", 0x60, index, sub))

    def tick(self, now):
        if now >= self.next_beat:
            self.next_beat = now + 100_000_000
            if self.objects.get((0x1017, 0)):
                self.emit(0x700 + self.node, bytes([self.nmt]))


class ScriptedClock:
    def __init__(self, bus):
        self.bus = bus
        self.now = 0

    def now_ns(self):
        return self.now

    def sleep_until_ns(self, t):
        while self.now < t:
            beat = min((d.next_beat for d in self.bus.drives), default=t)
            self.now = max(self.now, min(t, beat))
            for drive in self.bus.drives:
                drive.tick(self.now)


class ScriptedBus(can.BusABC):
    """A python-can bus with drives behind it and a clock of its own.

    Attributes:
        broken: what it raises instead of taking frames, None where it does not.
        removed: whether it raises the same instead of delivering frames.
        mended_at: when it takes frames again [ns].
    """

    def __init__(self):
        super().__init__(channel="scripted")
        self.channel_info = "scripted"
        self.drives = []
        self.clock = ScriptedClock(self)
        self.sent = []
        self.broken = None
        self.removed = False
        self.mended_at = float("inf")
        self.queue = deque()

    def send(self, msg, timeout=None):
        if self.broken is not None and self.clock.now < self.mended_at:
            raise self.broken
        data = bytes(msg.data)
        self.sent.append((self.clock.now, msg.arbitration_id, data))
        for drive in self.drives:
            drive.on_frame(msg.arbitration_id, data)

    def deliver(self, can_id, data):
        self.queue.append(
            can.Message(arbitration_id=can_id, is_extended_id=False, data=bytearray(data))
        )

    def recv(self, timeout=None):
        if self.removed:
            raise self.broken
        if not self.queue and timeout:
            self.clock.sleep_until_ns(self.clock.now + round(timeout * 1e9))
        return self.queue.popleft() if self.queue else None


@pytest.fixture
def pair():
    """Two ends of one of python-can's own virtual buses."""
    bus = {"interface": "virtual", "channel": "two ends"}
    with can.Bus(**bus) as one, can.Bus(**bus) as other:
        yield one, other


@pytest.fixture(scope="session")
def eds():
    return Path(str(files("hil_sim"))) / "eds" / "stagectl-linear-drive.eds"


@pytest.fixture
def axis_settings(eds):
    common = {
        "eds": eds, "travel": (-0.15, 0.15), "velocity": 1.0, "acceleration": 10.0,
        "jerk": 2000.0, "following_error": 1e-3,
    }  # fmt: skip
    return (
        AxisSettings(name="x", node=1, rated_force=40.0, peak_force=120.0, **common),
        AxisSettings(name="y", node=2, rated_force=60.0, peak_force=200.0, **common),
    )


@pytest.fixture
def bus_settings():
    return BusSettings("scripted", "0")


@pytest.fixture
def scripted(axis_settings):
    bus = ScriptedBus()
    for axis in axis_settings:
        bus.drives.append(ScriptedDrive(bus, axis.node, axis.rated_force))
    yield bus
    bus.broken, bus.removed = None, False
    bus.shutdown()


@pytest.fixture
def opened(scripted, bus_settings, axis_settings):
    """A stage on the scripted bus; not booted."""
    return Stage.open(bus_settings, axis_settings, bus_object=scripted)


@pytest.fixture
def stage(opened):
    """Booted; not homed, not enabled."""
    with opened:
        opened.boot()
        yield opened


@pytest.fixture
def enabled(stage):
    """Booted and enabled."""
    stage.enable()
    return stage


@pytest.fixture
def acknowledging(scripted):
    """Has all drives acknowledge, go to the target at once and report it reached.

    Returns what node 1 is sent: (controlword, target), each once.
    """

    def begin():
        words = []
        ends = {drive.node: drive.position for drive in scripted.drives}

        def on_sync(drive, count):
            word, target, offset = drive.latched
            drive.bits = ACKNOWLEDGED if word & NEW_SETPOINT else REACHED
            if drive.objects[0x6060, 0] != PP:
                ends[drive.node] = drive.position
            elif word & NEW_SETPOINT and not drive.controlword & NEW_SETPOINT:
                ends[drive.node] = target + (ends[drive.node] if word & RELATIVE else 0)
            if drive.objects[0x6060, 0] == PP:
                drive.latched = (word, ends[drive.node], offset)
            if drive.node == 1 and (not words or words[-1] != (word, target)):
                words.append((word, target))

        for drive in scripted.drives:
            drive.on_sync = on_sync
        return words

    return begin


@pytest.fixture
def stuck(scripted):
    """Has all drives stand where they are, whatever their target, and show neither bit."""

    def begin():
        def on_sync(drive, count):
            drive.bits = 0
            drive.latched = (drive.latched[0], drive.position, drive.latched[2])

        for drive in scripted.drives:
            drive.on_sync = on_sync

    return begin
