"""Several SYNCs in one call of the drives: the same frames, and single ones where in doubt."""

from __future__ import annotations

import struct
from collections import deque

import can
import numpy as np
import pytest

from hil_sim.bus import World
from hil_sim.plant import Plant
from hil_sim.stage import VirtualStage

MS = 1_000_000
IDS = (0x201, 0x202)
STATUSWORD = 0x604100
FOLLOWING_ERROR, OVER_TRAVEL = struct.pack("<H", 0x8611), struct.pack("<H", 0x8612)
COUNT = 200


class CountingPlant(Plant):
    """Counts the SYNCs that it takes in blocks; a signal may wait for the end of one."""

    in_blocks, interrupted_at = 0, 10 * COUNT

    def run_block(self, block):
        super().run_block(block)
        self.in_blocks += len(block.reports)
        if self.in_blocks >= self.interrupted_at:
            raise KeyboardInterrupt


class Bench:
    """Two drives enabled in csp, and a host that sends them blocks of SYNCs."""

    def __init__(self, settings, make_host, name, start=(1e-4, -2e-4)):
        self.world = World(name)
        self.plant = CountingPlant(settings, 3, start)
        self.stage = VirtualStage(settings, 3, plant=self.plant)
        self.stage.attach(self.world)
        self.drives = self.stage.drives
        self.bus = can.Bus(interface="lockstep", channel=name)
        self.host = make_host(self.bus)
        self.host.wait(30)
        self.host.map_for_csp()
        for node in (1, 2):
            self.host.enable(8, node)
        self.host.nmt(1)
        self.due = self.world.now_ns + MS
        self.home = [drive.motor.position() for drive in self.drives]
        self.frames = []
        self.run(rows(self, 2))  # statusword bit 12 is set from the second SYNC on
        self.frames.clear()

    def run(self, rows, size=25):
        """Sends all rows, `size` at a time, and notes every frame that comes."""
        while rows:
            expected = [(0x180 + d.node_id, 8, self.statusword(d)) for d in self.drives]
            answers = []
            try:
                outcome = self.bus.exchange_block(
                    rows[:size], IDS, (self.due, MS), 0x80, expected, answers
                )
            finally:
                done = len(answers) // 2
                self.frames += answers
                self.due += done * MS
            if outcome is None:  # a timer's frame came first: SYNC after it
                self.read()
                self.world.sleep_until_ns(self.due)
                self.host.send(0x80)
            if outcome is not True:
                self.read()
                self.due, done = self.due + MS, done + 1
            rows = rows[done:]

    def read(self):
        while message := self.bus.recv(0):
            self.frames.append(bytes(message.data))
        self.frames += [frame.data for frame in self.host.frames]
        self.host.frames.clear()

    @staticmethod
    def statusword(drive):
        return drive.dictionary.integer(STATUSWORD).to_bytes(2, "little")

    @property
    def state(self):
        """What the next SYNC depends on."""
        values = [drive.dictionary.values for drive in self.drives]
        return values, self.world.now_ns, self.plant.time_ns


def rows(bench, count=COUNT, words=0x0F, offsets=20):
    """Both axes go apart by 6 micrometres and come back."""
    way = np.round(3e3 * (1 - np.cos(np.linspace(0.0, 2 * np.pi, count)))).astype(int)
    columns = [way, np.broadcast_to(words, count), np.broadcast_to(offsets, count)]
    return [
        tuple(
            struct.pack("<Hih", word, home + sign * step, offset)
            for home, sign in zip(bench.home, (1, -1), strict=True)
        )
        for step, word, offset in zip(*(column.tolist() for column in columns), strict=True)
    ]


@pytest.fixture
def make_bench(stage_settings, make_host, request):
    made = []

    def make(**options):
        bench = Bench(stage_settings, make_host, f"{request.node.name}-{len(made)}", **options)
        made.append(bench)
        return bench

    yield make
    for bench in made:
        bench.bus.shutdown()


def both(make_bench, act, **options):
    """What `act` does, one SYNC after the other and in blocks; the second."""
    benches = single, block = [make_bench(**options) for _ in range(2)]
    before = single.plant.in_blocks
    single.world.subscribe(0x80, lambda data: None)  # somebody else hears SYNC: single steps
    for bench in benches:
        act(bench)
    assert block.frames == single.frames
    assert block.state == single.state
    assert single.plant.in_blocks == before
    return block


def test_a_block_gives_the_frames_of_single_syncs(make_bench):
    block = both(make_bench, lambda bench: bench.run(rows(bench)))
    assert len(block.frames) == 2 * COUNT
    assert block.plant.in_blocks > 0.9 * COUNT


def test_a_timer_ends_a_block_and_the_next_one_goes_on(make_bench):
    def act(bench):
        seen = []
        for ms in (10.4, 40.0, 40.3, 111.0):
            bench.world.at(bench.due + round(ms * MS), lambda: seen.append(bench.drives[0].motor))
        bench.run(rows(bench))
        assert len(seen) == 4

    assert both(make_bench, act).plant.in_blocks > 0.8 * COUNT


CHANGES = {
    "quick stop": {"words": np.where(np.arange(COUNT) < 60, 0x0F, 0x02)},
    "halt": {"words": np.where(np.arange(COUNT) % 100 < 60, 0x0F, 0x10F)},
    "force beyond 0x6072": {"offsets": np.where(np.arange(COUNT) == 60, 32000, 20)},
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_a_setpoint_that_does_more_than_move_is_taken_by_itself(make_bench, change):
    block = both(make_bench, lambda bench: bench.run(rows(bench, **change)))
    assert 40 < block.plant.in_blocks < COUNT


def test_a_target_beyond_its_limit_is_cut(make_bench):
    def act(bench):
        limit = bench.home[0] + 3000
        bench.drives[0].dictionary.set_data(0x607D, 2, limit.to_bytes(4, "little", signed=True))
        bench.run(rows(bench))

    block = both(make_bench, act)
    assert 40 < block.plant.in_blocks < COUNT
    assert len({frame[:2] for frame in block.frames}) > 1


def test_a_following_error_is_found_at_its_sync(make_bench):
    def act(bench):
        bench.drives[1].dictionary.set_data(0x6065, 0, (40).to_bytes(4, "little"))
        bench.drives[1].dictionary.set_data(0x6066, 0, (3).to_bytes(2, "little"))
        bench.run(rows(bench))

    block = both(make_bench, act)
    assert FOLLOWING_ERROR in {frame[:2] for frame in block.frames}


def test_an_end_switch_is_found_at_its_sync(make_bench):
    block = both(make_bench, lambda bench: bench.run(rows(bench)), start=(0.155 - 3e-6, 0.0))
    assert 0 < block.plant.in_blocks < COUNT
    assert OVER_TRAVEL in {frame[:2] for frame in block.frames}


OTHERS = {
    "another host": lambda bench: bench.world.connect(object(), deque()),
    "somebody hears a TPDO": lambda bench: bench.world.subscribe(0x182, lambda data: None),
    "somebody hears an RPDO": lambda bench: bench.world.subscribe(0x202, lambda data: None),
    "an RPDO with an event timer": lambda bench: bench.host.write(2, 0x1400, 5, "H", 100),
    "a TPDO at every second SYNC": lambda bench: bench.host.write(2, 0x1800, 2, "B", 2),
    "csp held by halt": lambda bench: bench.host.control(0x10F),
    "another mode": lambda bench: bench.host.write(1, 0x6060, 0, "b", 1),
}


@pytest.mark.parametrize("other", OTHERS.values(), ids=OTHERS)
def test_there_is_no_block_where_more_than_the_demand_may_change(make_bench, other):
    bench = make_bench()
    other(bench)
    before = bench.plant.in_blocks
    bench.run(rows(bench, words=0x10F if other is OTHERS["csp held by halt"] else 0x0F))
    assert bench.plant.in_blocks == before


def test_a_signal_after_a_block_finds_all_at_the_end_of_it(make_bench):
    """The plant is never ahead of the bus: the stage stops from where it is."""
    single, block = make_bench(), make_bench()
    block.plant.interrupted_at = 60
    with pytest.raises(KeyboardInterrupt):
        block.run(rows(block))
    block.plant.interrupted_at = 10 * COUNT
    done = len(block.frames) // 2
    assert 60 <= done < COUNT
    single.world.subscribe(0x80, lambda data: None)
    single.run(rows(single)[:done])
    for bench in (single, block):
        bench.run(rows(bench, words=0x02)[done : done + 50])
    assert block.frames == single.frames
    assert block.state == single.state
