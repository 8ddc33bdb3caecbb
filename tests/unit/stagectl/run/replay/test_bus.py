"""The bus of a replay: what it hands over, what it compares, and how much of the log it holds."""

import can
import pytest

from stagectl.run.replay.bus import ReplayBus
from stagectl.store import LoggedFrame

MS = 1_000_000


def frame(time_ns, sent, can_id, data=b"\x01"):
    return LoggedFrame(time_ns, sent, can_id, data)


def message(can_id, data=b"\x01"):
    return can.Message(arbitration_id=can_id, data=data, is_extended_id=False)


LOG = [
    frame(0, True, 0x201), frame(0, True, 0x080, b""), frame(0, False, 0x181),
    frame(1 * MS, True, 0x201), frame(1 * MS, True, 0x080, b""), frame(1 * MS, False, 0x181),
]  # fmt: skip


@pytest.fixture
def buses():
    made = []
    yield made
    for bus in made:
        bus.shutdown()


def replayed(buses, frames, complete=True):
    buses.append(ReplayBus(iter(frames), len(frames), complete))
    return buses[-1]


@pytest.mark.parametrize(
    ("time_ns", "can_id", "data"),
    [(0, 0x202, b"\x01"), (0, 0x201, b"\x02"), (1000, 0x201, b"\x01")],
    ids=["id", "data", "time"],
)
def test_the_first_other_frame_ends_the_replay(buses, time_ns, can_id, data):
    bus = replayed(buses, LOG)
    bus.sleep_until_ns(time_ns)
    with pytest.raises(can.CanOperationError, match="over"):
        bus.send(message(can_id, data))
    assert (bus.difference.number, bus.difference.recorded) == (1, LOG[0])
    assert bus.difference.sent == frame(time_ns, True, can_id, data)
    with pytest.raises(can.CanOperationError, match="over"):
        bus.recv(0.0)


def test_frames_left_over_are_a_difference_unless_the_run_was_killed(
    buses,
):
    bus = replayed(buses, LOG)
    bus.send(message(0x201))
    bus.finish()
    assert (bus.difference.number, bus.difference.sent) == (2, None)
    killed = replayed(buses, LOG[:1], complete=False)
    killed.send(message(0x201))
    with pytest.raises(can.CanOperationError, match="over"):
        killed.send(message(0x080, b""))
    assert killed.difference is None


def test_a_frame_beyond_the_log_of_a_complete_run_is_a_difference(buses):
    bus = replayed(buses, LOG[:1])
    bus.send(message(0x201))
    with pytest.raises(can.CanOperationError):
        bus.send(message(0x080, b""))
    assert (bus.difference.number, bus.difference.recorded) == (2, None)


def test_a_long_log_is_read_as_the_replay_proceeds(buses):
    ahead, taken, cycles = 0, 0, 5000

    def log():
        nonlocal taken
        for cycle in range(cycles):
            taken += 2
            yield frame(cycle * MS, True, 0x080, b"")
            yield frame(cycle * MS, False, 0x181)

    bus = ReplayBus(log(), 2 * cycles, complete=True)
    buses.append(bus)
    for cycle in range(cycles):
        bus.sleep_until_ns(cycle * MS)
        bus.send(message(0x080, b""))
        assert bus.recv(0.0) is not None
        ahead = max(ahead, taken - 2 * (cycle + 1))
    bus.finish()
    assert bus.difference is None
    assert ahead <= 2
