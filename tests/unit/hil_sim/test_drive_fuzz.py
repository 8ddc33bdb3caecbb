"""Whatever a host sends, the drive keeps its invariants and never raises."""

import struct

import can
from hypothesis import given, settings
from hypothesis import strategies as st

from hil_sim.bus.world import World
from hil_sim.stage import VirtualStage

POWERED = (0x27, 0x07, 0x0F)

words = st.sampled_from([0x00, 0x02, 0x06, 0x07, 0x0F, 0x1F, 0x3F, 0x5F, 0x80, 0x8F, 0x10F, 0x11F])
rpdos = st.builds(
    lambda word, target, force: (0x201, struct.pack("<Hih", word, target, force)),
    words,
    st.integers(-3_000_000, 3_000_000),
    st.integers(-32768, 32767),
) | st.builds(
    lambda word, third, target: (0x401 + third, struct.pack("<Hi", word, target)),
    words,
    st.sampled_from([0, 0x100]),
    st.integers(-3_000_000, 3_000_000),
)
objects = st.sampled_from(
    [
        (0x6040, 0, "H"), (0x6060, 0, "b"), (0x6098, 0, "b"), (0x605A, 0, "h"), (0x605C, 0, "h"),
        (0x605E, 0, "h"), (0x6007, 0, "h"), (0x6066, 0, "H"), (0x607C, 0, "i"), (0x607D, 2, "i"),
        (0x60C2, 1, "B"), (0x6081, 0, "I"), (0x6083, 0, "I"), (0x6085, 0, "I"), (0x60A4, 1, "I"),
        (0x1400, 1, "I"), (0x1400, 2, "B"), (0x1600, 0, "B"), (0x1600, 1, "I"), (0x1800, 2, "B"),
        (0x1016, 1, "I"), (0x1017, 0, "H"), (0x1005, 0, "I"), (0x1014, 0, "I"),
    ]
)  # fmt: skip


def write(entry, value):
    index, sub, fmt = entry
    size = struct.calcsize("<" + fmt)
    data = (value & (256**size - 1)).to_bytes(size, "little").ljust(4, b"\0")
    return 0x601, struct.pack("<BHB", 0x23 | (4 - size) << 2, index, sub) + data


small = st.sampled_from([0, 1, 2, 5, 6, 8, 33, 34, 37, 255])
writes = st.builds(write, objects, small | st.integers(0, 2**32 - 1))
powering = st.sampled_from([6, 7, 15, 15, 31]).map(lambda w: write((0x6040, 0, "H"), w))
modes = st.sampled_from([1, 3, 6, 8, 9, 10]).map(lambda m: write((0x6060, 0, "b"), m))
nmt = st.sampled_from([1, 1, 1, 2, 128, 129, 130]).map(lambda c: (0x000, bytes((c, 0))))
noise = st.tuples(
    st.sampled_from([0x000, 0x080, 0x201, 0x301, 0x401, 0x501, 0x601, 0x701, 0x77F]),
    st.binary(max_size=8),
)
sync = st.just((0x080, b""))
waits = st.integers(1, 60).map(lambda ms: (None, ms))
steps = st.lists(
    st.one_of(sync, sync, rpdos, rpdos, powering, powering, modes, writes, nmt, noise, waits),
    min_size=5,
    max_size=60,
)


def enabling(mode):
    """Operational and enabled: where most can go wrong."""
    words = [write((0x6040, 0, "H"), word) for word in (6, 7, 15)]
    return [(0x000, b"\x01\x00"), write((0x6060, 0, "b"), mode), *words]


@settings(max_examples=150, deadline=None)
@given(st.booleans(), st.sampled_from([1, 6, 8]), steps)
def test_any_sequence_of_frames(
    make_following_plant, make_host, stage_settings, mapped, mode, sequence
):
    plant = make_following_plant()
    world = World("fuzz")
    stage = VirtualStage(stage_settings, 1, plant=plant)
    stage.attach(world)
    supported = stage.drives[0].dictionary.integer(0x650200)
    displayed = {0, *(n for n in range(1, 33) if supported >> (n - 1) & 1)}
    with can.Bus(interface="lockstep", channel="fuzz") as bus:
        bus.clock.sleep_until_ns(30_000_000)
        if mapped:
            make_host(bus).map_for_csp(1)
        for can_id, payload in [*enabling(mode), *sequence]:
            before = plant.actual[0], plant.time_ns
            if can_id is None:
                bus.clock.sleep_until_ns(bus.clock.now_ns() + payload * 1_000_000)
            else:
                bus.send(can.Message(arbitration_id=can_id, data=payload, is_extended_id=False))
                bus.clock.sleep_until_ns(bus.clock.now_ns() + 1_000_000)
            status = stage.drives[0].dictionary.integer(0x604100)
            state = status & 0x6F if status & 0x6F in POWERED else None
            assert plant.powered[0] == (state is not None), hex(status)
            if not plant.powered[0]:
                assert plant.offset[0] == 0.0
                assert stage.drives[0].dictionary.integer(0x606100) in displayed
            assert plant.time_ns >= before[1]
