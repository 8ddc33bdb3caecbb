"""bus.asc as other programs read it."""

from datetime import datetime

import can
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from stagectl.errors import StagectlError, UnusableInput
from stagectl.store import BusLog, read_log, recover_log
from tests.unit.stagectl.store.full_disk import REASON, full_after
from tests.unit.stagectl.store.logs import ONE, STARTED, logged

FRAMES = st.lists(
    st.tuples(
        st.integers(0, 10**12),
        st.one_of(st.integers(0, 0x7FF), st.integers(0x800, 0x1FFFFFFF)),
        st.binary(max_size=8),
    ),
    max_size=30,
)


def read(path):
    with can.LogReader(path) as reader:
        return list(reader)


@given(FRAMES)
@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_python_can_and_we_read_every_frame(tmp_path, frames):
    frames.sort(key=lambda frame: frame[0])
    log = logged(tmp_path, *frames)
    messages, back = read(log.path), read_log(log.path)
    first = frames[0][0] if frames else 0
    at = [pytest.approx(t - first, abs=510) for t, _, _ in frames]
    assert [(m.arbitration_id, bytes(m.data), m.dlc) for m in messages] == [
        (can_id, data, len(data)) for _, can_id, data in frames
    ]
    assert [m.is_extended_id for m in messages] == [can_id > 0x7FF for _, can_id, _ in frames]
    assert [m.timestamp * 1e9 for m in messages] == at
    assert [(f.time_ns, f.can_id, f.data) for f in back.frames()] == [
        (t, *frame[1:]) for t, frame in zip(at, frames, strict=True)
    ]
    assert back.digest == back.stated == log.digest


def test_tap_copies_the_data(tmp_path):
    buffer = bytearray(b"\x01\x02")
    with BusLog(tmp_path / "bus.asc", STARTED) as log:
        log.tap(0, 0x181, buffer)
        buffer[0] = 0xFF
        log.tap(1, 0x181, buffer)
    assert [bytes(m.data) for m in read(tmp_path / "bus.asc")] == [b"\x01\x02", b"\xff\x02"]


def test_python_can_reads_the_date(tmp_path):
    logged(tmp_path, (5_000_000_000, 0x181, b""))
    with can.ASCReader(tmp_path / "bus.asc", relative_timestamp=False) as reader:
        (message,) = reader
    local = datetime(2026, 11, 2, 8, 5, 6, 7000)
    assert message.timestamp == pytest.approx(local.timestamp())


def test_the_spool_of_a_killed_run_becomes_a_log(tmp_path):
    whole = tmp_path / "bus.asc"
    log = BusLog(whole, STARTED)
    for k in range(10_000):
        log.tap(k * 1000, 0x181, bytes([k % 256] * 8))
    killed = tmp_path / "killed"
    killed.mkdir()
    cut = (tmp_path / "bus.frames").read_bytes()[:-7]  # in the middle of a frame
    (killed / "bus.frames").write_bytes(cut)
    assert recover_log(killed) == killed / "bus.asc"
    frames = read(killed / "bus.asc")
    assert len(frames) > 5_000
    assert bytes(frames[77].data) == bytes([77] * 8)
    assert recover_log(killed) is None
    assert sorted(p.name for p in killed.iterdir()) == ["bus.asc"]
    log.close()
    log.close()
    assert len(read(whole)) == 10_000
    assert not (tmp_path / "bus.frames").exists()


def test_other_files_are_refused(tmp_path):
    (tmp_path / "bus.frames").write_text("hello, this is not it")
    with pytest.raises(UnusableInput, match=r"bus\.frames"):
        recover_log(tmp_path)


def test_a_log_that_cannot_be_made_is_one_line(tmp_path):
    with pytest.raises(StagectlError, match="cannot create"):
        BusLog(tmp_path / "absent" / "bus.asc", STARTED)


@pytest.mark.parametrize("name", ["bus.frames", "bus.asc.part"])
def test_a_link_in_the_way_is_replaced_and_never_followed(tmp_path, name):
    precious = tmp_path / "precious"
    precious.write_text("mine")
    (tmp_path / name).symlink_to(precious)
    assert logged(tmp_path, ONE).failure is None
    assert precious.read_text() == "mine"
    assert len(read(tmp_path / "bus.asc")) == 1


def test_a_full_disk_keeps_no_frame_from_the_bus(tmp_path):
    """The tap sees a quick stop before the bus does: it must not raise."""
    with full_after(10):
        log = logged(tmp_path, *[ONE] * 20_000)  # many times the buffer
    assert f"bus.frames: cannot write: {REASON}" in log.failure
    assert sorted(p.name for p in tmp_path.iterdir()) == ["bus.frames"]


def test_a_full_disk_at_the_end_keeps_the_spool_only(tmp_path):
    with full_after(64):
        log = logged(tmp_path, ONE)
    assert f"bus.asc: cannot write: {REASON}" in log.failure
    assert sorted(p.name for p in tmp_path.iterdir()) == ["bus.frames"]
    assert recover_log(tmp_path) == tmp_path / "bus.asc"


def test_the_next_runs_keep_the_logs_of_killed_ones(tmp_path):
    for number in (1, 2):
        log = BusLog(tmp_path / "bus.asc", STARTED)
        for _ in range(5_000):  # beyond the buffer
            log.tap(0, 0x180 + number, b"")
        killed = (tmp_path / "bus.frames").read_bytes()
        log.close()
        (tmp_path / "bus.frames").write_bytes(killed)
    logged(tmp_path, (0, 0x200, b""))
    kept = [read(tmp_path / name) for name in ("bus-recovered.asc", "bus-recovered-2.asc")]
    assert [messages[0].arbitration_id for messages in kept] == [0x181, 0x182]
    assert [m.arbitration_id for m in read(tmp_path / "bus.asc")] == [0x200]


def test_a_run_killed_before_its_first_block_leaves_nothing(tmp_path):
    (tmp_path / "bus.frames").write_bytes(b"")
    assert recover_log(tmp_path) is None
    assert list(tmp_path.iterdir()) == []
